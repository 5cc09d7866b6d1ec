//! The shape that edge points lie on.
//!
//! Gauss–Newton over Σ ρ(d/σ): d the signed distance of a point, σ² its variance by noise, ρ
//! Tukey's biweight (J. W. Tukey; P. W. Holland & R. E. Welsch, Commun. Stat. A 6, 1977: c = 4.685),
//! scaled by the median of |d|/σ where points scatter by more than their noise. Covariance C =
//! (JᵀWJ)⁻¹, W weights over variances.

use super::shape::Shape;
use crate::math::solve::{Normal, solve_symmetric};
use alloc::vec::Vec;

/// Tukey's c: 95 % efficient on normal errors.
const TUKEY: f64 = 4.685;
/// The median of |x| of a standard normal x.
const MEDIAN: f64 = 0.674_489_750_196_081_7;

/// A point of a contour.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Point {
    /// x, mm.
    pub x: f64,
    /// y, mm.
    pub y: f64,
    /// Variance across the contour by noise, mm².
    pub variance: f64,
    /// Tukey's weight, 0 to 1.
    pub weight: f64,
}

/// Moves p to where the points' distances are least, and sets their weights. The covariance of p;
/// `None` if the points do not determine it.
pub fn associate<const N: usize>(
    shape: &impl Shape<N>,
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
    shape: &impl Shape<N>,
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
    shape: &impl Shape<N>,
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
