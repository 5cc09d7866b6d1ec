//! Rows, block by block: the levels of a block → its absolute phase, modulation and trust.

pub(super) mod about;
pub(super) mod geometric;
pub(super) mod on_arrival;
mod quality;
mod temporal;

use super::narrow::MAX_PIXELS;
use crate::pattern::MAX_SHIFTS;
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

/// Columns of a row that levels are decoded of one after the other, with what each says of the next on the stack.
const STRETCH: usize = 512;

/// The columns in stretches of at most [`STRETCH`] and at least [`MAX_PIXELS`]: the last may begin before the end of the one
/// before it.
fn stretches(columns: Range<usize>) -> impl Iterator<Item = Range<usize>> {
    let Range { start, end } = columns;
    (start..end).step_by(STRETCH).map(move |at| {
        let start = at.min(end - MAX_PIXELS);
        start..(at + STRETCH).min(end)
    })
}

/// The rows of a level, of these columns only.
fn of_stretch<'a, T>(
    rows: &[&'a [T]],
    columns: &Range<usize>,
) -> heapless::Vec<&'a [T], MAX_SHIFTS> {
    let mut part = heapless::Vec::new();
    part.extend(rows.iter().map(|row| &row[columns.clone()]));
    part
}
