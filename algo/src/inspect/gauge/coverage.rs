//! The share of a region that has a height.

use super::kind::*;

kind! {
    /// The share of the region that has a height.
    Coverage {}
}

impl Kind for Coverage {
    fn facts(&self) -> Facts {
        Facts {
            unit: Unit::Share,
            ..Facts::new(Basis::Pixels, SURFACE)
        }
    }
}
