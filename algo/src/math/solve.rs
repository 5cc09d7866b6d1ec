//! Least squares: the normal equations of a few unknowns, and the shape that points lie on.
//!
//! **Points on a shape** ([`associate`]). Gauss–Newton over Σ ρ(d/σ): d the signed distance of a
//! point, σ² its variance by noise, ρ Tukey's biweight (J. W. Tukey; P. W. Holland & R. E. Welsch,
//! Commun. Stat. A 6, 1977: c = 4.685), scaled by the median of |d|/σ where points scatter by more
//! than their noise. Covariance C = (JᵀWJ)⁻¹, W weights over variances.

use alloc::vec::Vec;

/// The normal equations of linear least squares: of observations aᵀx = b with N unknowns x.
#[derive(Clone, Copy, Debug)]
pub struct Normal<const N: usize> {
    /// Σ a aᵀ; only its lower triangle is kept.
    pub(crate) matrix: [[f64; N]; N],
    /// Σ a b.
    pub(crate) right: [f64; N],
}

impl<const N: usize> Default for Normal<N> {
    fn default() -> Self {
        Self {
            matrix: [[0.0; N]; N],
            right: [0.0; N],
        }
    }
}

impl<const N: usize> Normal<N> {
    /// The equations of these observations, added in their order.
    pub fn of(observations: impl IntoIterator<Item = ([f64; N], f64)>) -> Self {
        let mut normal = Self::default();
        for (a, b) in observations {
            normal.add(&a, b);
        }
        normal
    }

    /// Adds an observation.
    pub fn add(&mut self, a: &[f64; N], b: f64) {
        for (i, row) in self.matrix.iter_mut().enumerate() {
            for (sum, other) in row.iter_mut().zip(&a[..=i]) {
                *sum += a[i] * other;
            }
            self.right[i] += a[i] * b;
        }
    }

    /// The unknowns; `None` where the observations do not determine them.
    pub fn solve(mut self) -> Option<[f64; N]> {
        solve_symmetric(self.matrix.as_flattened_mut(), &mut self.right)?;
        Some(self.right)
    }
}

/// Solves the symmetric positive definite system `a · x = b` by Cholesky's method and leaves x in
/// `b`.
///
/// `a` is row-major n × n with n = `b.len()`; only its lower triangle is read, and it is
/// overwritten. Returns `None` where the matrix is not positive definite to working precision, that
/// is, where the observations do not determine the unknowns.
pub(crate) fn solve_symmetric(a: &mut [f64], b: &mut [f64]) -> Option<()> {
    let n = b.len();
    for j in 0..n {
        let mut diagonal = a[j * n + j];
        let scale = diagonal;
        for k in 0..j {
            diagonal -= a[j * n + k] * a[j * n + k];
        }
        if diagonal <= scale * 1e-14 || !diagonal.is_finite() {
            return None;
        }
        let root = libm::sqrt(diagonal);
        a[j * n + j] = root;
        for i in j + 1..n {
            let mut sum = a[i * n + j];
            for k in 0..j {
                sum -= a[i * n + k] * a[j * n + k];
            }
            a[i * n + j] = sum / root;
        }
    }
    for i in 0..n {
        for k in 0..i {
            b[i] -= a[i * n + k] * b[k];
        }
        b[i] /= a[i * n + i];
    }
    for i in (0..n).rev() {
        for k in i + 1..n {
            b[i] -= a[k * n + i] * b[k];
        }
        b[i] /= a[i * n + i];
    }
    Some(())
}

/// Tukey's c: 95 % efficient on normal errors.
const TUKEY: f64 = 4.685;
/// The median of |x| of a standard normal x.
const MEDIAN: f64 = 0.674_489_750_196_081_7;

/// A point that was measured.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Point {
    /// x, mm.
    pub x: f64,
    /// y, mm.
    pub y: f64,
    /// Variance of its distance by noise, mm².
    pub variance: f64,
    /// Tukey's weight, 0 to 1.
    pub weight: f64,
}

/// Step of the numeric derivatives, mm and rad: distances are smooth near a shape, so that the error
/// of the second order is below 1e-9.
const STEP: f64 = 1e-5;

/// What points can lie on: a shape with N parameters p in mm and rad. One solver serves all.
pub trait Distance<const N: usize> {
    /// The signed distance d(x, y; p) of a point in mm: of a contour, positive on the material.
    fn distance(&self, p: &[f64; N], x: f64, y: f64) -> f64;

    /// How the distance changes with each parameter.
    fn derivative(&self, p: &[f64; N], x: f64, y: f64) -> [f64; N] {
        core::array::from_fn(|i| {
            let (mut less, mut more) = (*p, *p);
            less[i] -= STEP;
            more[i] += STEP;
            (self.distance(&more, x, y) - self.distance(&less, x, y)) / (2.0 * STEP)
        })
    }
}

/// Moves p to where the points' distances are least, and sets their weights. The covariance of p;
/// `None` if the points do not determine it.
pub fn associate<const N: usize>(
    shape: &impl Distance<N>,
    p: &mut [f64; N],
    points: &mut [Point],
    ratios: &mut Vec<f64>,
) -> Option<[[f64; N]; N]> {
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
        let mut normal = Normal::default();
        for point in points.iter_mut() {
            let sigma = libm::sqrt(point.variance);
            let d = shape.distance(p, point.x, point.y);
            let outside = d / (sigma * scale * TUKEY);
            let inside = (1.0 - outside * outside).max(0.0);
            point.weight = inside * inside;
            let root = libm::sqrt(point.weight) / sigma;
            let rate = shape.derivative(p, point.x, point.y);
            normal.add(&rate.map(|rate| rate * root), -d * root);
        }
        let step = normal.solve()?;
        let mut largest = 0.0_f64;
        for (p, step) in p.iter_mut().zip(step) {
            *p += step;
            largest = largest.max(libm::fabs(step));
        }
        if largest < 3e-6 {
            break;
        }
    }
    inverse(&information(shape, p, points))
}

/// JᵀWJ at p.
fn information<const N: usize>(
    shape: &impl Distance<N>,
    p: &[f64; N],
    points: &[Point],
) -> [[f64; N]; N] {
    let mut sums = [[0.0; N]; N];
    for point in points {
        let rate = shape.derivative(p, point.x, point.y);
        for (row, one) in sums.iter_mut().zip(rate) {
            for (sum, other) in row.iter_mut().zip(rate) {
                *sum += one * other * point.weight / point.variance;
            }
        }
    }
    sums
}

/// The inverse of a symmetric positive definite matrix.
fn inverse<const N: usize>(matrix: &[[f64; N]; N]) -> Option<[[f64; N]; N]> {
    let mut inverse = [[0.0; N]; N];
    for (i, column) in inverse.iter_mut().enumerate() {
        let mut copy = *matrix;
        column[i] = 1.0;
        solve_symmetric(copy.as_flattened_mut(), column)?;
    }
    Some(inverse)
}

/// By how much p changes if every point lies farther along d by `shift` mm.
pub fn response<const N: usize>(
    shape: &impl Distance<N>,
    p: &[f64; N],
    covariance: &[[f64; N]; N],
    points: &[Point],
    shift: impl Fn(&Point) -> f64,
) -> [f64; N] {
    let mut right = [0.0; N];
    for point in points {
        let rate = shape.derivative(p, point.x, point.y);
        for (sum, rate) in right.iter_mut().zip(rate) {
            // The distance of the shifted point is larger by the shift; p takes that back.
            *sum -= rate * shift(point) * point.weight / point.variance;
        }
    }
    covariance.map(|row| row.iter().zip(right).map(|(c, r)| c * r).sum())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec;

    #[test]
    fn a_small_system_is_solved_and_a_singular_one_refused() {
        let mut a = vec![4.0, 2.0, 0.6, 2.0, 5.0, 1.0, 0.6, 1.0, 3.0];
        let mut b = vec![4.0 + 4.0 + 1.8, 2.0 + 10.0 + 3.0, 0.6 + 2.0 + 9.0];
        solve_symmetric(&mut a, &mut b).unwrap();
        for (found, expected) in b.iter().zip([1.0, 2.0, 3.0]) {
            assert!((found - expected).abs() < 1e-12);
        }
        assert!(solve_symmetric(&mut [1.0, 1.0, 1.0, 1.0], &mut [1.0, 1.0]).is_none());
    }
}
