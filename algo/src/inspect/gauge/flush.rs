//! The flush of a joint.

use super::kind::*;
use crate::inspect::section;

kind! {
    /// How far the right edge's tangent point lies above the left side's line, mm.
    Flush {}
}

impl Kind for Flush {
    fn facts(&self) -> Facts {
        Facts::new(Basis::Section, SECTION)
    }

    fn of_section(&self, of: &section::Joint) -> Option<f64> {
        Some(section::flush(of))
    }
}
