//! Stage 5, gauge: what the interpolation of the pose field adds to deviations on a plane.
//!
//! # Idea
//! Between its nodes the pose field ([`PoseField`](super::pose::PoseField)) is linear along columns
//! and rows, and the displacement F = (du, dv, dz) that it stands for is bent. At column u between
//! the nodes u₀ and u₁ the field is too large by
//!
//! ```text
//! e(u) = ½ (u − u₀)(u₁ − u) ∂²F/∂u²
//! ```
//!
//! and likewise along v. Deviations from golden's heights G are too large by e_z − ∇G · (e_u, e_v):
//! with 0.4 mm per pixel and a part that is tilted by 1°, up to 5 µm on a face of 45°, and tenths of
//! µm on one that faces the camera. A plane is known better than that, and so its cells are
//! corrected; for gauges of cells it is small against what their squares are noisy by.
//!
//! # Accuracy
//! The second derivatives are those at the middle of the plane. `tests/suite/planes.rs`.

use super::golden::Golden;
use super::pose::{SPACING, displacement};
use crate::geometry::Vector;
use crate::inspect::align::Motion;
use crate::inspect::feature::FittedPlane;

/// Distance in pixels over which second derivatives are taken: near enough, and far above rounding.
const STEP: usize = 16;

/// A plane as taught, as far as the camera's picture of it matters.
#[derive(Clone, Copy, Debug)]
pub struct SeenPlane {
    /// Its middle.
    middle: Vector,
    /// The place in the frame that sees it.
    seen: (f64, f64),
    /// By how much golden's height rises from one column, and from one row, to the next, mm.
    rise: [f64; 2],
}

/// The error of deviations on a plane that lies so.
#[derive(Clone, Copy, Debug)]
pub struct Bend {
    /// Its second derivatives along columns and rows, mm per pixel².
    curvature: [f64; 2],
    /// From the taught pixels to those that see the plane now.
    shift: [f64; 2],
    /// Columns and rows of the frame.
    size: [usize; 2],
}

impl SeenPlane {
    /// `None` where the camera does not see it.
    pub fn new(golden: &Golden, plane: &FittedPlane) -> Option<Self> {
        let geometry = plane.geometry(plane.parameters);
        let (middle, normal) = (geometry.point, geometry.normal);
        let seen = golden.triangulator.camera().project(middle)?;
        let (u, v) = (seen.0 as usize, seen.1 as usize);
        // How far the plane lies above the middle's height on the ray of a pixel.
        let height = |u: usize, v: usize| {
            let point = golden.seen(u, v, middle.z)?;
            let ray = golden.triangulator.higher(point, 1.0) - point;
            Some(-normal.dot(point - middle) / normal.dot(ray))
        };
        let here = height(u, v)?;
        Some(Self {
            middle,
            seen,
            rise: [height(u + 1, v)? - here, height(u, v + 1)? - here],
        })
    }

    /// The error of its deviations where the part has moved so; `None` where it is not seen.
    pub fn bend(&self, golden: &Golden, motion: &Motion) -> Option<Bend> {
        let now = motion.apply(self.middle);
        let seen = golden.triangulator.camera().project(now)?;
        let (width, rows) = golden.size();
        let inside = |at: f64, end: usize| {
            let last = end.checked_sub(STEP + 1)?;
            Some((at as usize).min(last).max(STEP))
        };
        let (u, v) = (inside(seen.0, width)?, inside(seen.1, rows)?);
        let at = |u: usize, v: usize| {
            let [along, down, rise] =
                displacement(golden, motion, (u, v), golden.seen(u, v, now.z)?);
            Some(rise - self.rise[0] * along - self.rise[1] * down)
        };
        let here = at(u, v)?;
        let square = (STEP * STEP) as f64;
        let bent =
            |one: Option<f64>, other: Option<f64>| Some((one? - 2.0 * here + other?) / square);
        let curvature = [
            bent(at(u - STEP, v), at(u + STEP, v))?,
            bent(at(u, v - STEP), at(u, v + STEP))?,
        ];
        curvature.iter().all(|of| of.is_finite()).then_some(Bend {
            curvature,
            shift: [seen.0 - self.seen.0, seen.1 - self.seen.1],
            size: [width, rows],
        })
    }
}

impl Bend {
    /// By how much deviations are too large where the taught pixel (u, v) is seen now, mm.
    pub fn at(&self, taught: [f64; 2]) -> f64 {
        let error = |axis: usize| {
            let last = self.size[axis].saturating_sub(1);
            let at = (taught[axis] + self.shift[axis]).clamp(0.0, last as f64);
            let before = at as usize / SPACING * SPACING;
            let after = (before + SPACING).min(last);
            0.5 * (at - before as f64) * (after as f64 - at) * self.curvature[axis]
        };
        error(0) + error(1)
    }
}
