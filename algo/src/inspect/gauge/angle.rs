//! The angle between two features.

use super::kind::*;

kind! {
    /// The angle between two features, degrees, from 0 where they are parallel to 180. Two planes:
    /// between their normals, on the sides that the camera sees. Two lines: between their
    /// directions, with the material on the left as the camera sees it.
    Angle {}
}

impl Kind for Angle {
    fn facts(&self) -> Facts {
        Facts {
            unit: Unit::Angle,
            never_negative: true,
            ..Facts::new(Basis::Geometry, &[&[Plane, Line], &[Plane, Line]])
        }
    }

    /// By sine and cosine: the arc cosine alone is inexact near 0.
    fn value(&self, of: &[Geometry]) -> Option<f64> {
        let [from, to] = of else { return None };
        let (one, other) = match (from.kind, to.kind) {
            (Plane, Plane) => (from.normal, to.normal),
            (Line, Line) => (from.direction?, to.direction?),
            _ => return None,
        };
        Some(libm::atan2(one.cross(other).length(), one.dot(other)).to_degrees())
    }
}
