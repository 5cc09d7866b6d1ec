//! Where a level's blocks come from: the rows of its frames.
//!
//! Kernels are generic over this: some numbers of rows of bytes are forms of their own, the
//! fastest; [`Rows`] takes any number of shifts of any sample type.

use super::fold::{Folded, fold, fold_four};
use super::level::LevelLanes;
use super::samples::BlockSample;
use super::terms::{blocks, of_shifts, pointers};
use crate::simd::{Lanes, Rows};

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
