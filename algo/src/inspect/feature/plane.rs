//! The plane that fits the cells of a region best, with the covariance of its parameters.
//!
//! # Idea
//! What is measured of a cell is how far the surface lies above golden *along the camera's ray*.
//! The plane is fitted to these distances. A fit of heights at the taught places x, y instead is
//! biased where a face is steep and deviates: the point that a ray meets is displaced along x and
//! y, too. A face that was bent by 2° more than golden's 45° would be wrong by a few hundredths of
//! a degree.
//!
//! # Equations
//! The plane is z = c + a (x − x₀) + b (y − y₀), with the middle (x₀, y₀) of the region as taught.
//! The ray of a cell goes through its taught point (x, y, z) along (r, s, 1), and meets the plane
//! at the distance
//!
//! ```text
//! t = [c + a (x − x₀) + b (y − y₀) − z] / D        D = 1 − a r − b s
//! ∂t/∂(c, a, b) = (1, x + t r − x₀, y + t s − y₀) / D
//! ```
//!
//! Σ w (d − t)² is made least by Gauss–Newton, d the measured deviation and w the number of pixels
//! as taught, beginning with the plane that fits the heights in closed form. t depends on the plane
//! alone and not on d, so noise of d does not bias the slopes. With N = Σ w j jᵀ, j = ∂t/∂(c, a,
//! b), a cell changes the parameters by N⁻¹ w j, and the covariance is Σ (N⁻¹ w j)(N⁻¹ w j)ᵀ σ_z² /
//! n, n the measured pixels.
//!
//! # Shapes and units
//! c in mm, a and b in mm per mm. Sums run over the cells in their order.
//!
//! # Accuracy
//! `a_plane_is_found_exactly_from_points_on_rays`, and on parts of the simulated head
//! `tests/suite/planes.rs`. Faces that lie along z have no such plane.

use super::cells::{Cell, LevelPlane, weight};
use super::geometry::Geometry;
use super::taught::TaughtCell;
use crate::geometry::Vector;
use crate::inspect::align::Motion;
use crate::math::solve::Normal;
use alloc::vec::Vec;

/// A symmetric matrix of the three parameters of a plane.
pub type Matrix3 = [[f64; 3]; 3];

/// Rounds of the fit: each squares the relative error, which is below 0.1 before the first.
const ROUNDS: usize = 4;

/// The middle of a region as taught: x and y, mm.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Middle {
    x: f64,
    y: f64,
}

impl Middle {
    /// The mean of the pixels of these cells.
    pub fn of(cells: &[TaughtCell]) -> Self {
        let mean = |value: fn(&TaughtCell) -> f64| {
            let pixels = cells.iter().map(|cell| f64::from(cell.pixels));
            let sum: f64 = cells
                .iter()
                .zip(pixels.clone())
                .map(|(cell, n)| n * value(cell))
                .sum();
            sum / pixels.sum::<f64>().max(1.0)
        };
        Self {
            x: mean(|cell| cell.x),
            y: mean(|cell| cell.y),
        }
    }
}

/// A plane that was fitted to cells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FittedPlane {
    /// c, a, b.
    pub parameters: [f64; 3],
    /// Their covariance by the noise of pixels.
    pub covariance: Matrix3,
    middle: Middle,
    /// 1 if the camera sees the upper side, −1 of an overhang.
    side: f64,
}

impl FittedPlane {
    /// The plane of the measured cells of a region with this middle. `variance` is that of a single
    /// pixel's height, mm². `rows` becomes what 1 mm more of each cell's deviation adds to the
    /// parameters. `None` where the cells lie on a line or at one place, or there are none.
    pub fn of(
        cells: &[Cell],
        middle: Middle,
        variance: f64,
        rows: &mut Vec<[f64; 3]>,
    ) -> Option<Self> {
        rows.clear();
        let start = LevelPlane::of(cells)?;
        let (dx, dy) = (middle.x - start.centre[0], middle.y - start.centre[1]);
        let height = start.centre[2] + start.along * dx + start.down * dy;
        let mut parameters = [height, start.along, start.down];
        for _ in 0..ROUNDS {
            let met = cells.iter().map(|cell| {
                let (t, j) = meet(cell, middle, parameters);
                let root = libm::sqrt(weight(cell));
                (j.map(|j| j * root), (cell.deviation - t) * root)
            });
            let change = Normal::of(met).solve()?;
            for (parameter, change) in parameters.iter_mut().zip(change) {
                *parameter += change;
            }
        }
        let mut normal = Normal::<3>::default();
        let mut side = 0.0;
        for cell in cells {
            let (_, j) = meet(cell, middle, parameters);
            let root = libm::sqrt(weight(cell));
            normal.add(&j.map(|j| j * root), 0.0);
            side += weight(cell) * j[0];
        }
        let unit = |at: usize| core::array::from_fn(|i| f64::from(u8::from(i == at)));
        let solve = |right: [f64; 3]| Normal { right, ..normal }.solve();
        let inverse = [solve(unit(0))?, solve(unit(1))?, solve(unit(2))?];
        let mut covariance = Matrix3::default();
        for cell in cells {
            let (_, j) = meet(cell, middle, parameters);
            let row =
                inverse.map(|row| weight(cell) * (row[0] * j[0] + row[1] * j[1] + row[2] * j[2]));
            let mean = variance / cell.pixels;
            for (sums, value) in covariance.iter_mut().zip(row) {
                for (sum, other) in sums.iter_mut().zip(row) {
                    *sum += value * other * mean;
                }
            }
            rows.push(row);
        }
        parameters
            .iter()
            .all(|value| value.is_finite())
            .then_some(Self {
                parameters,
                covariance,
                middle,
                side: if side < 0.0 { -1.0 } else { 1.0 },
            })
    }

    /// The geometry of the plane with these parameters.
    pub fn geometry(&self, [c, a, b]: [f64; 3]) -> Geometry {
        let length = libm::sqrt(1.0 + a * a + b * b);
        Geometry::plane(
            Vector::new(self.middle.x, self.middle.y, c),
            Vector::new(-a, -b, 1.0) * (self.side / length),
        )
    }

    /// The parameters of the plane after a motion of the part; its middle stays where it is.
    pub fn moved(&self, motion: &Motion) -> [f64; 3] {
        let [c, a, b] = self.parameters;
        let point = Vector::new(self.middle.x, self.middle.y, c);
        let now = motion.apply(point);
        let normal = motion.apply(point + Vector::new(-a, -b, 1.0)) - now;
        let (a, b) = (-normal.x / normal.z, -normal.y / normal.z);
        let c = now.z + a * (self.middle.x - now.x) + b * (self.middle.y - now.y);
        [c, a, b]
    }
}

/// The distance along the ray of a cell at which it meets a plane, and its derivatives.
fn meet(cell: &Cell, middle: Middle, [c, a, b]: [f64; 3]) -> (f64, [f64; 3]) {
    let TaughtCell {
        x,
        y,
        height,
        ray: [r, s],
        ..
    } = cell.taught;
    let (x, y) = (x - middle.x, y - middle.y);
    let falling = 1.0 / (1.0 - a * r - b * s);
    let t = (c + a * x + b * y - height) * falling;
    (t, [falling, (x + t * r) * falling, (y + t * s) * falling])
}
