//! The range of heights in a region.

use super::extreme::range;
use super::kind::*;

kind! {
    /// The highest less the lowest cell, mm.
    PeakToValley {
        /// Side of the cells, pixels.
        smoothing_px: usize = Domain::Pixels { odd: false },
    }
}

impl Kind for PeakToValley {
    fn facts(&self) -> Facts {
        Facts {
            never_negative: true,
            ..Facts::new(
                Unit::Length,
                Basis::Cells(self.smoothing_px),
                "over {smoothing_px} px",
            )
        }
    }

    fn find(&self, of: Evidence<'_>) -> Option<FoundValue> {
        of.room.extend(of.cells().iter().map(|cell| cell.height));
        range((of.cells(), of.columns), of.room, of.sigma, of.placed)
    }
}
