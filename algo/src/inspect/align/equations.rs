//! The equations of the points in the linear problem, and their weighted sums.
//!
//! # Shapes and units
//! Lengths in mm. Points are kept and summed four at a time, in their order: a sum is that of four
//! sums over every fourth point, the same for all back-ends.

use super::directions::Matrix6;
use super::weight::WeightFunction;
use crate::geometry::Vector;
use crate::simd::{Backend, Lanes, back_end_entry};
use alloc::vec::Vec;

/// The equation of a point in the linear problem.
#[derive(Debug)]
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

/// A value of each of four points.
pub(super) type Four = [f64; 4];

/// The equations of four points; 0 where there are fewer.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct FourEquations {
    residual: Four,
    jacobian: [Four; 6],
    lever: [Four; 3],
    /// Variance of the x and y of the facet's lift.
    lift_variance: Four,
    variance: Four,
}

/// The equations of all points; buffers that the next problem uses again.
#[derive(Debug, Default)]
pub(super) struct Equations {
    all: Vec<FourEquations>,
    points: usize,
    both: f64,
    /// Residuals after a further motion.
    after: Vec<Four>,
    weights: Vec<Four>,
    sizes: Vec<f64>,
}

/// σ of a normal distribution over its median absolute deviation.
const MEDIAN_TO_SIGMA: f64 = 1.4826;

impl Equations {
    pub fn clear(&mut self) {
        self.all.clear();
        (self.points, self.both) = (0, 0.0);
    }

    pub fn push(&mut self, equation: &Equation) {
        let at = self.points % 4;
        if at == 0 {
            self.all.push(FourEquations::default());
        }
        let Some(four) = self.all.last_mut() else {
            return;
        };
        let Vector { x, y, z } = equation.lever;
        four.residual[at] = equation.residual;
        for (four, value) in four.jacobian.iter_mut().zip(equation.jacobian) {
            four[at] = value;
        }
        for (four, value) in four.lever.iter_mut().zip([x, y, z]) {
            four[at] = value;
        }
        four.lift_variance[at] = equation.lift_variance;
        four.variance[at] = equation.variance;
        self.both += equation.both;
        self.points += 1;
    }

    pub fn len(&self) -> usize {
        self.points
    }

    /// How many residuals are smaller than a size.
    pub fn agreeing(&self, limit: f64) -> usize {
        let residuals = self.all.iter().flat_map(|four| four.residual);
        let small = residuals.take(self.points).filter(|r| r.abs() < limit);
        small.count()
    }

    /// The error of a residual that the points' errors predict, RMS.
    pub fn predicted(&self) -> f64 {
        libm::sqrt(self.both / self.points as f64)
    }

    /// Weighs the points by their residuals after a further motion. Returns σ of the residuals:
    /// that which follows from their median, at least `least`.
    pub fn weigh(
        &mut self,
        backend: Backend,
        function: WeightFunction,
        further: &[f64; 6],
        least: f64,
    ) -> f64 {
        self.find_residuals(backend, further);
        let middle = self.points / 2;
        let mut below = 0;
        let after = &self.after.as_flattened()[..self.points];
        count_below(backend, after, least / MEDIAN_TO_SIGMA, &mut below);
        let scale = if below > middle {
            least
        } else {
            self.sizes.clear();
            self.sizes.extend(after.iter().map(|r| r.abs()));
            let (_, median, _) = self.sizes.select_nth_unstable_by(middle, f64::total_cmp);
            (MEDIAN_TO_SIGMA * *median).max(least)
        };
        self.find_weights(backend, function, scale);
        scale
    }

    fn find_residuals(&mut self, backend: Backend, further: &[f64; 6]) {
        self.after.resize(self.all.len(), Four::default());
        residuals_after(backend, &self.all, further, &mut self.after);
    }

    fn find_weights(&mut self, backend: Backend, function: WeightFunction, scale: f64) {
        self.weights.resize(self.all.len(), Four::default());
        let after = self.after.as_flattened();
        let weights = self.weights.as_flattened_mut();
        weigh_residuals(backend, function, after, scale, weights);
        weights[self.points..].fill(0.0);
    }

    /// The sums with the weights found last.
    pub fn sums(&self, backend: Backend) -> Sums {
        let mut sums = [Four::default(); SUMS];
        add_products(backend, &self.all, &self.weights, &mut sums);
        Sums(sums.map(|[a, b, c, d]| (a + b) + (c + d)))
    }

    /// Points with a weight above 0.
    pub fn inside(&self) -> usize {
        let weights = self.weights.as_flattened().iter();
        weights.filter(|weight| **weight > 0.0).count()
    }

    /// Covariance of the right-hand side, mm², with Tukey's weights after a further motion; `scale`
    /// is σ of the residuals.
    pub fn covariance(&mut self, backend: Backend, further: &[f64; 6], scale: f64) -> Matrix6 {
        self.find_residuals(backend, further);
        self.find_weights(backend, WeightFunction::Tukey, scale);
        let variances = self.all.iter().flat_map(|four| four.variance);
        for (weight, variance) in self.weights.as_flattened_mut().iter_mut().zip(variances) {
            *weight = *weight * *weight * variance;
        }
        self.sums(backend).matrix()
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

back_end_entry! {
    /// The residuals after a further motion.
    fn residuals_after [] = take_off(
        equations: &[FourEquations],
        further: &[f64; 6],
        after: &mut [Four],
    )
}

#[inline(always)]
fn take_off<V: Lanes>(_: V, equations: &[FourEquations], further: &[f64; 6], after: &mut [Four]) {
    for (after, four) in after.iter_mut().zip(equations) {
        let [a, b, c, d, e, f] = &four.jacobian;
        for i in 0..4 {
            let shift = a[i] * further[0] + b[i] * further[1] + c[i] * further[2];
            let turn = d[i] * further[3] + e[i] * further[4] + f[i] * further[5];
            after[i] = four.residual[i] - (shift + turn);
        }
    }
}

back_end_entry! {
    /// Counts the residuals of at most a size.
    fn count_below [] = count_small(residuals: &[f64], most: f64, count: &mut usize)
}

#[inline(always)]
fn count_small<V: Lanes>(_: V, residuals: &[f64], most: f64, count: &mut usize) {
    *count = 0;
    for residual in residuals {
        *count += usize::from(residual.abs() <= most);
    }
}

back_end_entry! {
    /// The weights of residuals whose σ is `scale`.
    fn weigh_residuals [] = apply_weights(
        function: WeightFunction,
        residuals: &[f64],
        scale: f64,
        weights: &mut [f64],
    )
}

#[inline(always)]
fn apply_weights<V: Lanes>(
    _: V,
    function: WeightFunction,
    residuals: &[f64],
    scale: f64,
    weights: &mut [f64],
) {
    match function {
        WeightFunction::Huber => {
            for (weight, residual) in weights.iter_mut().zip(residuals) {
                *weight = WeightFunction::huber(residual / scale);
            }
        }
        WeightFunction::Tukey => {
            for (weight, residual) in weights.iter_mut().zip(residuals) {
                *weight = WeightFunction::tukey(residual / scale);
            }
        }
    }
}

back_end_entry! {
    /// The weighted sums over every fourth point.
    fn add_products [] = sum_products(
        equations: &[FourEquations],
        weights: &[Four],
        sums: &mut [Four; SUMS],
    )
}

#[inline(always)]
fn sum_products<V: Lanes>(
    _: V,
    equations: &[FourEquations],
    weights: &[Four],
    sums: &mut [Four; SUMS],
) {
    for (four, weight) in equations.iter().zip(weights) {
        let r = &four.jacobian;
        let mut at = 0;
        for i in 0..6 {
            let weighted = product(weight, &r[i]);
            for other in &r[i..] {
                add_product(&mut sums[at], &weighted, other);
                at += 1;
            }
            add_product(&mut sums[SQUARES + i], &weighted, &four.residual);
        }
        let [x, y, z] = &four.lever;
        let n = product(weight, &four.lift_variance);
        let (nx, ny, nz) = (product(&n, x), product(&n, y), product(&n, z));
        let lifts = &mut sums[SQUARES + 6..];
        add_product(&mut lifts[0], &n, &[1.0; 4]);
        add_product(&mut lifts[1], &nx, &[1.0; 4]);
        add_product(&mut lifts[2], &ny, &[1.0; 4]);
        add_product(&mut lifts[3], &nz, &[1.0; 4]);
        add_product(&mut lifts[4], &nz, z);
        add_product(&mut lifts[5], &nx, z);
        add_product(&mut lifts[6], &ny, z);
        add_product(&mut lifts[7], &nx, x);
        add_product(&mut lifts[7], &ny, y);
    }
}

#[inline(always)]
fn product(a: &Four, b: &Four) -> Four {
    let mut product = [0.0; 4];
    for i in 0..4 {
        product[i] = a[i] * b[i];
    }
    product
}

/// sum + a · b.
#[inline(always)]
fn add_product(sum: &mut Four, a: &Four, b: &Four) {
    for i in 0..4 {
        sum[i] += a[i] * b[i];
    }
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
    fn sums_are_those_of_their_definition_with_the_same_bits_on_every_back_end() {
        const POINTS: usize = 43;
        let mut equations = Equations::default();
        // What an earlier, larger problem leaves behind counts for nothing.
        for points in [POINTS + 9, POINTS] {
            equations.clear();
            (0..points).for_each(|point| equations.push(&equation(point)));
        }
        let further = [0.05, -0.02, 0.03, 0.04, -0.01, 0.02];
        let probe = [0.3, -0.7, 0.5, 0.9, -0.2, 0.4];
        let mut bits = Vec::new();
        for backend in Backend::available() {
            for function in [WeightFunction::Huber, WeightFunction::Tukey] {
                let scale = equations.weigh(backend, function, &further, 0.02);
                let sums = equations.sums(backend);
                let after = |e: &Equation| {
                    let taken = e.jacobian.iter().zip(further).map(|(r, x)| r * x);
                    e.residual - taken.sum::<f64>()
                };
                let (mut squares, mut right, mut noise) = (0.0, 0.0, 0.0);
                let (mut sizes, mut inside) = (Vec::new(), 0);
                for e in (0..POINTS).map(equation) {
                    let weight = match function {
                        WeightFunction::Huber => WeightFunction::huber(after(&e) / scale),
                        WeightFunction::Tukey => WeightFunction::tukey(after(&e) / scale),
                    };
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
                let spread = equations.covariance(backend, &further, scale);
                bits.push((sums.0, scale, spread));
            }
        }
        assert!(bits.chunks(2).all(|pair| pair == &bits[..2]));
        // The least σ holds where the median is below it.
        assert_eq!(
            equations.weigh(Backend::PORTABLE, WeightFunction::Huber, &further, 9.0),
            9.0
        );
    }
}
