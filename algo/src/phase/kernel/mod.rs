//! The kernels: the rows of a level's frames → what it predicts for the next, and of the finest
//! level → absolute phase, modulation and trust, block by block.
//!
//! [`geometric`] has the kernels of geometric levels, [`about`] those of dense levels and of a
//! single one. Each is a loop over the blocks of a row that is compiled for every back-end
//! (`back_end_entry!`); what happens in a block are the functions of [`super::samples`] to
//! [`super::quality`].
//!
//! Kernels are generic over where their blocks come from ([`Frames`]): some numbers of rows of
//! bytes are forms of their own, the fastest; [`Rows`] takes any number of shifts of any sample
//! type.

pub(super) mod about;
pub(super) mod geometric;

use super::fold::{Folded, fold, fold_four};
use super::level::{Demodulation, LevelLanes, LevelPlan};
use super::samples::BlockSample;
use super::terms::{blocks, of_shifts, pointers};
use crate::simd::{Lanes, MAX_PIXELS, Rows};
use core::ops::Range;

/// The rows of a level's frames, in the order of their shifts.
pub(crate) trait Frames: Copy {
    /// Whether the modulation may come out halved ([`LevelLanes::fine`]): never with bytes in the
    /// forms of [`super::terms`], where the pointer is 1.49 times as long as the modulation or
    /// longer.
    const DOUBLED: bool;

    /// The first columns, so that one check of the length serves all blocks.
    fn first(self, columns: usize) -> Self;
    /// The block at `at`, folded.
    fn fold<V: Lanes>(&self, v: V, level: &LevelLanes<'_, V>, at: usize) -> Folded<V>;
}

impl<const N: usize> Frames for [&[u8]; N] {
    const DOUBLED: bool = false;

    #[inline(always)]
    fn first(mut self, columns: usize) -> Self {
        let mut k = 0;
        while k < N {
            self[k] = &self[k][..columns];
            k += 1;
        }
        self
    }

    #[inline(always)]
    fn fold<V: Lanes>(&self, v: V, level: &LevelLanes<'_, V>, at: usize) -> Folded<V> {
        let blocks = blocks(v, self, at);
        if N == 4 {
            return fold_four(v, level, [blocks[0], blocks[1], blocks[2], blocks[N - 1]]);
        }
        fold(v, level, of_shifts::<V, u8, N>(v, level, &blocks))
    }
}

impl<T: BlockSample> Frames for Rows<'_, T> {
    const DOUBLED: bool = true;

    #[inline(always)]
    fn first(self, columns: usize) -> Self {
        self.part(columns)
    }

    #[inline(always)]
    fn fold<V: Lanes>(&self, v: V, level: &LevelLanes<'_, V>, at: usize) -> Folded<V> {
        fold(v, level, pointers(v, level, self, at))
    }
}

/// The rows of a level whose pixels with clipped samples are demodulated from the others.
#[derive(Clone, Copy)]
struct Mended<'a, T>(Rows<'a, T>);

impl<T: BlockSample> Frames for Mended<'_, T> {
    const DOUBLED: bool = true;

    #[inline(always)]
    fn first(self, columns: usize) -> Self {
        Self(self.0.part(columns))
    }

    #[inline(always)]
    fn fold<V: Lanes>(&self, v: V, level: &LevelLanes<'_, V>, at: usize) -> Folded<V> {
        let rows = &self.0;
        let found = pointers(v, level, rows, at);
        fold(v, level, found.mended(v, level, |k| rows.row(k), at))
    }
}

/// The next block of `columns`, from column `from` on, that has a pixel with clipped samples: decoded
/// again, as [`Mended`]. They are too few for the loop over all blocks to look for them. None where
/// the level takes all samples.
fn next_clipped(
    level: &LevelPlan,
    from: &mut usize,
    columns: &Range<usize>,
    has_clipped: impl Fn(Range<usize>) -> bool,
) -> Option<Range<usize>> {
    level.clipped.as_ref()?;
    while *from < columns.end {
        let start = (*from).min(columns.end - MAX_PIXELS);
        *from += MAX_PIXELS;
        let block = start..start + MAX_PIXELS;
        if has_clipped(block.clone()) {
            return Some(block);
        }
    }
    None
}

/// The rows of a level of N shifts of 8 bits that start at 0.
fn of_bytes<'r, 'a, T: BlockSample, const N: usize>(
    level: &LevelPlan,
    rows: &'r [&'a [T]],
) -> Option<&'r [&'a [u8]; N]> {
    let rows: &[&[T]; N] = rows.try_into().ok()?;
    if level.demodulation == Demodulation::Weighted {
        return None;
    }
    T::bytes(rows)
}

/// The start of the next block of `columns`, which are at least a block long. The last block is
/// moved back so that it ends with them; it may overlap the one before.
#[inline(always)]
fn next_block<V: Lanes>(start: usize, columns: &Range<usize>) -> Option<usize> {
    if start >= columns.end {
        return None;
    }
    Some(start.min(columns.end - V::PIXELS))
}
