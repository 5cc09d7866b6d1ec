//! The kernels: the rows of a level's frames → absolute phase, modulation and trust, block by
//! block.
//!
//! | file | sequences | levels |
//! |---|---|---|
//! | [`geometric`] | geometric | all at once |
//! | [`on_arrival`] | geometric | one at a time, and the finest |
//! | [`about`] | dense, single | all at once, one at a time, and the finest |
//!
//! A block is [`Lanes::PIXELS`] neighbouring pixels. Every step of a block is a function of `v:
//! impl Lanes` that is inlined into an entry compiled for the back-end's instructions; see
//! [`crate::simd`]. [`temporal`], [`known`] and [`quality`] hold what kernels share.

pub(super) mod about;
pub(super) mod geometric;
mod known;
pub(super) mod on_arrival;
mod quality;
mod temporal;

use crate::pattern::MAX_SHIFTS;
use crate::simd::{Lanes, MAX_PIXELS};
use core::ops::Range;

/// The start of the next block of `columns`, which are at least a block long. The last block is
/// moved back so that it ends with them; it may overlap the one before.
#[inline(always)]
fn next_block<V: Lanes>(at: usize, columns: &Range<usize>) -> Option<usize> {
    if at >= columns.end {
        return None;
    }
    Some(at.min(columns.end - V::PIXELS))
}

/// Columns that are decoded level by level at a time: what each level predicts for the next is then
/// on the stack.
const STRETCH: usize = 512;

/// The columns in stretches of at most [`STRETCH`] and at least [`MAX_PIXELS`]; the last may
/// overlap the one before.
fn stretches(columns: Range<usize>) -> impl Iterator<Item = Range<usize>> {
    let Range { start, end } = columns;
    (start..end).step_by(STRETCH).map(move |at| {
        let start = at.min(end - MAX_PIXELS);
        start..(at + STRETCH).min(end)
    })
}

/// These columns of a level's rows.
fn of_stretch<'a, T>(
    rows: &[&'a [T]],
    columns: &Range<usize>,
) -> heapless::Vec<&'a [T], MAX_SHIFTS> {
    let mut part = heapless::Vec::new();
    part.extend(rows.iter().map(|row| &row[columns.clone()]));
    part
}
