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
            words: "over {smoothing_px} px",
            never_negative: true,
            ..Facts::new(Basis::Cells(self.smoothing_px), SURFACE)
        }
    }

    fn find(&self, of: Evidence<'_>) -> Option<FoundValue> {
        of.room.extend(of.cells().iter().map(|cell| cell.height));
        range((of.cells(), of.columns), of.room, of.sigma, of.placed)
    }
}
