//! Sheets of metal over a floor, with their walls: what rays meet of plates and joints.

use super::sheet::{FACES, Sheet};
use crate::body::{Body, Hit};
use crate::optics::{Vector, along, dot};
use hal::bounded;

/// Shadow rays start at this distance from the surface, mm.
const LIFT_MM: f64 = 1e-4;

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

impl Solid {
    /// Sheets whose upper side as designed lies at `z`, and the floor below.
    pub(super) fn new(sheets: Vec<Sheet>, z: f64, floor: &Floor) -> Self {
        Self {
            sheets,
            floor: (floor.albedo > 0.0).then_some([z - floor.depth, floor.albedo]),
        }
    }

    /// z of the lowest corner of its sheets.
    pub(super) fn lowest(&self) -> f64 {
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
