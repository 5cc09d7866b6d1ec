//! The mean height of a region.

use super::kind::*;
use crate::inspect::feature::mean;

kind! {
    /// The mean height, mm.
    MeanHeight {}
}

impl Kind for MeanHeight {
    fn facts(&self) -> Facts {
        Facts::new(Basis::Region, SURFACE)
    }

    fn find(&self, of: Evidence<'_>) -> Option<FoundValue> {
        let value = mean(of.cells(), of.room)?;
        Some(of.linear(value))
    }
}
