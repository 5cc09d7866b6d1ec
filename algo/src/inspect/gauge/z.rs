//! The height of a feature.

use super::kind::*;

kind! {
    /// z of a plane at the middle of its region as taught, mm.
    Z {}
}

impl Kind for Z {
    fn facts(&self) -> Facts {
        Facts {
            takes: PLANE,
            ..Facts::new(Unit::Length, Basis::Geometry, "")
        }
    }

    fn value(&self, of: &[Geometry]) -> Option<f64> {
        of.first().map(|plane| plane.point.z)
    }
}
