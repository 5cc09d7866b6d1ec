//! What was measured in each cell of a region.

use super::taught::TaughtCell;
use alloc::vec::Vec;

/// A region with fewer than this share of the pixels that it had as taught has no cells.
const MIN_SHARE: f64 = 0.5;

/// Sums over the pixels of a cell. Whole numbers, so that the order of summation does not matter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sum {
    /// Pixels.
    pub count: i64,
    /// Σ of deviations from golden, nm.
    pub deviation: i64,
}

impl Sum {
    /// Adds another's pixels.
    pub fn add(&mut self, other: &Self) {
        self.count += other.count;
        self.deviation += other.deviation;
    }
}

/// The means of a cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cell {
    /// Its number in the [`Grid`](super::Grid).
    pub at: usize,
    /// Pixels whose noise makes its error.
    pub pixels: f64,
    /// Height, mm: as taught plus the mean deviation, so that it does not depend on which pixels of
    /// the cell were measured.
    pub height: f64,
    /// Deviation from golden in height, mm.
    pub deviation: f64,
    /// The cell as taught.
    pub taught: TaughtCell,
}

/// Appends the cells of a region to `out`; none if less than half of the pixels that it had as
/// taught were measured. With `least`, only cells with at least so many measured pixels. Without,
/// all cells that it had as taught: one without a measured pixel gets the mean deviation of the
/// others.
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
