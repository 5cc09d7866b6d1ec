//! Sheets of metal over a floor, with their walls: what rays meet of plates and joints.
//!
//! Sphere tracing (J. C. Hart, 1996) of the distance to the sheets; the floor is a plane.

use super::sheet::{FACES, Sheet};
use crate::body::{Body, Hit, clip};
use crate::optics::{Vector, along, dot};
use hal::bounded;

/// A ray meets what it comes this close to, mm.
const TOLERANCE_MM: f64 = 1e-5;
/// Shadow rays start at this distance from the surface, mm.
const LIFT_MM: f64 = 1e-4;
/// The box around the material is widened by this, mm.
const MARGIN_MM: f64 = 1e-3;
/// Most steps along a ray; a ray that takes them all meets nothing.
const MAX_RAY_STEPS: usize = 10_000;

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
    bounds: [Vector; 2],
    /// z and albedo of the floor.
    floor: Option<[f64; 2]>,
}

impl Solid {
    /// Sheets whose upper side as designed lies at `z`, and the floor below.
    pub(super) fn new(sheets: Vec<Sheet>, z: f64, floor: &Floor) -> Self {
        let corners = || sheets.iter().flat_map(Sheet::corners);
        let limit = |of: fn(f64, f64) -> f64, margin: f64| {
            [0, 1, 2].map(|axis| {
                let values = corners().map(|corner| corner[axis]);
                values.reduce(of).unwrap_or_default() + margin
            })
        };
        let bounds = [limit(f64::min, -MARGIN_MM), limit(f64::max, MARGIN_MM)];
        Self {
            sheets,
            bounds,
            floor: (floor.albedo > 0.0).then_some([z - floor.depth, floor.albedo]),
        }
    }

    /// Where the ray first meets a sheet, and which.
    fn march(&self, origin: Vector, direction: Vector) -> Option<(Vector, usize)> {
        let (mut t, end) = clip(&self.bounds, origin, direction)?;
        for _ in 0..MAX_RAY_STEPS {
            if t > end {
                return None;
            }
            let point = along(origin, direction, t);
            let mut nearest = f64::INFINITY;
            for (at, sheet) in self.sheets.iter().enumerate() {
                let distance = sheet.distance(point);
                if distance < TOLERANCE_MM {
                    return Some((point, at));
                }
                nearest = nearest.min(distance);
            }
            t += nearest;
        }
        None
    }
}

impl Body for Solid {
    fn first_hit(&self, origin: Vector, direction: Vector) -> Option<Hit> {
        if let Some((point, at)) = self.march(origin, direction) {
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
        self.march(start, towards).is_some()
    }
}
