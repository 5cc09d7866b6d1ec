//! Square cells of pixels, and what was measured in each.

use super::TaughtCell;
use crate::inspect::Region;
use alloc::vec::Vec;

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
    /// How many cells there would be.
    pub cells: usize,
}

/// Cells of a region: 3 MB.
const MAX_CELLS: usize = 1 << 16;
/// A gauge that leaves the side of its cells to the grid has about so many cells.
const CELLS: usize = 1024;
/// A cell with fewer than this share of its square's pixels is left out, if the gauge asks for a
/// side.
const MIN_SUPPORT: f64 = 0.5;
/// Least side of such cells in pixels.
const MIN_SIDE: usize = 4;
/// A region with fewer than this share of the pixels that it had as taught has no cells.
const MIN_SHARE: f64 = 0.5;

impl Grid {
    /// The grid over a region's pixels; with a side of 0 it chooses the side.
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

    /// Cells in a row of the grid.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// The least number of measured pixels of a cell.
    pub fn least(&self) -> i64 {
        let side = self.side as f64;
        libm::ceil(MIN_SUPPORT * side * side) as i64
    }

    /// The cell of a pixel of golden's frame; for pixels beside the box the nearest cell.
    #[inline(always)]
    pub fn cell(&self, u: i32, v: i32) -> usize {
        let along = (u.max(self.left as i32) as usize - self.left) / self.side;
        let down = (v.max(self.top as i32) as usize - self.top) / self.side;
        down.min(self.rows - 1) * self.columns + along.min(self.columns - 1)
    }
}

/// Sums over the pixels of a cell. Whole numbers, so that the order of summation does not matter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sum {
    /// Pixels.
    pub count: i64,
    /// Σ of deviations from golden, nm.
    pub deviation: i64,
}

impl Sum {
    /// Adds the pixels of another sum.
    pub fn add(&mut self, other: &Self) {
        self.count += other.count;
        self.deviation += other.deviation;
    }
}

/// The means of a cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cell {
    /// The number of the cell in the [`Grid`].
    pub at: usize,
    /// Number of pixels from whose noise the error of the cell follows.
    pub pixels: f64,
    /// Height, mm: as taught plus the mean deviation, so that it does not depend on which pixels of
    /// the cell were measured.
    pub height: f64,
    /// Deviation from golden in height, mm.
    pub deviation: f64,
    /// The cell as taught.
    pub taught: TaughtCell,
}

/// Appends the cells of a region to `out`, but none if less than half of the pixels that the region
/// had as taught were measured. With `least`, these are the cells with at least so many measured
/// pixels; without it, all cells that the region had as taught, where a cell without a measured
/// pixel gets the mean deviation of the others.
pub fn cells(sums: &[Sum], taught: &[TaughtCell], least: Option<i64>, out: &mut Vec<Cell>) {
    let had: u64 = taught.iter().map(|cell| u64::from(cell.pixels)).sum();
    let has: i64 = sums.iter().map(|sum| sum.count).sum();
    if has == 0 || (has as f64) < MIN_SHARE * had as f64 {
        return;
    }
    let all: i64 = sums.iter().map(|sum| sum.deviation).sum();
    let mean = all as f64 / has as f64;
    let pairs = sums.iter().zip(taught).enumerate();
    let pairs = pairs.filter(|(_, (sum, taught))| {
        taught.pixels > 0 && least.is_none_or(|least| sum.count >= least)
    });
    out.extend(pairs.map(|(at, (sum, &taught))| {
        let (pixels, nm) = match sum.count {
            0 => (f64::from(taught.pixels), mean),
            count => (count as f64, sum.deviation as f64 / count as f64),
        };
        let deviation = nm * 1e-6;
        Cell {
            at,
            pixels,
            height: taught.height + deviation,
            deviation,
            taught,
        }
    }));
}
