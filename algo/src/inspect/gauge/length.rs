//! The length of a slot.

use super::kind::*;

kind! {
    /// The overall length of the least-squares slot, over its round ends, mm.
    Length {}
}

impl Kind for Length {
    fn facts(&self) -> Facts {
        Facts {
            takes: SLOT,
            never_negative: true,
            ..Facts::new(Unit::Length, Basis::Geometry, "")
        }
    }

    fn value(&self, of: &[Geometry]) -> Option<f64> {
        of.first()?.sizes[0]
    }
}
