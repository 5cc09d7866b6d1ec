//! Flatness about the least-squares plane.

use super::extreme::range;
use super::kind::*;
use crate::inspect::feature::LevelPlane;

kind! {
    /// The distance between the two planes parallel to the least-squares plane that enclose all
    /// cells, mm: peak-to-valley flatness deviation FLTt about the reference plane LSPL of ISO
    /// 12781-1.
    Flatness {
        /// Side of the cells, pixels.
        smoothing_px: usize = Domain::Pixels { odd: false },
    }
}

impl Kind for Flatness {
    fn facts(&self) -> Facts {
        Facts {
            words: "over {smoothing_px} px",
            never_negative: true,
            ..Facts::new(Basis::Cells(self.smoothing_px), FACE)
        }
    }

    /// The plane's own error is small against a cell's and left out.
    fn find(&self, of: Evidence<'_>) -> Option<FoundValue> {
        let plane = LevelPlane::of(of.cells())?;
        let slope = 1.0 + plane.along * plane.along + plane.down * plane.down;
        let heights = of.cells().iter().map(|cell| plane.above(cell));
        of.room.extend(heights);
        let sigma = of.sigma / libm::sqrt(slope);
        range((of.cells(), of.columns), of.room, sigma, of.placed)
    }
}
