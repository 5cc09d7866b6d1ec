//! The deviations of the last rows of a strip: as many rows as the largest square spans, and the
//! one that it leaves.

use crate::pipeline::NO_OFFSET;
use alloc::vec;
use alloc::vec::Vec;
use core::ops::Range;

/// A ring of rows: row v lies at v modulo their number.
#[derive(Debug)]
pub struct RecentRows {
    width: usize,
    rows: usize,
    /// Deviations from golden along the normal in nm, weighted; [`NO_OFFSET`] where the part is not
    /// compared.
    deviation: Vec<i32>,
    /// The columns of each row outside of which no pixel is compared.
    extent: Vec<Range<usize>>,
    /// A row in which no pixel is compared.
    empty: Vec<i32>,
}

impl RecentRows {
    /// Rows of `width` pixels for squares of up to `side` pixels.
    pub fn new(width: usize, side: Option<usize>) -> Self {
        let rows = side.map_or(1, |side| side / 2 * 2 + 2);
        Self {
            width,
            rows,
            deviation: vec![NO_OFFSET; width * rows],
            extent: vec![0..0; rows],
            empty: vec![NO_OFFSET; width],
        }
    }

    /// The deviations of row `v`.
    pub fn row(&self, v: usize) -> &[i32] {
        let at = v % self.rows * self.width;
        &self.deviation[at..at + self.width]
    }

    /// The deviations of row `v` and its extent, to be written.
    pub fn row_mut(&mut self, v: usize) -> (&mut [i32], &mut Range<usize>) {
        let at = v % self.rows;
        let row = at * self.width..(at + 1) * self.width;
        (&mut self.deviation[row], &mut self.extent[at])
    }

    /// The columns of row `v` outside of which no pixel is compared.
    pub fn extent(&self, v: usize) -> Range<usize> {
        self.extent[v % self.rows].clone()
    }

    /// Writes the deviations of row `v` in mm; NaN where the part is not compared.
    pub fn store(&self, v: usize, deviation: &mut [f32]) {
        for (mm, &nm) in deviation.iter_mut().zip(self.row(v)) {
            *mm = match nm {
                NO_OFFSET => f32::NAN,
                nm => (f64::from(nm) / 1e6) as f32,
            };
        }
    }

    /// The deviations of row `v` and its extent; an empty row if it is none of the `written` ones.
    pub fn row_of(&self, v: usize, written: &Range<usize>) -> (&[i32], Range<usize>) {
        match written.contains(&v) {
            true => (self.row(v), self.extent(v)),
            false => (&self.empty, 0..0),
        }
    }
}
