//! A lens without its pose: Brown's distortion and the scale to pixels, in OpenCV's convention,
//! without any check; and the directions of a camera's whole pixels, worked out once.
//!
//! With r² = x² + y² of a direction (x, y, 1),
//! x_d = x(1 + k₁r² + k₂r⁴ + k₃r⁶) + 2p₁xy + p₂(r² + 2x²),
//! y_d = y(1 + k₁r² + k₂r⁴ + k₃r⁶) + p₁(r² + 2y²) + 2p₂xy;
//! u = f_x x_d + c_x, v = f_y y_d + c_y.
//! Source: D. C. Brown, "Decentering distortion of lenses", 1966, as in OpenCV's calib3d.
//!
//! A direction takes some iterations of [`Lens::undistorted`], and teaching asks for those of the
//! same pixels dozens of times. A direction takes 16 bytes, so they are only kept while a recipe is
//! taught or planned ([`Rays`]).

use alloc::sync::Arc;
use alloc::vec::Vec;
use core::fmt;

/// Newton iterations after which the undistortion must have converged; real lenses take 4.
const NEWTON_STEPS: usize = 25;

/// Focal lengths, principal point and distortion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lens {
    /// Focal length along x, in pixels.
    pub fx: f64,
    /// Focal length along y, in pixels.
    pub fy: f64,
    /// Principal point, column.
    pub cx: f64,
    /// Principal point, row.
    pub cy: f64,
    /// k₁, k₂, p₁, p₂, k₃.
    pub distortion: [f64; 5],
}

impl Lens {
    /// The pixel of the direction (x, y, 1).
    #[inline]
    pub fn pixel(&self, x: f64, y: f64) -> (f64, f64) {
        let (xd, yd) = self.distorted(x, y);
        self.scaled(xd, yd)
    }

    /// (x_d, y_d) → (u, v).
    #[inline]
    pub(super) fn scaled(&self, xd: f64, yd: f64) -> (f64, f64) {
        (self.fx * xd + self.cx, self.fy * yd + self.cy)
    }

    /// (x, y) → (x_d, y_d).
    #[inline]
    pub(super) fn distorted(&self, x: f64, y: f64) -> (f64, f64) {
        let [k1, k2, p1, p2, k3] = self.distortion;
        let r2 = x * x + y * y;
        let radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
        (
            x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
            y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
        )
    }

    /// ∂x_d/∂x, ∂x_d/∂y = ∂y_d/∂x, ∂y_d/∂y and the determinant.
    #[inline]
    pub(super) fn jacobian(&self, x: f64, y: f64) -> (f64, f64, f64, f64) {
        let [k1, k2, p1, p2, k3] = self.distortion;
        let r2 = x * x + y * y;
        let radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
        // d(radial)/d(r²)
        let slope = k1 + r2 * (2.0 * k2 + r2 * 3.0 * k3);
        let xx = radial + 2.0 * x * x * slope + 2.0 * p1 * y + 6.0 * p2 * x;
        let xy = 2.0 * x * y * slope + 2.0 * p1 * x + 2.0 * p2 * y;
        let yy = radial + 2.0 * y * y * slope + 6.0 * p1 * y + 2.0 * p2 * x;
        (xx, xy, yy, xx * yy - xy * xy)
    }

    /// The direction (x, y, 1) that a pixel sees, by Newton's method from the distorted point;
    /// `None` where it does not converge.
    pub fn undistorted(&self, u: f64, v: f64) -> Option<(f64, f64)> {
        let (xd, yd) = ((u - self.cx) / self.fx, (v - self.cy) / self.fy);
        let (mut x, mut y) = (xd, yd);
        for _ in 0..NEWTON_STEPS {
            let (found_x, found_y) = self.distorted(x, y);
            let (ex, ey) = (found_x - xd, found_y - yd);
            // 1e-14 of the focal length: 1e-11 px.
            if libm::fabs(ex) + libm::fabs(ey) <= 1e-14 {
                return Some((x, y));
            }
            let (xx, xy, yy, determinant) = self.jacobian(x, y);
            if !(determinant > 1e-9) {
                return None;
            }
            x -= (yy * ex - xy * ey) / determinant;
            y -= (xx * ey - xy * ex) / determinant;
        }
        // Where |x| is large rounding prevents 1e-14; 1e-12 (1e-9 px) is enough.
        let (found_x, found_y) = self.distorted(x, y);
        let left = libm::fabs(found_x - xd) + libm::fabs(found_y - yd);
        (left <= 1e-12).then_some((x, y))
    }
}

/// The directions (x, y, 1) of whole pixels, row-major; empty where they are not known. Clones
/// share them.
#[derive(Clone, Default)]
pub(super) struct Rays(Arc<[(f64, f64)]>);

impl Rays {
    pub fn new(directions: Vec<(f64, f64)>) -> Self {
        Self(directions.into())
    }

    pub fn are_known(&self) -> bool {
        !self.0.is_empty()
    }

    /// The direction of a pixel of a frame of `width` columns, if it is a whole one and known.
    #[inline]
    pub fn at(&self, u: f64, v: f64, width: usize) -> Option<(f64, f64)> {
        // Casts keep to the range of their type.
        let (column, row) = (u as usize, v as usize);
        // No row of theirs is beyond their number.
        let inside = column < width && row < self.0.len();
        let whole = inside && column as f64 == u && row as f64 == v;
        let index = whole.then(|| row * width + column)?;
        let known = self.0.get(index).copied();
        known.filter(|(x, _)| !x.is_nan())
    }
}

/// What is known beforehand makes no other device.
impl PartialEq for Rays {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

impl fmt::Debug for Rays {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "{} rays", self.0.len())
    }
}
