//! The angle between two features.

use super::kind::*;

kind! {
    /// The angle between the normals of two planes, on the sides that the camera sees, degrees:
    /// 0 where they are parallel, up to 180.
    Angle {}
}

impl Kind for Angle {
    fn facts(&self) -> Facts {
        Facts {
            takes: PLANES,
            never_negative: true,
            ..Facts::new(Unit::Angle, Basis::Geometry, "")
        }
    }

    /// By sine and cosine: the arc cosine alone is inexact near 0.
    fn value(&self, of: &[Geometry]) -> Option<f64> {
        let [one, other] = of else { return None };
        let (one, other) = (one.direction, other.direction);
        Some(libm::atan2(one.cross(other).length(), one.dot(other)).to_degrees())
    }
}
