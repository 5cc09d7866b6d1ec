//! The equations of the points in the linear problem, their robust weights, and their weighted sums.
//!
//! # Shapes and units
//! Lengths in mm. A sum is that of four sums over every fourth point, which do not wait for each
//! other.

use super::directions::Matrix6;
use crate::geometry::Vector;
use alloc::vec::Vec;

/// Residual from which Huber's weights fall, in σ.
const HUBER: f64 = 1.345;
/// Residual from which Tukey's weights are 0, in σ.
pub(super) const TUKEY: f64 = 4.685;

/// The function that gives the weight of a point by its residual.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum WeightFunction {
    Huber,
    Tukey,
}

impl WeightFunction {
    /// The weight of a residual in σ.
    #[inline(always)]
    fn weight(self, residual: f64) -> f64 {
        let size = residual.abs();
        match self {
            Self::Huber if size <= HUBER => 1.0,
            Self::Huber => HUBER / size,
            Self::Tukey if size >= TUKEY => 0.0,
            Self::Tukey => {
                let rest = 1.0 - (size / TUKEY) * (size / TUKEY);
                rest * rest
            }
        }
    }
}

/// The equation of a point in the linear problem.
#[derive(Clone, Copy, Debug)]
pub(super) struct Equation {
    /// The residual at the motion about which the problem is linear, mm.
    pub residual: f64,
    /// What a further motion takes off the residual, see
    /// [`Facet::jacobian`](super::Facet::jacobian).
    pub jacobian: [f64; 6],
    /// Variance of the x and y of the facet's lift.
    pub lift_variance: f64,
    /// From the centre to the point, in radii.
    pub lever: Vector,
    /// Variance of the point's height, mm².
    pub variance: f64,
    /// Variance of the point's height and of the surface's, mm².
    pub both: f64,
}

impl Equation {
    /// The residual after a further motion, mm.
    fn after(&self, further: &[f64; 6]) -> f64 {
        let ([a, b, c, d, e, f], x) = (&self.jacobian, further);
        let shift = a * x[0] + b * x[1] + c * x[2];
        let turn = d * x[3] + e * x[4] + f * x[5];
        self.residual - (shift + turn)
    }
}

/// The equations of all points; buffers that the next problem uses again.
#[derive(Debug, Default)]
pub struct Equations {
    all: Vec<Equation>,
    /// Residuals after a further motion.
    after: Vec<f64>,
    weights: Vec<f64>,
    sizes: Vec<f64>,
}

/// σ of a normal distribution over its median absolute deviation.
const MEDIAN_TO_SIGMA: f64 = 1.4826;

impl Equations {
    pub(super) fn clear(&mut self) {
        self.all.clear();
    }

    pub(super) fn push(&mut self, equation: Equation) {
        self.all.push(equation);
    }

    pub(super) fn len(&self) -> usize {
        self.all.len()
    }

    /// How many residuals are smaller than a size.
    pub(super) fn agreeing(&self, limit: f64) -> usize {
        let residuals = self.all.iter().map(|of| of.residual);
        residuals.filter(|residual| residual.abs() < limit).count()
    }

    /// The error of a residual that the points' errors predict, RMS.
    pub(super) fn predicted(&self) -> f64 {
        let both: f64 = self.all.iter().map(|of| of.both).sum();
        libm::sqrt(both / self.len() as f64)
    }

    /// Weighs the points by their residuals after a further motion. Returns σ of the residuals:
    /// that which follows from their median, at least `least`.
    pub(super) fn weigh(
        &mut self,
        function: WeightFunction,
        further: &[f64; 6],
        least: f64,
    ) -> f64 {
        self.find_residuals(further);
        self.sizes.clear();
        self.sizes.extend(self.after.iter().map(|r| r.abs()));
        let middle = self.len() / 2;
        let below = self.sizes.iter().filter(|r| **r <= least / MEDIAN_TO_SIGMA);
        let scale = if below.count() > middle {
            least
        } else {
            let (_, median, _) = self.sizes.select_nth_unstable_by(middle, f64::total_cmp);
            (MEDIAN_TO_SIGMA * *median).max(least)
        };
        self.find_weights(function, scale);
        scale
    }

    fn find_residuals(&mut self, further: &[f64; 6]) {
        self.after.clear();
        self.after
            .extend(self.all.iter().map(|of| of.after(further)));
    }

    fn find_weights(&mut self, function: WeightFunction, scale: f64) {
        let weight = |residual: &f64| function.weight(residual / scale);
        self.weights.clear();
        self.weights.extend(self.after.iter().map(weight));
    }

    /// The sums with the weights found last.
    pub(super) fn sums(&self) -> Sums {
        let mut sums = [[0.0; 4]; SUMS];
        for (at, (of, weight)) in self.all.iter().zip(&self.weights).enumerate() {
            let mut place = 0;
            let mut add = |value: f64| {
                sums[place][at % 4] += value;
                place += 1;
            };
            let r = &of.jacobian;
            let weighted = r.map(|r| weight * r);
            for i in 0..6 {
                for other in &r[i..] {
                    add(weighted[i] * other);
                }
            }
            for weighted in weighted {
                add(weighted * of.residual);
            }
            let Vector { x, y, z } = of.lever;
            let n = weight * of.lift_variance;
            let (nx, ny, nz) = (n * x, n * y, n * z);
            for value in [n, nx, ny, nz, nz * z, nx * z, ny * z, nx * x] {
                add(value);
            }
            sums[SUMS - 1][at % 4] += ny * y;
        }
        Sums(sums.map(|[a, b, c, d]| (a + b) + (c + d)))
    }

    /// Points with a weight above 0.
    pub(super) fn inside(&self) -> usize {
        self.weights.iter().filter(|weight| **weight > 0.0).count()
    }

    /// Covariance of the right-hand side, mm², with Tukey's weights after a further motion; `scale`
    /// is σ of the residuals.
    pub(super) fn covariance(&mut self, further: &[f64; 6], scale: f64) -> Matrix6 {
        self.find_residuals(further);
        self.find_weights(WeightFunction::Tukey, scale);
        for (weight, of) in self.weights.iter_mut().zip(&self.all) {
            *weight = *weight * *weight * of.variance;
        }
        self.sums().matrix()
    }
}

/// Products r_i r_j of a Jacobian r, row by row from the diagonal on.
const SQUARES: usize = 21;
/// Then 6 products of r and the residual, and 8 of the errors of lifts ([`Sums::lift_noise`]).
const SUMS: usize = SQUARES + 6 + 8;

/// Weighted sums over points.
pub(super) struct Sums([f64; SUMS]);

impl Sums {
    /// Σ w r rᵀ, r the Jacobian.
    pub fn matrix(&self) -> Matrix6 {
        let mut at = 0;
        let mut upper = [[0.0; 6]; 6];
        for (i, row) in upper.iter_mut().enumerate() {
            for value in &mut row[i..] {
                *value = self.0[at];
                at += 1;
            }
        }
        mirrored(upper)
    }

    /// Σ w r · residual.
    pub fn right_side(&self) -> [f64; 6] {
        core::array::from_fn(|i| self.0[SQUARES + i])
    }

    /// Σ w n (x xᵀ + y yᵀ). n is the variance of the x and y of a point's lift m, and q its lever.
    /// The point's Jacobian is (m, q × m); its derivatives by m_x and m_y are x = (1, 0, 0, 0, q_z,
    /// −q_y) and y = (0, 1, 0, −q_z, 0, q_x).
    pub fn lift_noise(&self) -> Matrix6 {
        let [n, x, y, z, zz, xz, yz, xx_yy] = core::array::from_fn(|i| self.0[SQUARES + 6 + i]);
        mirrored([
            [n, 0.0, 0.0, 0.0, z, -y],
            [0.0, n, 0.0, -z, 0.0, x],
            [0.0; 6],
            [0.0, 0.0, 0.0, zz, 0.0, -xz],
            [0.0, 0.0, 0.0, 0.0, zz, -yz],
            [0.0, 0.0, 0.0, 0.0, 0.0, xx_yy],
        ])
    }
}

/// A symmetric matrix from its upper half.
fn mirrored(upper: Matrix6) -> Matrix6 {
    core::array::from_fn(|i| core::array::from_fn(|j| upper[i.min(j)][i.max(j)]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inspect::align::directions::form;

    /// Numbers from −1 to 1 that follow no pattern.
    fn scatter(at: usize) -> f64 {
        let bits = (at as u32).wrapping_mul(2_654_435_761).rotate_left(13);
        f64::from(bits.wrapping_mul(2_246_822_519)) / f64::from(1_u32 << 31) - 1.0
    }

    fn equation(point: usize) -> Equation {
        let value = |i: usize| scatter(100 * point + i);
        let (lift, lever) = (
            Vector::new(value(0), value(1), value(2)),
            Vector::new(value(3), value(4), value(5)),
        );
        let turning = lever.cross(lift);
        Equation {
            residual: if point.is_multiple_of(5) { 2.0 } else { 0.1 } * value(6),
            jacobian: [lift.x, lift.y, lift.z, turning.x, turning.y, turning.z],
            lift_variance: value(7),
            lever,
            variance: value(8) * value(8),
            both: 0.01,
        }
    }

    #[test]
    fn sums_are_those_of_their_definition() {
        const POINTS: usize = 43;
        let mut equations = Equations::default();
        // What an earlier, larger problem leaves behind counts for nothing.
        for points in [POINTS + 9, POINTS] {
            equations.clear();
            (0..points).for_each(|point| equations.push(equation(point)));
        }
        let further = [0.05, -0.02, 0.03, 0.04, -0.01, 0.02];
        let probe = [0.3, -0.7, 0.5, 0.9, -0.2, 0.4];
        for function in [WeightFunction::Huber, WeightFunction::Tukey] {
            let scale = equations.weigh(function, &further, 0.02);
            let sums = equations.sums();
            let after = |e: &Equation| {
                let taken = e.jacobian.iter().zip(further).map(|(r, x)| r * x);
                e.residual - taken.sum::<f64>()
            };
            let (mut squares, mut right, mut noise) = (0.0, 0.0, 0.0);
            let (mut sizes, mut inside) = (Vec::new(), 0);
            for e in (0..POINTS).map(equation) {
                let weight = function.weight(after(&e) / scale);
                let dot = |r: &[f64; 6]| r.iter().zip(probe).map(|(r, p)| r * p).sum::<f64>();
                let Vector { x, y, z } = e.lever;
                let (by_x, by_y) = ([1.0, 0.0, 0.0, 0.0, z, -y], [0.0, 1.0, 0.0, -z, 0.0, x]);
                let n = weight * e.lift_variance;
                squares += weight * dot(&e.jacobian) * dot(&e.jacobian);
                right += weight * dot(&e.jacobian) * e.residual;
                noise += n * (dot(&by_x) * dot(&by_x) + dot(&by_y) * dot(&by_y));
                inside += usize::from(weight > 0.0);
                sizes.push(after(&e).abs());
            }
            sizes.sort_by(f64::total_cmp);
            assert!((scale - MEDIAN_TO_SIGMA * sizes[POINTS / 2]).abs() < 1e-12);
            assert_eq!(equations.inside(), inside);
            let along: f64 = sums
                .right_side()
                .iter()
                .zip(probe)
                .map(|(r, p)| r * p)
                .sum();
            let found = [
                form(&probe, &sums.matrix(), &probe),
                along,
                form(&probe, &sums.lift_noise(), &probe),
            ];
            for (found, expected) in found.into_iter().zip([squares, right, noise]) {
                assert!((found - expected).abs() < 1e-12, "{found} {expected}");
            }
        }
        // The least σ holds where the median is below it.
        assert_eq!(equations.weigh(WeightFunction::Huber, &further, 9.0), 9.0);
    }
}
