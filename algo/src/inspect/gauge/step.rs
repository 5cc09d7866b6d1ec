//! The height of a region above another one.

use super::kind::*;
use crate::inspect::feature::mean;

kind! {
    /// The mean height less that of a second region, mm.
    Step {}
}

impl Kind for Step {
    fn facts(&self) -> Facts {
        Facts::new(Basis::Region, SURFACES)
    }

    fn find(&self, of: Evidence<'_>) -> Option<FoundValue> {
        let value = mean(of.cells(), of.room)? - mean(of.from(), of.room)?;
        for weight in &mut of.room[of.count..] {
            *weight = -*weight;
        }
        Some(of.linear(value))
    }
}
