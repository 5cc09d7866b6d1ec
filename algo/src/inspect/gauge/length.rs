//! The length of a slot.

use super::kind::*;

kind! {
    /// The overall length of the least-squares slot, over its round ends, mm.
    Length {}
}

impl Kind for Length {
    fn facts(&self) -> Facts {
        Facts {
            never_negative: true,
            ..Facts::new(Basis::Geometry, SLOT)
        }
    }

    fn value(&self, of: &[Geometry]) -> Option<f64> {
        of.first()?.sizes[0]
    }
}
