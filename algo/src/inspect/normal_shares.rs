//! The share of a height difference that lies along the surface's normal.
//!
//! # Idea
//! A pixel that sees the part above golden sees it on its own ray: the difference dz of their
//! heights belongs to the way dz · r along the ray, r scaled to r_z = 1. On a steep wall that way
//! is much longer than the distance from the surface, which is what a tolerance of a profile limits
//! (ISO 1101:2017, profile of a surface): that is dz · r·n, n the unit normal of golden.
//!
//! # Equations
//! With p(u, v) = eye + (z − z_eye) r(u, v) the points that neighbouring pixels see, and N = ∂p/∂u
//! × ∂p/∂v,
//!
//! ```text
//! r·n = |N·r| / |N|        N·r = (z − z_eye)² (∂r/∂u × ∂r/∂v)·r
//! ```
//!
//! # Shapes and units
//! Maps are row-major over the camera's frame. The share has no unit; it is 1 on a surface that is
//! parallel to the reference plane, and up to the length of r where the surface faces the camera.
//!
//! # Accuracy
//! ∂z/∂u and ∂z/∂v are differences over [`REACH`] pixels to both sides: teaching compares no pixel
//! whose neighbours within two are not known. On a tilted plane the share is exact to 1e-3
//! (`the_share_along_the_normal_of_a_plane_is_that_of_its_tilt_and_of_the_ray`).

use crate::geometry::{Triangulator, Vector};
use crate::math::around;
use crate::pipeline::{KnownSurface, for_each_row};
use crate::units::Height;
use alloc::vec;
use alloc::vec::Vec;
use core::ops::Range;

/// Slopes are differences between pixels this far from the middle one, on each side.
const REACH: usize = 2;

/// The share at each pixel of a surface; 1 where a height or its neighbours are not known.
pub fn normal_shares(triangulator: &Triangulator, surface: &KnownSurface) -> Vec<f32> {
    let (width, heights) = (surface.width.max(1), &surface.height);
    let rows = heights.len() / width;
    let mut shares = vec![1.0; heights.len()];
    for_each_row(&mut shares, width, |v, row| {
        for (u, share) in row.iter_mut().enumerate() {
            let along = slope(around(u, REACH, width), |u| heights[v * width + u]);
            let down = slope(around(v, REACH, rows), |v| heights[v * width + u]);
            let height = heights[v * width + u];
            if let (Some(along), Some(down), true) = (along, down, height.is_known())
                && let Some(found) = of_slopes(triangulator, (u, v), height.mm(), [along, down])
            {
                *share = found as f32;
            }
        }
    });
    shares
}

/// The slope between the ends of some pixels, mm per pixel.
fn slope(pixels: Range<usize>, height: impl Fn(usize) -> Height) -> Option<f64> {
    let (first, last) = (pixels.start, pixels.end - 1);
    let ends = [height(first), height(last)];
    let known = last > first && ends.iter().all(|height| height.is_known());
    known.then(|| (ends[1].mm() - ends[0].mm()) / (last - first) as f64)
}

/// r·n of a pixel that sees a height with these slopes along and down, mm per pixel.
fn of_slopes(
    triangulator: &Triangulator,
    (u, v): (usize, usize),
    z: f64,
    [along, down]: [f64; 2],
) -> Option<f64> {
    let (u, v) = (u as f64, v as f64);
    let ray = |u: f64, v: f64| {
        let ray = triangulator.camera().ray(u, v)?;
        Some(ray * (1.0 / ray.z))
    };
    let here = ray(u, v)?;
    let (right, below): (Vector, Vector) = (ray(u + 1.0, v)? - here, ray(u, v + 1.0)? - here);
    let far = z - triangulator.camera().centre().z;
    let normal = (right * far + here * along).cross(below * far + here * down);
    Some(libm::fabs(normal.dot(here)) / normal.length())
}
