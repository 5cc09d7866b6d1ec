//! How much a benchmark measures.

use std::time::Duration;

/// The size of the frames, and how often each kernel is timed.
#[derive(Clone, Copy, Debug)]
pub struct Effort {
    /// Columns and rows of the frames.
    pub size: (usize, usize),
    /// Columns of the narrow frames that the cost of a row is taken from.
    pub narrow: usize,
    /// Bytes that are read before the first frame set comes again: more than caches hold.
    pub bytes: usize,
    /// Rounds; figures are medians over them.
    pub rounds: usize,
    /// A time is measured over a whole rotation, or over fewer sets if these take this long
    /// already.
    pub patience: Duration,
}

impl Effort {
    /// For figures that are quoted.
    pub const FULL: Self = Self {
        size: (1456, 1088),
        narrow: 64,
        bytes: 210_000_000,
        rounds: 9,
        patience: Duration::from_millis(60),
    };
    /// For checking that everything works; the times mean nothing.
    pub const QUICK: Self = Self {
        size: (64, 48),
        narrow: 32,
        bytes: 1,
        rounds: 1,
        patience: Duration::ZERO,
    };

    /// Sizes of the hot frames, of equal pixels: 8 rows of a whole frame, and a narrow frame.
    pub fn hot_sizes(&self) -> [(usize, usize); 2] {
        let width = self.size.0;
        [
            (width, HOT_ROWS),
            (self.narrow, width * HOT_ROWS / self.narrow),
        ]
    }
}

/// Rows that are decoded again and again: with twelve frames and the result they fit into a
/// second-level cache.
const HOT_ROWS: usize = 8;
