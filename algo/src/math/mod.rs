//! Complex numbers, rounding to whole numbers, neighbours in a frame, derivatives, and least
//! squares for a few unknowns.

pub mod complex;
pub(crate) mod nearest;
pub(crate) mod propagate;
pub mod solve;

use core::ops::Range;

/// The columns (or rows) within `reach` of one column, in a frame of `end` columns.
pub(crate) fn around(at: usize, reach: usize, end: usize) -> Range<usize> {
    at.saturating_sub(reach)..(at + reach + 1).min(end)
}
