//! Rows, block by block: the levels of a block → its absolute phase, modulation and trust.

pub(super) mod around;
pub(super) mod arrive;
mod climb;
mod doubt;
pub(super) mod fused;

use crate::simd::Lanes;
use core::ops::Range;

/// The starts of the blocks that cover columns of a row: one after the other, the last moved back so that it ends with
/// them. Columns are at least a block long.
#[inline(always)]
fn next_block<V: Lanes>(at: usize, columns: &Range<usize>) -> Option<usize> {
    if at >= columns.end {
        return None;
    }
    Some(at.min(columns.end - V::PIXELS))
}
