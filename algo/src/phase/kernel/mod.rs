//! The kernels: the rows of a level's frames → what it predicts for the next, and of the finest
//! level → absolute phase, modulation and trust, block by block.
//!
//! | file | sequences |
//! |---|---|
//! | [`geometric`] | geometric |
//! | [`about`] | dense, single |
//!
//! A block is [`Lanes::PIXELS`] neighbouring pixels. Every step of a block is a function of `v:
//! impl Lanes` that is inlined into an entry compiled for the back-end's instructions; see
//! [`crate::simd`]. [`temporal`], [`known`] and [`quality`] hold what kernels share.

pub(super) mod about;
pub(super) mod geometric;
mod known;
mod quality;
mod temporal;

use crate::simd::Lanes;
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
