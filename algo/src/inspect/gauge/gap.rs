//! The gap of a joint.

use super::kind::*;
use crate::inspect::section;

kind! {
    /// The distance of the extreme points of both edges along the mean direction of both sides, mm;
    /// less than 0 where the sides overlap.
    Gap {}
}

impl Kind for Gap {
    fn facts(&self) -> Facts {
        Facts::new(Basis::Section, SECTION)
    }

    fn of_section(&self, of: &section::Joint) -> Option<f64> {
        Some(section::gap(of))
    }
}
