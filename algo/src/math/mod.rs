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

/// The intersection of two; it may be empty.
#[inline]
pub(crate) fn common(a: &Range<usize>, b: &Range<usize>) -> Range<usize> {
    let start = a.start.max(b.start);
    start..a.end.min(b.end).max(start)
}

/// From the first to the last of either.
#[inline]
pub(crate) fn hull(a: Range<usize>, b: Range<usize>) -> Range<usize> {
    match (a.is_empty(), b.is_empty()) {
        (true, _) => b,
        (_, true) => a,
        _ => a.start.min(b.start)..a.end.max(b.end),
    }
}
