//! The edge of a side, with the covariance of its parameters by noise.
//!
//! # Equations
//! With p the fitted of (t, r), ρ_i = N⁻¹ w_i j_i by how much a residual changes it, N = Σ w j jᵀ,
//! and the line's parameters L,
//!
//! ```text
//! ∂p/∂L = −Σ ρ_i ∂d_i/∂L = G      C_p = Σ ρ_i ρ_iᵀ σ_i² + G C_L Gᵀ      C_pL = G C_L
//! ```

use super::circle::{CircleFit, FitRow};
use super::line::StretchLine;
use super::profile::SideView;
use crate::math::solve::Normal;

/// The share of what blur does by which it is uncertain, along the whole edge: the camera's blur is
/// not measured, and what blur does goes with the square of what a pixel averages.
const BLUR: f64 = 0.35;
/// A bin of more variance than so many times that by noise is not seen well enough to count.
const KNOWN: f64 = 3.0;
/// A bin of less weight does not end the arc.
const COUNTS: f64 = 0.1;

/// A side: its line, and the circle of its edge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RoundEdge {
    /// c, a, t, r: height of the line at the middle of its stretch, mm; its slope towards the
    /// joint; the tangent point, mm along the line from that middle; the radius, mm.
    pub parameters: [f64; 4],
    /// Their covariance by noise.
    pub covariance: [[f64; 4]; 4],
    /// Where the middle of the stretch is: x = s on the left, −s on the right, mm.
    pub middle: f64,
    /// The arc that is seen, from the tangent point, rad.
    pub arc: f64,
    /// Whether the radius is the stated one.
    pub is_stated: bool,
    /// By how much the parameters are off if what blur does is by `BLUR` of it.
    pub blurred: [f64; 4],
    /// By how much they are off for 1 mm of a stated radius.
    pub stated: [f64; 4],
}

impl RoundEdge {
    /// σ of the radius by noise and blur, mm.
    pub fn radius_sigma(&self) -> f64 {
        libm::sqrt(self.covariance[3][3] + self.blurred[3] * self.blurred[3])
    }

    /// Of a fit; `None` if it has no finite covariance.
    pub fn new(
        line: &StretchLine,
        view: &SideView,
        fit: &CircleFit,
        is_stated: bool,
    ) -> Option<Self> {
        // How a row's residual changes with t and the r that is fitted.
        let free = |row: &FitRow| [row.rates.t, if is_stated { 0.0 } else { row.rates.r }];
        let mut normal = Normal::<2>::default();
        for row in &fit.rows {
            let root = libm::sqrt(row.weight / row.seen.variance);
            normal.add(&free(row).map(|rate| rate * root), 0.0);
        }
        if is_stated {
            normal.matrix[1][1] = 1.0;
        }
        let solve = |right: [f64; 2]| Normal { right, ..normal }.solve();
        let inverse = [solve([1.0, 0.0])?, solve([0.0, 1.0])?];
        let mut own = [[0.0; 2]; 2];
        // By how much t and r change with each of c, a and a stated radius.
        let mut by = [[0.0; 3]; 2];
        let mut blurred = [0.0; 4];
        let mut sine = 0.0_f64;
        let (h, a) = (line.stretch(), line.slope);
        for row in &fit.rows {
            let (
                FitRow {
                    bin, seen, rates, ..
                },
                free,
            ) = (row, free(row));
            let weight = row.weight / seen.variance;
            let answer = inverse.map(|row| (row[0] * free[0] + row[1] * free[1]) * weight);
            // The line lifts the profile by 1/h and moves it along by a/h for each mm, and turns it
            // about its middle by 1/h² for each unit of slope.
            let by_height = (rates.t * a + rates.lift) / h;
            let by_slope = (rates.t * bin.y + rates.lift * bin.x) / (h * h);
            for (i, answer_i) in answer.into_iter().enumerate() {
                for (sum, answer_k) in own[i].iter_mut().zip(answer) {
                    *sum += answer_i * answer_k * bin.variance;
                }
                for (sum, rate) in by[i].iter_mut().zip([by_height, by_slope, rates.r]) {
                    *sum -= answer_i * rate;
                }
                blurred[2 + i] += answer_i * BLUR * seen.off;
            }
            if row.weight > COUNTS && seen.variance < KNOWN * bin.variance {
                sine = sine.max(view.profile.sine(seen.ray.inside, fit.p[1]));
            }
        }
        let c = line.covariance;
        let mut covariance = [[0.0; 4]; 4];
        for i in 0..2 {
            for k in 0..2 {
                let cross = by[i][0] * c[0][k] + by[i][1] * c[1][k];
                covariance[i][k] = c[i][k];
                covariance[2 + i][k] = cross;
                covariance[k][2 + i] = cross;
            }
        }
        for i in 0..2 {
            for k in 0..2 {
                let [first, second, ..] = covariance[2 + i];
                covariance[2 + i][2 + k] = own[i][k] + first * by[k][0] + second * by[k][1];
            }
        }
        let [t, r] = fit.p;
        covariance
            .as_flattened()
            .iter()
            .all(|x| x.is_finite())
            .then_some(Self {
                parameters: [line.height, a, t, r],
                covariance,
                middle: line.middle,
                arc: libm::asin(sine.min(1.0)),
                is_stated,
                blurred,
                stated: match is_stated {
                    true => [0.0, 0.0, by[0][2], 1.0],
                    false => [0.0; 4],
                },
            })
    }
}
