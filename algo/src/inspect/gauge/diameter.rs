//! The diameter of a round hole.

use super::kind::*;

kind! {
    /// The diameter of the least-squares circle of a hole's rim, mm: the modifier GG of ISO
    /// 14405-1:2016.
    Diameter {}
}

impl Kind for Diameter {
    fn facts(&self) -> Facts {
        Facts {
            never_negative: true,
            ..Facts::new(Basis::Geometry, CIRCLE)
        }
    }

    fn value(&self, of: &[Geometry]) -> Option<f64> {
        of.first()?.sizes[0]
    }
}
