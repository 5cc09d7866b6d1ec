//! The shape that points lie on.
//!
//! Gauss–Newton over Σ ρ(d/σ): d the signed distance of a point, σ² its variance by noise, ρ
//! Tukey's biweight (J. W. Tukey; P. W. Holland & R. E. Welsch, Commun. Stat. A 6, 1977: c = 4.685),
//! scaled by the median of |d|/σ where points scatter by more than their noise. Covariance C =
//! (JᵀWJ)⁻¹, W weights over variances.

use super::shape::{Covariance, MAX_PARAMETERS, Parameters, Shape};
use crate::math::solve::solve_symmetric;
use alloc::vec::Vec;

/// Tukey's c: 95 % efficient on normal errors.
const TUKEY: f64 = 4.685;
/// The median of |x| of a standard normal x.
const MEDIAN: f64 = 0.674_489_750_196_081_7;

/// A point that was measured.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct EdgePoint {
    /// x, mm.
    pub x: f64,
    /// y, mm.
    pub y: f64,
    /// Variance of its distance by noise, mm².
    pub variance: f64,
    /// Tukey's weight, 0 to 1.
    pub weight: f64,
}

/// The unknowns of normal equations, packed for a shape's own parameters.
struct NormalEquations {
    count: usize,
    matrix: [f64; MAX_PARAMETERS * MAX_PARAMETERS],
    right: Parameters,
}

impl NormalEquations {
    fn new(count: usize) -> Self {
        Self {
            count,
            matrix: [0.0; MAX_PARAMETERS * MAX_PARAMETERS],
            right: Parameters::default(),
        }
    }

    /// Adds an observation rate · x = value.
    fn add(&mut self, rate: &Parameters, value: f64, weight: f64) {
        let n = self.count;
        for i in 0..n {
            for j in 0..n {
                self.matrix[i * n + j] += rate[i] * rate[j] * weight;
            }
            self.right[i] += rate[i] * value * weight;
        }
    }

    /// The solution for a right side; `None` where the observations do not determine it.
    fn solve(&self, mut right: Parameters) -> Option<Parameters> {
        let n = self.count;
        let mut matrix = self.matrix;
        solve_symmetric(&mut matrix[..n * n], &mut right[..n])?;
        Some(right)
    }
}

/// Moves p to where the points' distances are least, and sets their weights. The covariance of p;
/// `None` if the points do not determine it.
pub fn associate(
    shape: &dyn Shape,
    p: &mut Parameters,
    points: &mut [EdgePoint],
    ratios: &mut Vec<f64>,
) -> Option<Covariance> {
    for _ in 0..20 {
        ratios.clear();
        ratios.extend(points.iter().map(|point| {
            let d = shape.distance(p, point.x, point.y);
            libm::fabs(d) / libm::sqrt(point.variance)
        }));
        let middle = ratios.len() / 2;
        let mut scale: f64 = 1.0;
        if !points.is_empty() {
            let (_, &mut median, _) = ratios.select_nth_unstable_by(middle, f64::total_cmp);
            scale = scale.max(median / MEDIAN);
        }
        let mut normal = NormalEquations::new(shape.count());
        for point in points.iter_mut() {
            let d = shape.distance(p, point.x, point.y);
            let outside = d / (libm::sqrt(point.variance) * scale * TUKEY);
            let inside = (1.0 - outside * outside).max(0.0);
            point.weight = inside * inside;
            let rate = shape.derivative(p, point.x, point.y);
            normal.add(&rate, -d, point.weight / point.variance);
        }
        let step = normal.solve(normal.right)?;
        let mut largest = 0.0_f64;
        for (p, step) in p.iter_mut().zip(step) {
            *p += step;
            largest = largest.max(libm::fabs(step));
        }
        if largest < 3e-6 {
            break;
        }
    }
    // JᵀWJ at p, and its inverse.
    let mut information = NormalEquations::new(shape.count());
    for point in points.iter() {
        let rate = shape.derivative(p, point.x, point.y);
        information.add(&rate, 0.0, point.weight / point.variance);
    }
    let mut inverse = Covariance::default();
    for (i, column) in inverse.iter_mut().enumerate().take(shape.count()) {
        column[i] = 1.0;
        *column = information.solve(*column)?;
    }
    Some(inverse)
}

/// By how much p changes if every point lies farther along d by `shift` mm.
pub fn response(
    shape: &dyn Shape,
    (p, covariance): (&Parameters, &Covariance),
    points: &[EdgePoint],
    shift: impl Fn(&EdgePoint) -> f64,
) -> Parameters {
    let mut right = Parameters::default();
    for point in points {
        let rate = shape.derivative(p, point.x, point.y);
        for (sum, rate) in right.iter_mut().zip(rate) {
            // The distance of the shifted point is larger by the shift; p takes that back.
            *sum -= rate * shift(point) * point.weight / point.variance;
        }
    }
    covariance.map(|row| row.iter().zip(right).map(|(c, r)| c * r).sum())
}
