//! Where a level's blocks come from: the rows of its frames, or maps if it was demodulated on arrival.
//!
//! Kernels are generic over this, so that decoding all levels at once and decoding on arrival share one body. Four rows of bytes
//! are a form of their own, the fastest; [`Rows`] takes any number of shifts of any sample type.

use super::angle::AngleLanes;
use super::arrived::WrappedRow;
use super::fold::{Folded, fold, fold_four};
use super::level::{Demodulated, LevelLanes};
use super::samples::BlockSample;
use super::terms::{of_shifts, pointers};
use crate::simd::{Lanes, Rows};

/// The rows of a level's frames, in the order of their shifts.
pub(crate) trait Frames: Copy {
    /// Whether the modulation may come out halved ([`LevelLanes::fine`]): never with bytes in the forms of [`super::terms`], where
    /// the pointer is 1.49 times as long as the modulation or longer.
    const DOUBLED: bool;

    /// The first columns, so that one check of the length serves all blocks.
    fn first(self, columns: usize) -> Self;
    /// The block at `at`, folded; samples `after` behind it are prefetched.
    fn fold<V: Lanes>(&self, v: V, level: &LevelLanes<'_, V>, at: usize, after: usize)
    -> Folded<V>;
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
    fn fold<V: Lanes>(
        &self,
        v: V,
        level: &LevelLanes<'_, V>,
        at: usize,
        after: usize,
    ) -> Folded<V> {
        if N != 4 {
            return fold(v, level, of_shifts(v, level, self, at, after));
        }
        for row in self {
            v.fetch(row, at, after);
        }
        fold_four(v, [self[0], self[1], self[2], self[3]], at)
    }
}

impl<T: BlockSample> Frames for Rows<'_, T> {
    const DOUBLED: bool = true;

    #[inline(always)]
    fn first(self, columns: usize) -> Self {
        self.part(columns)
    }

    #[inline(always)]
    fn fold<V: Lanes>(
        &self,
        v: V,
        level: &LevelLanes<'_, V>,
        at: usize,
        after: usize,
    ) -> Folded<V> {
        fold(v, level, pointers(v, level, self, at, after))
    }
}

/// A row of a level, read block by block.
pub(crate) trait Source: Copy {
    /// As [`Frames::DOUBLED`].
    const DOUBLED: bool;

    /// The first columns.
    fn first(self, columns: usize) -> Self;
    /// The block at `at`, at least as far as its modulation mask is known.
    fn block<V: Lanes>(&self, v: V, level: &LevelLanes<'_, V>, at: usize) -> Block<V>;
}

/// A block of a level.
pub(crate) enum Block<V: Lanes> {
    /// Folded; its angles are not computed yet.
    Folded(Folded<V>),
    /// Read from maps.
    Demodulated(Demodulated<V>),
}

impl<V: Lanes> Block<V> {
    /// Mask: the modulation is at least the trusted minimum.
    #[inline(always)]
    pub fn strong(&self) -> V::B {
        match self {
            Self::Folded(folded) => folded.strong,
            Self::Demodulated(block) => block.strong,
        }
    }

    /// The demodulated block.
    #[inline(always)]
    pub fn fine(
        &self,
        v: V,
        level: &LevelLanes<'_, V>,
        angle: &AngleLanes<V>,
        doubled: bool,
    ) -> Demodulated<V> {
        match self {
            Self::Folded(folded) => level.fine(v, angle, folded, doubled).0,
            Self::Demodulated(block) => *block,
        }
    }
}

impl<S: Frames> Source for S {
    const DOUBLED: bool = S::DOUBLED;

    #[inline(always)]
    fn first(self, columns: usize) -> Self {
        Frames::first(self, columns)
    }

    #[inline(always)]
    fn block<V: Lanes>(&self, v: V, level: &LevelLanes<'_, V>, at: usize) -> Block<V> {
        Block::Folded(self.fold(v, level, at, V::AHEAD))
    }
}

impl Source for WrappedRow<'_> {
    const DOUBLED: bool = false;

    #[inline(always)]
    fn first(self, columns: usize) -> Self {
        self.part(0..columns)
    }

    #[inline(always)]
    fn block<V: Lanes>(&self, v: V, _level: &LevelLanes<'_, V>, at: usize) -> Block<V> {
        Block::Demodulated(self.block(v, at))
    }
}
