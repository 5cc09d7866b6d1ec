//! The floor on which a part lies: a plane of the world, which stays where it is when the part moves.

use hal::bounded;

use super::body::Hit;
use super::optics::{Vector, along, dot, minus, turn, turned, turned_back};
use super::parts::Part;

/// The number of its face: no part has so many.
const FACE: u16 = u16::MAX / 4;

bounded! {
    /// A matte floor without an end.
    #[derive(Copy)]
    pub struct Ground: Default {
        /// What it reflects of the light that the part would reflect.
        pub albedo: f64 = 0.0..=1.0 => 0.35,
        /// How far it lies below the lowest point of the part as designed, mm, where its tilt does not
        /// lift or lower it.
        pub depth_mm: f64 = 0.0..=1000.0 => 20.0,
        /// Tilt about x and about y, degrees.
        pub tilt_deg: [f64; 2] = -45.0..=45.0,
    }
}

/// A floor in the world.
pub(crate) struct Floor {
    albedo: f64,
    /// Where it crosses the z axis, and its unit normal.
    point: Vector,
    normal: Vector,
}

impl Floor {
    /// The floor below this part, wherever that lies and whatever defects it has.
    pub fn below(part: &Part, ground: &Ground) -> Self {
        let [x, y] = ground.tilt_deg;
        let mut part = part.clone();
        part.defects_mut().map(Vec::clear);
        Self {
            albedo: ground.albedo,
            point: [0.0, 0.0, part.lowest() - ground.depth_mm],
            normal: turned(&turn([x, y, 0.0]), [0.0, 0.0, 1.0]),
        }
    }

    /// Where a ray of the world meets it, in front of its origin: the distance, and the hit in the
    /// coordinates of a part that is turned by `rotation` and sees the ray as `origin` and `direction`.
    pub fn meets(
        &self,
        (from, towards): (Vector, Vector),
        rotation: &[f64; 9],
        (origin, direction): (Vector, Vector),
    ) -> Option<(f64, Hit)> {
        let above = dot(self.normal, minus(from, self.point));
        let t = -above / dot(self.normal, towards);
        let hit = Hit {
            point: along(origin, direction, t),
            normal: turned_back(rotation, self.normal),
            albedo: self.albedo,
            face: FACE,
        };
        (above > 0.0 && t > 0.0 && t.is_finite()).then_some((t, hit))
    }
}

impl Hit {
    /// Whether it is on the floor.
    pub fn is_on_floor(&self) -> bool {
        self.face == FACE
    }
}
