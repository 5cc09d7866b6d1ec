//! The width of a slot.

use super::kind::*;

kind! {
    /// The distance of the sides of the least-squares slot, mm.
    Width {}
}

impl Kind for Width {
    fn facts(&self) -> Facts {
        Facts {
            never_negative: true,
            ..Facts::new(Basis::Geometry, SLOT)
        }
    }

    fn value(&self, of: &[Geometry]) -> Option<f64> {
        of.first()?.sizes[1]
    }
}
