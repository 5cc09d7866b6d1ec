//! What the rows of a strip add up to.

use super::counts::Counts;
use super::gauges::Gauges;
use super::sections::SectionPoints;
use super::squares::Squares;
use crate::inspect::feature::Sum;
use alloc::vec::Vec;
use core::ops::Range;

/// The sums over the rows of a strip: all that readings are worked out from.
#[derive(Debug)]
pub struct StripSums {
    pub counts: Counts,
    pub squares: Squares,
    pub sections: SectionPoints,
}

impl StripSums {
    /// Of a strip of these rows of `width` pixels.
    pub fn new(gauges: &Gauges, width: usize, rows: &Range<usize>) -> Self {
        Self {
            counts: Counts::new(gauges),
            squares: Squares::new(gauges, width, rows),
            sections: SectionPoints::new(gauges),
        }
    }

    /// Bytes of its cells and tiles: nearly all of its memory.
    pub fn bytes(&self) -> usize {
        self.counts.bytes() + self.squares.bytes()
    }

    pub fn clear(&mut self) {
        self.counts.clear();
        self.squares.clear();
        self.sections.clear();
    }
}

/// The sums of all strips over the cells of a patch.
pub fn add_up(strips: &[StripSums], patch: usize, cells: usize, sums: &mut Vec<Sum>) {
    sums.clear();
    sums.resize(cells, Sum::default());
    for strip in strips {
        for (sum, more) in sums.iter_mut().zip(&strip.counts.cells[patch]) {
            sum.add(more);
        }
    }
}
