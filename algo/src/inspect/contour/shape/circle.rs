//! A round hole.

use super::distance::{Foot, Shape};
use crate::math::solve::Distance;
use crate::math::solve::Normal;
use core::f64::consts::{PI, TAU};

/// A circle with the material around it; p = centre x, centre y, radius.
#[derive(Clone, Copy, Debug, Default)]
pub struct Circle;

impl Circle {
    /// The least-squares circle of an outline's corners (I. Kåsa, IEEE Trans. Instrum. Meas. 25,
    /// 1976: x² + y² = 2ax + 2by + c is linear); `None` if they do not determine one.
    pub fn of(outline: &[(f64, f64)]) -> Option<[f64; 3]> {
        // About their mean, so that nothing cancels.
        let count = outline.len() as f64;
        let sum = outline
            .iter()
            .fold((0.0, 0.0), |sum, (x, y)| (sum.0 + x, sum.1 + y));
        let (x0, y0) = (sum.0 / count, sum.1 / count);
        let normal = Normal::of(outline.iter().map(|&(x, y)| {
            let (x, y) = (x - x0, y - y0);
            ([2.0 * x, 2.0 * y, 1.0], x * x + y * y)
        }));
        let [a, b, c] = normal.solve()?;
        let square = a * a + b * b + c;
        (square > 0.0).then(|| [x0 + a, y0 + b, libm::sqrt(square)])
    }
}

impl Distance<3> for Circle {
    fn distance(&self, &[cx, cy, r]: &[f64; 3], x: f64, y: f64) -> f64 {
        let (x, y) = (x - cx, y - cy);
        libm::sqrt(x * x + y * y) - r
    }

    fn derivative(&self, &[cx, cy, _]: &[f64; 3], x: f64, y: f64) -> [f64; 3] {
        let (x, y) = (x - cx, y - cy);
        let away = libm::sqrt(x * x + y * y);
        [-x / away, -y / away, -1.0]
    }
}

impl Shape<3> for Circle {
    fn length(&self, &[_, _, r]: &[f64; 3]) -> f64 {
        TAU * r
    }

    fn along(&self, &[cx, cy, r]: &[f64; 3], x: f64, y: f64) -> Option<f64> {
        Some((libm::atan2(y - cy, x - cx) + PI) * r)
    }

    fn foot(&self, &[cx, cy, r]: &[f64; 3], along: f64) -> Foot {
        let angle = along / r - PI;
        let normal = (libm::cos(angle), libm::sin(angle));
        Foot {
            x: cx + r * normal.0,
            y: cy + r * normal.1,
            normal,
            curvature: 1.0 / r,
        }
    }

    fn is_closed(&self) -> bool {
        true
    }

    /// 190°: a rim of which less than half is seen hardly tells where its centre is.
    fn largest_gap(&self) -> f64 {
        190.0 / 360.0
    }
}
