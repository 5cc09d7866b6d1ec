//! The height of a feature.

use super::kind::*;

kind! {
    /// z of the centre of a hole or slot, or of a plane at the middle of its region as taught, mm:
    /// in a datum system, or else in the frame as taught.
    Z {}
}

impl Kind for Z {
    fn facts(&self) -> Facts {
        Facts {
            datum: true,
            ..Facts::new(Basis::Geometry, &[FeatureKind::PLANE_OR_OPENING])
        }
    }

    fn value(&self, of: &[Geometry]) -> Option<f64> {
        of.first().map(|of| of.point.z)
    }
}
