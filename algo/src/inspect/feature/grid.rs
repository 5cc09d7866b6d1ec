//! The square cells that a region is divided into.

use crate::inspect::region::Region;

/// The cells of a region, over the box around it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Grid {
    left: usize,
    top: usize,
    side: usize,
    columns: usize,
    rows: usize,
}

/// A region with more cells than there are buffers for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "{cells} squares of {side}x{side} pixels where at most {MAX_CELLS} are kept: smooth over more pixels or make the \
     region smaller"
)]
pub struct TooFine {
    /// Side of a cell in pixels.
    pub side: usize,
    /// How many there would be.
    pub cells: usize,
}

/// Cells of a region: 3 MB.
const MAX_CELLS: usize = 1 << 16;
/// A gauge that leaves the side of its cells to the grid has about so many.
const CELLS: usize = 1024;
/// A cell with fewer than this share of its square's pixels is left out, if the gauge asks for a
/// side.
const MIN_SUPPORT: f64 = 0.5;
/// Least side of such cells in pixels.
const MIN_SIDE: usize = 4;

impl Grid {
    /// Over a region's pixels; with a side of 0 the grid chooses one.
    ///
    /// # Errors
    /// If there are too many cells.
    pub fn over(region: &Region, side: usize) -> Result<Self, TooFine> {
        let spans = region.spans();
        let left = spans.iter().map(|(_, span)| span.start).min().unwrap_or(0);
        let right = spans.iter().map(|(_, span)| span.end).max().unwrap_or(0);
        let top = spans.first().map_or(0, |(row, _)| *row);
        let bottom = spans.last().map_or(0, |(row, _)| row + 1);
        let (width, height) = (right - left, bottom - top);
        let side = match side {
            0 => {
                let side = libm::ceil(libm::sqrt((width * height) as f64 / CELLS as f64));
                (side as usize).max(MIN_SIDE)
            }
            side => side,
        };
        let (columns, rows) = (width.div_ceil(side).max(1), height.div_ceil(side).max(1));
        let cells = columns.saturating_mul(rows);
        if cells > MAX_CELLS {
            return Err(TooFine { side, cells });
        }
        Ok(Self {
            left,
            top,
            side,
            columns,
            rows,
        })
    }

    /// Number of cells.
    pub fn len(&self) -> usize {
        self.columns * self.rows
    }

    /// Side of a cell in pixels.
    pub fn side(&self) -> usize {
        self.side
    }

    /// Cells of a row.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// The least number of measured pixels of a cell.
    pub fn least(&self) -> i64 {
        let side = self.side as f64;
        libm::ceil(MIN_SUPPORT * side * side) as i64
    }

    /// The middle of the square of a cell, in pixels of golden's frame.
    pub fn middle(&self, cell: usize) -> [f64; 2] {
        let half = (self.side - 1) as f64 / 2.0;
        let (along, down) = (cell % self.columns, cell / self.columns);
        [
            (self.left + along * self.side) as f64 + half,
            (self.top + down * self.side) as f64 + half,
        ]
    }

    /// The cell of a pixel of golden's frame; the nearest one for pixels beside the box.
    #[inline(always)]
    pub fn cell(&self, u: i32, v: i32) -> usize {
        let along = (u.max(self.left as i32) as usize - self.left) / self.side;
        let down = (v.max(self.top as i32) as usize - self.top) / self.side;
        down.min(self.rows - 1) * self.columns + along.min(self.columns - 1)
    }
}
