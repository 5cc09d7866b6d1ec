//! Where a level's blocks come from: frames, or memory if it was demodulated when it arrived.

use super::angle::AngleLanes;
use super::arrived::WrappedRow;
use super::fold::{BlockSample, Folded, fold};
use super::level::{Demodulated, LevelLanes};
use crate::simd::{Four, Lanes};

/// The rows of a level's frames, in the order of their shifts.
pub(crate) trait Frames: Copy {
    /// Whether modulations may have to be doubled: never those of four shifts, whose length is twice the modulation.
    const DOUBLED: bool;

    /// The first columns: rows of one length are checked together.
    fn first(self, columns: usize) -> Self;
    /// The block at `at`, folded; what lies `after` samples behind it is fetched.
    fn fold<V: Lanes>(&self, v: V, level: &LevelLanes<'_, V>, at: usize, after: usize)
    -> Folded<V>;
}

impl<T: BlockSample> Frames for Four<'_, T> {
    const DOUBLED: bool = false;

    #[inline(always)]
    fn first(self, columns: usize) -> Self {
        Self::new(self.rows(), columns)
    }

    #[inline(always)]
    fn fold<V: Lanes>(
        &self,
        v: V,
        level: &LevelLanes<'_, V>,
        at: usize,
        after: usize,
    ) -> Folded<V> {
        for row in self.rows() {
            v.fetch(row, at, after);
        }
        T::four(v, level, self, at)
    }
}

impl<T: BlockSample> Frames for &[&[T]] {
    const DOUBLED: bool = true;

    #[inline(always)]
    fn first(self, _columns: usize) -> Self {
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
        for row in *self {
            v.fetch(row, at, after);
        }
        fold(v, level, self, at)
    }
}

/// A level of a row, read block by block.
pub(crate) trait Source: Copy {
    /// As [`Frames::DOUBLED`].
    const DOUBLED: bool;

    /// The first columns.
    fn first(self, columns: usize) -> Self;
    /// The block at `at` as far as whether it is strong.
    fn block<V: Lanes>(&self, v: V, level: &LevelLanes<'_, V>, at: usize) -> Block<V>;
}

/// A block of pixels of a level.
pub(crate) enum Block<V: Lanes> {
    /// Its angles are not known yet.
    Folded(Folded<V>),
    /// It has been demodulated before.
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

    /// Its phases.
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
        Self {
            phase: &self.phase[..columns],
            doubts: &self.doubts[..columns],
        }
    }

    #[inline(always)]
    fn block<V: Lanes>(&self, v: V, _level: &LevelLanes<'_, V>, at: usize) -> Block<V> {
        Block::Demodulated(self.block(v, at))
    }
}
