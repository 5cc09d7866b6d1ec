//! How a part lies in front of a simulated head.

use super::optics::{Vector, plus, turn, turned};
use hal::bounded;
use hal::bounds::{MAX_PLACEMENT_MM, MAX_ROTATION_DEG, MAX_TILT_DEG};

bounded! {
    /// How a part lies: rotated about x, then y (tilt), then z (rotation), then shifted.
    #[derive(Copy)]
    pub struct Placement: Default {
        /// Shift x, y, z in mm.
        pub shift_mm: [f64; 3] = -MAX_PLACEMENT_MM..=MAX_PLACEMENT_MM,
        /// Tilt about x and about y, degrees.
        pub tilt_deg: [f64; 2] = -MAX_TILT_DEG..=MAX_TILT_DEG,
        /// Rotation about z, degrees.
        pub rotation_deg: f64 = -MAX_ROTATION_DEG..=MAX_ROTATION_DEG,
    }
}

impl Placement {
    /// Rz(rotation) · Ry(tilt y) · Rx(tilt x), row-major.
    pub(crate) fn rotation(&self) -> [f64; 9] {
        let [x, y] = self.tilt_deg;
        turn([x, y, self.rotation_deg])
    }

    /// Where a point of the part, in its own coordinates, lies in the world, mm.
    #[must_use]
    pub fn to_world(&self, point: Vector) -> Vector {
        plus(turned(&self.rotation(), point), self.shift_mm)
    }
}
