//! A row of heights, what it is compared with, and what comes of it.

use super::linear::BlockNumbers;
use crate::inspect::weight::Factor;
use crate::pipeline::NO_OFFSET;
use crate::units::Height;
use core::ops::Range;

/// The golden map that rows are compared with.
#[derive(Clone, Copy)]
pub struct GoldenMap<'a> {
    pub height: &'a [Height],
    /// See [`crate::pipeline::CubicInput`].
    pub taught: &'a [u16],
    /// What deviations in height are multiplied by.
    pub factor: &'a [Factor],
    pub width: usize,
}

impl GoldenMap<'_> {
    /// The place of a pixel after a whole displacement, and how many pixels the map has from there
    /// to the end of the row; none if it has not so many rows.
    #[inline(always)]
    pub fn inside(
        &self,
        (u, v): (usize, usize),
        [along, down]: [i32; 2],
        rows: usize,
    ) -> Option<(usize, usize)> {
        let column = (u as i32).wrapping_add(along);
        let row = (v as i32).wrapping_add(down);
        let inside = column >= 0
            && row >= 0
            && (column as usize) < self.width
            && (row as usize + rows) * self.width <= self.height.len();
        let place = (row as usize)
            .wrapping_mul(self.width)
            .wrapping_add(column as usize);
        inside.then(|| (place, self.width - column as usize))
    }
}

/// Deviations of a row, nm; [`NO_OFFSET`] where the part is not compared.
pub struct Deviations<'a> {
    /// In height.
    pub height: &'a mut [i32],
    /// Along the normal, weighted.
    pub normal: &'a mut [i32],
}

impl Deviations<'_> {
    #[inline]
    pub fn of(&mut self, columns: Range<usize>) -> Deviations<'_> {
        Deviations {
            height: &mut self.height[columns.clone()],
            normal: &mut self.normal[columns],
        }
    }

    #[inline]
    pub fn leave_open(&mut self) {
        self.height.fill(NO_OFFSET);
        self.normal.fill(NO_OFFSET);
    }
}

/// A row of height offsets to be aligned.
#[derive(Clone, Copy)]
pub struct OffsetRow<'a> {
    pub v: usize,
    pub offset: &'a [i32],
    /// Displacements of its blocks.
    pub blocks: &'a [BlockNumbers],
}
