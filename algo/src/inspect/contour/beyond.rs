//! What is seen beyond a rim: the wall of the sheet, and the part of a floor that is both seen and
//! lit.
//!
//! # Equations
//! A point z below the plane that is seen at x of the plane lies below x − z v, v = (C − x)/C_z
//! with the camera's centre C. A floor at depth D is seen and lit at x if four points lie in the
//! opening: x; x − t v, where the line of sight leaves the sheet of thickness t; and the places
//! where light on its way to the floor enters the sheet and leaves it. So the background has the
//! contour's border and others, whose distances are the contour's at these points; the largest
//! counts. Borders that face each other take from the background what lies beyond each.
//!
//! The wall is seen where x − t v lies on the material, over t (−∇d · v) of the plane. It is lit
//! (n·l)/(n_z·l) times as much as the face, n its normal, l the direction to the light.

use super::light::{PlaneView, Setup, Signals};
use super::shape::{Foot, Parameters, Shape};
use crate::geometry::Vector;

/// The wall of a sheet as one piece of its rim shows it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wall {
    /// How wide it is seen on the plane, mm.
    pub width: f64,
    /// Its light over that of the face.
    pub brightness: f64,
    /// By how much its phase changes over its width, turns of ratio 1.
    pub turns: f64,
}

/// By how much a point moves on the plane for every mm that it rises on its way to a device.
pub fn slope(device: Vector, x: f64, y: f64) -> (f64, f64) {
    ((device.x - x) / device.z, (device.y - y) / device.z)
}

impl Wall {
    /// The wall at a place with this unit vector into the material; `None` if it is not seen.
    pub fn at(setup: &Setup, thickness: f64, (x, y): (f64, f64), into: (f64, f64)) -> Option<Self> {
        let out = |(x, y): (f64, f64)| -(into.0 * x + into.1 * y);
        let width = thickness * out(slope(setup.camera, x, y));
        (width > 0.0).then(|| Self {
            width,
            brightness: out(slope(setup.projector, x, y)).max(0.0),
            turns: thickness * setup.turns_per_mm,
        })
    }
}

/// By how much the phase of a floor that is seen at a place of the plane is larger than the plane's
/// there, turns of ratio 1; `None` if its depth is not known or nothing tells.
fn floor_phase(view: &impl PlaneView, setup: &Setup, (x, y): (f64, f64)) -> Option<f64> {
    let floor = setup.floor?;
    let (right, up) = slope(setup.camera, x, y);
    // Where the light that reaches the floor passes the plane.
    let (u, v) = (x - floor * right, y - floor * up);
    let (lamp, share) = (setup.projector, floor / (setup.projector.z + floor));
    let phase = |x: f64, y: f64| {
        let (u, v) = view.pixel(x, y)?;
        Some(view.spot(u, v)?.phase)
    };
    Some(phase(u + (lamp.x - u) * share, v + (lamp.y - v) * share)? - phase(x, y)?)
}

/// By how much more the phase of a floor changes beside a piece of a contour than the plane's, turns
/// of ratio 1: across in the second order, which an adapted pattern has within a few pixels.
#[derive(Clone, Copy, Debug)]
pub struct Gradient {
    across: f64,
    bend: f64,
    along: f64,
}

impl Gradient {
    /// Within `band` mm from a piece that reaches `half` mm to each side; `None` where it is not
    /// known.
    pub fn of_floor(
        signals: &Signals<'_, impl PlaneView>,
        foot: &Foot,
        [band, half]: [f64; 2],
    ) -> Option<Self> {
        let (h, (nx, ny)) = (band / 2.0, foot.normal);
        let phase = |d: f64, t: f64| {
            let at = (foot.x + d * nx - t * ny, foot.y + d * ny + t * nx);
            floor_phase(signals.view, signals.setup, at)
        };
        let all = [(0.0, 0.0), (-h, 0.0), (-band, 0.0), (-h, -half), (-h, half)];
        let [Some(at), Some(beside), Some(far), Some(before), Some(after)] =
            all.map(|(d, t)| phase(d, t))
        else {
            return None;
        };
        Some(Self {
            across: (3.0 * at - 4.0 * beside + far) / band,
            bend: (at - 2.0 * beside + far) / (2.0 * h * h),
            along: (after - before) / (2.0 * half),
        })
    }

    /// The change from the piece's middle to a place `d` mm towards the material, `t` mm along it.
    pub fn turns(&self, d: f64, t: f64) -> f64 {
        (self.across + self.bend * d) * d + self.along * t
    }
}

/// How wide the shadow between an edge and a floor is seen at a place with this unit vector into the
/// material, mm on the plane per mm of the floor's depth; below 0 if the light reaches under the
/// edge.
pub fn shadow(setup: &Setup, (x, y): (f64, f64), into: (f64, f64)) -> f64 {
    let (seen, lit) = (slope(setup.camera, x, y), slope(setup.projector, x, y));
    into.0 * (lit.0 - seen.0) + into.1 * (lit.1 - seen.1)
}

/// The signed distance, mm, of what borders the background beside the contour, as seen at (x, y) of
/// the plane, and the place on the plane whose distance that is; `None` if there is nothing.
pub fn border(
    (shape, p): (&dyn Shape, &Parameters),
    setup: &Setup,
    thickness: f64,
    (x, y): (f64, f64),
) -> Option<(f64, (f64, f64))> {
    let mut largest = None;
    let mut also = |x: f64, y: f64| {
        let d = shape.distance(p, x, y);
        if largest.is_none_or(|(largest, _)| d > largest) {
            largest = Some((d, (x, y)));
        }
    };
    let (right, up) = slope(setup.camera, x, y);
    if thickness > 0.0 {
        also(x - thickness * right, y - thickness * up);
    }
    if let Some(floor) = setup.floor {
        let (x, y) = (x - floor * right, y - floor * up);
        let (lamp, height) = (setup.projector, setup.projector.z + floor);
        let mut lit = |depth: f64| {
            let share = (floor - depth) / height;
            also(x + (lamp.x - x) * share, y + (lamp.y - y) * share);
        };
        lit(0.0);
        if thickness > 0.0 {
            lit(thickness);
        }
    }
    largest
}
