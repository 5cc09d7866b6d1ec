//! Flat sheets with an outline, openings, a joggle and rounded rims, over a floor: what rays meet of
//! plates and joints, by a bound of the distance to a sheet.
//!
//! In the sheet's own coordinates z = 0 is its upper side. With s the signed distance to the upper
//! side (positive above), d the distance to the contour in the plane (positive on the material), t
//! the thickness and ρ the radius of the rims, a point is at least
//!
//! ```text
//! max(round(s + ρ, ρ − d) − ρ, −s(z + t))
//! round(a, b) = min(max(a, b), 0) + √(max(a, 0)² + max(b, 0)²)
//! ```
//!
//! away from the material: the exact distance to an edge between face and wall, and never too
//! large, as sphere tracing needs it (J. C. Hart, 1996). A sheet without thickness is the face alone.
//! Dents change s by their depth, which divides the bound by 1 + their slopes.

use super::defect::{BUMP_SLOPE, bump};
use crate::optics::{Vector, along, dot, minus, normalised};
use crate::trace::{Body, Hit, clip};
use hal::bounded;

/// A ray meets what it comes this close to, mm.
const TOLERANCE_MM: f64 = 1e-5;
/// The box around the material is widened by this, mm: by less than the tolerance, so that rays meet
/// the highest face at once, and than shadow rays are lifted, so that those from there end at once.
const MARGIN_MM: f64 = 5e-6;
/// Shadow rays start at this distance from the surface, mm.
const LIFT_MM: f64 = 1e-4;
/// Most steps along a ray; a ray that takes them all meets nothing.
const MAX_RAY_STEPS: usize = 10_000;
/// Half the distance over which slopes are computed, mm.
const SLOPE_STEP_MM: f64 = 1e-5;
/// How many numbers the faces of a sheet have.
const FACES: u16 = 5;
/// Number of the face of rounded upper edges.
const RIM: u16 = 3;
/// Number of the face of upright walls.
const WALL: u16 = 4;

bounded! {
    /// A flat floor without an end, parallel to the part's xy plane.
    #[derive(Copy)]
    pub struct Floor: Default {
        /// How far it lies below the part's upper side as designed, mm.
        pub depth: f64 = 0.0..=1000.0 => 18.0,
        /// What it reflects of the light that the part would reflect; 0 is no floor.
        pub albedo: f64 = 0.0..=1.0,
    }
}

/// Sheets, and the floor below them.
pub(crate) struct Solid {
    sheets: Vec<Sheet>,
    /// z and albedo of the floor.
    floor: Option<[f64; 2]>,
}

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
    pub dents: Vec<SheetDent>,
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

/// The upper side falls by `drop`, not 0, between x = `from` and `to`.
#[derive(Clone, Debug)]
pub(super) struct Fall {
    pub from: f64,
    pub to: f64,
    pub drop: f64,
}

/// A round, smooth dent of the upper side.
#[derive(Clone, Debug)]
pub(super) struct SheetDent {
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
        let squared = run[0] * run[0] + run[1] * run[1];
        let along = match squared > 0.0 {
            true => ((at[0] * run[0] + at[1] * run[1]) / squared).clamp(0.0, 1.0),
            false => 0.0,
        };
        let off = [at[0] - along * run[0], at[1] - along * run[1]];
        let nearest = off[0].abs().max(off[1].abs()) - self.half_width;
        match nearest > beyond {
            true => nearest,
            false => length(off[0], off[1]) - self.half_width,
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
        let ramp = length(at[0] - along * run[0], at[1] - along * run[1]);
        let before = length((x - self.from).max(0.0), z);
        let behind = length((self.to - x).max(0.0), z + self.drop);
        let height = match x {
            _ if x <= self.from => 0.0,
            _ if x >= self.to => -self.drop,
            _ => -self.drop * (x - self.from) / (self.to - self.from),
        };
        ramp.min(before).min(behind).copysign(z - height)
    }
}

impl Sheet {
    /// The components of a vector in the coordinates of the sheet.
    fn turned(&self, vector: Vector) -> Vector {
        self.axes.map(|axis| dot(axis, vector))
    }

    /// `point` in the coordinates of the sheet.
    fn own(&self, point: Vector) -> Vector {
        self.turned(minus(point, self.origin))
    }

    /// Distance from the contour in the plane, positive on the material.
    fn inside(&self, at: [f64; 2]) -> f64 {
        let [low, high] = &self.outline;
        let [x, y] = [0, 1].map(|axis| (low[axis] - at[axis]).max(at[axis] - high[axis]));
        let outline = match x.min(y) > 0.0 {
            true => length(x, y),
            false => x.max(y),
        };
        let openings = self.openings.iter();
        openings.fold(-outline, |nearest, opening| {
            nearest.min(opening.distance(at, nearest))
        })
    }

    /// The signed distance from the upper side, with dents at most [`Sheet::steepness`] times that.
    fn above(&self, [x, y, z]: Vector) -> f64 {
        let flat = match &self.joggle {
            Some(fall) => fall.above(x, z),
            None => z,
        };
        let drop = |dent: &SheetDent| {
            let [cx, cy] = dent.centre;
            dent.depth * bump(length(x - cx, y - cy), dent.half_width)
        };
        flat + self.dents.iter().map(drop).sum::<f64>()
    }

    /// How fast [`Sheet::above`] changes at most.
    fn steepness(&self) -> f64 {
        let slope = |dent: &SheetDent| dent.depth.abs() * BUMP_SLOPE / dent.half_width;
        1.0 + self.dents.iter().map(slope).sum::<f64>()
    }

    /// The signed distance from upper side, rims and walls.
    fn skin(&self, own: Vector) -> f64 {
        let above = self.above(own) + self.rim;
        let beside = self.rim - self.inside([own[0], own[1]]);
        above.max(beside).min(0.0) + length(above.max(0.0), beside.max(0.0)) - self.rim
    }

    /// Where on the ray from `origin` along the unit vector `direction` it is met first, mm.
    pub fn meets(&self, origin: Vector, direction: Vector) -> Option<f64> {
        let (origin, direction) = (self.own(origin), self.turned(direction));
        let [low, high] = self.bounds();
        let bounds = [
            low.map(|edge| edge - MARGIN_MM),
            high.map(|edge| edge + MARGIN_MM),
        ];
        let (mut t, end) = clip(&bounds, origin, direction)?;
        let steepness = self.steepness();
        for _ in 0..MAX_RAY_STEPS {
            if t > end {
                return None;
            }
            let at @ [x, y, z] = along(origin, direction, t);
            let below = -self.above([x, y, z + self.thickness]);
            let distance = self.skin(at).max(below) / steepness;
            if distance < TOLERANCE_MM {
                return Some(t);
            }
            t += distance;
        }
        None
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
            let share = |own: usize| normal[own] * self.axes[own][axis];
            share(0) + share(1) + share(2)
        };
        ([0, 1, 2].map(turned), face)
    }

    /// Lowest and highest corner of a box around it, in its own coordinates.
    fn bounds(&self) -> [Vector; 2] {
        let drop = self.joggle.as_ref().map_or(0.0, |fall| fall.drop);
        let (mut low, mut high) = (-drop.max(0.0) - self.thickness, (-drop).max(0.0));
        for dent in &self.dents {
            low -= dent.depth.max(0.0);
            high += (-dent.depth).max(0.0);
        }
        let [[left, front], [right, back]] = self.outline;
        [[left, front, low], [right, back, high]]
    }

    /// z of its lowest corner, in the coordinates of its part.
    pub fn lowest(&self) -> f64 {
        let [low, high] = self.bounds();
        let end = |axis: usize| {
            let up = self.axes[axis][2];
            (low[axis] * up).min(high[axis] * up)
        };
        self.origin[2] + end(0) + end(1) + end(2)
    }
}

impl Solid {
    /// Sheets whose upper side as designed lies at `z`, and the floor below.
    pub(super) fn new(sheets: Vec<Sheet>, z: f64, floor: &Floor) -> Self {
        Self {
            sheets,
            floor: (floor.albedo > 0.0).then_some([z - floor.depth, floor.albedo]),
        }
    }

    /// z of the lowest corner of its sheets.
    pub fn lowest(&self) -> f64 {
        let sheets = self.sheets.iter().map(Sheet::lowest);
        sheets.fold(f64::INFINITY, f64::min)
    }
}

impl Body for Solid {
    fn first_hit(&self, origin: Vector, direction: Vector) -> Option<Hit> {
        let sheets = self.sheets.iter().enumerate();
        let met = sheets.filter_map(|(at, sheet)| Some((sheet.meets(origin, direction)?, at)));
        if let Some((t, at)) = met.reduce(|a, b| if b.0 < a.0 { b } else { a }) {
            let point = along(origin, direction, t);
            let (outward, face) = self.sheets[at].face(point);
            let sign = -dot(outward, direction).signum();
            return Some(Hit {
                point,
                normal: outward.map(|component| sign * component),
                albedo: 1.0,
                face: at as u16 * FACES + face,
            });
        }
        let [z, albedo] = self.floor?;
        let t = (z - origin[2]) / direction[2];
        (t > 0.0 && t.is_finite()).then(|| Hit {
            point: along(origin, direction, t),
            normal: [0.0, 0.0, -direction[2].signum()],
            albedo,
            face: self.sheets.len() as u16 * FACES,
        })
    }

    fn shadowed(&self, hit: &Hit, towards: Vector) -> bool {
        let start = along(hit.point, hit.normal, LIFT_MM);
        let mut sheets = self.sheets.iter();
        sheets.any(|sheet| sheet.meets(start, towards).is_some())
    }
}

/// √(x² + y²) of lengths that neither overflow nor vanish, faster than `hypot`.
fn length(x: f64, y: f64) -> f64 {
    (x * x + y * y).sqrt()
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
