//! A flat sheet with an outline, openings, a joggle and rounded rims, by a bound of the distance to
//! it.
//!
//! In the sheet's own coordinates z = 0 is its upper side. With s the signed distance to the upper
//! side (positive above), d the distance to the contour in the plane (positive on the material), t
//! the thickness and ρ the radius of the rims, a point is at least
//!
//! ```text
//! max(round(s, −d, ρ), −s(z + t))      round(a, b, ρ) = min(max(a + ρ, b + ρ), 0) + |max(a + ρ, 0), max(b + ρ, 0)| − ρ
//! ```
//!
//! away from the material: the exact distance to an edge between face and wall, and never too
//! large (J. C. Hart, "Sphere tracing", 1996). A sheet without thickness is the face alone.

use super::bump::{BUMP_SLOPE, bump};
use crate::optics::{Vector, dot, minus, normalised};

/// Half the distance over which slopes are computed, mm.
const SLOPE_STEP_MM: f64 = 1e-5;
/// How many numbers the faces of a sheet have.
pub(super) const FACES: u16 = 5;
const RIM: u16 = 3;
const WALL: u16 = 4;

/// A sheet in the coordinates of its part, mm.
#[derive(Debug)]
pub(super) struct Sheet {
    /// Where its coordinates begin.
    pub origin: Vector,
    /// Unit vectors along its own x, y and z.
    pub axes: [Vector; 3],
    /// Lowest and highest corner of its outline.
    pub outline: [[f64; 2]; 2],
    pub openings: Vec<Opening>,
    pub joggle: Option<Fall>,
    pub dents: Vec<Dent>,
    pub thickness: f64,
    /// Radius of its upper edges; at most the thickness.
    pub rim: f64,
}

/// A slot with round ends, or a hole: one without length.
#[derive(Clone, Debug)]
pub(super) struct Opening {
    pub from: [f64; 2],
    pub to: [f64; 2],
    pub half_width: f64,
}

/// The upper side falls by `drop` between x = `from` and `to`.
#[derive(Clone, Debug)]
pub(super) struct Fall {
    pub from: f64,
    pub to: f64,
    pub drop: f64,
}

/// A round, smooth dent of the upper side.
#[derive(Clone, Debug)]
pub(super) struct Dent {
    pub centre: [f64; 2],
    pub depth: f64,
    pub half_width: f64,
}

impl Opening {
    /// Distance of (x, y) from its contour, positive outside; if that is above `beyond`, anything
    /// that is too.
    fn distance(&self, [x, y]: [f64; 2], beyond: f64) -> f64 {
        let run = [self.to[0] - self.from[0], self.to[1] - self.from[1]];
        let at = [x - self.from[0], y - self.from[1]];
        let length = run[0] * run[0] + run[1] * run[1];
        let along = match length > 0.0 {
            true => ((at[0] * run[0] + at[1] * run[1]) / length).clamp(0.0, 1.0),
            false => 0.0,
        };
        let off = [at[0] - along * run[0], at[1] - along * run[1]];
        let nearest = off[0].abs().max(off[1].abs()) - self.half_width;
        match nearest > beyond {
            true => nearest,
            false => off[0].hypot(off[1]) - self.half_width,
        }
    }
}

impl Fall {
    /// Signed distance of (x, z) from the section of the upper side.
    fn above(&self, x: f64, z: f64) -> f64 {
        let run = [self.to - self.from, -self.drop];
        let at = [x - self.from, z];
        let along = (at[0] * run[0] + at[1] * run[1]) / (run[0] * run[0] + run[1] * run[1]);
        let along = along.clamp(0.0, 1.0);
        let ramp = (at[0] - along * run[0]).hypot(at[1] - along * run[1]);
        let before = (x - self.from).max(0.0).hypot(z);
        let behind = (self.to - x).max(0.0).hypot(z + self.drop);
        let height = match x {
            _ if x <= self.from => 0.0,
            _ if x >= self.to => -self.drop,
            _ => -self.drop * (x - self.from) / (self.to - self.from),
        };
        ramp.min(before).min(behind).copysign(z - height)
    }
}

impl Sheet {
    /// `point` in the coordinates of the sheet.
    fn own(&self, point: Vector) -> Vector {
        let off = minus(point, self.origin);
        self.axes.map(|axis| dot(axis, off))
    }

    /// Distance from the contour in the plane, positive on the material.
    fn inside(&self, at: [f64; 2]) -> f64 {
        let [low, high] = &self.outline;
        let [x, y] = [0, 1].map(|axis| (low[axis] - at[axis]).max(at[axis] - high[axis]));
        let outline = match x.min(y) > 0.0 {
            true => x.hypot(y),
            false => x.max(y),
        };
        let openings = self.openings.iter();
        openings.fold(-outline, |nearest, opening| {
            nearest.min(opening.distance(at, nearest))
        })
    }

    /// At most the signed distance from the upper side.
    fn above(&self, [x, y, z]: Vector) -> f64 {
        let flat = match &self.joggle {
            Some(fall) => fall.above(x, z),
            None => z,
        };
        if self.dents.is_empty() {
            return flat;
        }
        let drop = |dent: &Dent| {
            let [cx, cy] = dent.centre;
            dent.depth * bump((x - cx).hypot(y - cy), dent.half_width)
        };
        let slope = |dent: &Dent| dent.depth.abs() * BUMP_SLOPE / dent.half_width;
        let (drops, slopes) = (self.dents.iter().map(drop), self.dents.iter().map(slope));
        (flat + drops.sum::<f64>()) / (1.0 + slopes.sum::<f64>())
    }

    /// The signed distance from upper side, rims and walls.
    fn skin(&self, own: Vector) -> f64 {
        let above = self.above(own) + self.rim;
        let beside = self.rim - self.inside([own[0], own[1]]);
        above.max(beside).min(0.0) + above.max(0.0).hypot(beside.max(0.0)) - self.rim
    }

    /// A distance from `point` that no material is nearer than.
    pub fn distance(&self, point: Vector) -> f64 {
        let own @ [x, y, z] = self.own(point);
        let below = -self.above([x, y, z + self.thickness]);
        self.skin(own).max(below)
    }

    /// The outward normal at a point of upper side, rim or wall, and the number of the face.
    pub fn face(&self, point: Vector) -> (Vector, u16) {
        let own = self.own(point);
        let above = self.above(own) + self.rim;
        let beside = self.rim - self.inside([own[0], own[1]]);
        let face = match &self.joggle {
            _ if above > 0.0 && beside > 0.0 && self.rim > 0.0 => RIM,
            _ if beside > above => WALL,
            Some(fall) if own[0] > fall.to => 2,
            Some(fall) if own[0] > fall.from => 1,
            _ => 0,
        };
        let normal = match face {
            RIM | WALL => slopes(own, |at| self.skin(at)),
            _ => slopes(own, |at| self.above(at)),
        };
        let turned = |axis: usize| {
            let of = |own: usize| normal[own] * self.axes[own][axis];
            of(0) + of(1) + of(2)
        };
        ([0, 1, 2].map(turned), face)
    }

    /// The corners of a box around it.
    pub fn corners(&self) -> [Vector; 8] {
        let drop = self.joggle.as_ref().map_or(0.0, |fall| fall.drop);
        let dents = |sign: f64| {
            self.dents
                .iter()
                .map(move |dent| (sign * dent.depth).max(0.0))
        };
        let deepest = drop.max(0.0) + self.thickness + dents(1.0).sum::<f64>();
        let highest = (-drop).max(0.0) + dents(-1.0).sum::<f64>();
        std::array::from_fn(|corner| {
            let [x, y] = [0, 1].map(|axis| self.outline[corner >> axis & 1][axis]);
            let own = [x, y, [-deepest, highest][corner >> 2]];
            [0, 1, 2].map(|axis| {
                let along = |of: usize| own[of] * self.axes[of][axis];
                self.origin[axis] + along(0) + along(1) + along(2)
            })
        })
    }
}

/// The unit vector along which `value` grows.
fn slopes(at: Vector, value: impl Fn(Vector) -> f64) -> Vector {
    normalised([0, 1, 2].map(|axis| {
        let [mut ahead, mut behind] = [at; 2];
        ahead[axis] += SLOPE_STEP_MM;
        behind[axis] -= SLOPE_STEP_MM;
        value(ahead) - value(behind)
    }))
}
