//! Where a level's blocks come from: the rows of its frames, or maps if it was demodulated on
//! arrival.
//!
//! Kernels are generic over this, so that decoding all levels at once and decoding on arrival share
//! one body. Four rows of bytes are a form of their own, the fastest; [`Rows`] takes any number of
//! shifts of any sample type.

use super::angle::AngleLanes;
use super::arrived::WrappedRow;
use super::fold::{Folded, fold, fold_four};
use super::level::{Demodulated, LevelLanes};
use super::samples::BlockSample;
use super::terms::{blocks, of_shifts, pointers};
use crate::simd::{LINE, Lanes, Rows};
use core::sync::atomic::{Ordering, compiler_fence};

/// The rows of a level's frames, in the order of their shifts.
pub(crate) trait Frames: Copy {
    /// Whether the modulation may come out halved ([`LevelLanes::fine`]): never with bytes in the
    /// forms of [`super::terms`], where the pointer is 1.49 times as long as the modulation or
    /// longer.
    const DOUBLED: bool;
    /// Whether [`Self::fold_in_line`] keeps anything.
    const LINES: bool;
    /// What is kept of the cache lines of a level.
    type Kept<V: Lanes>: Copy;

    /// Nothing is kept yet.
    fn nothing_kept<V: Lanes>(v: V) -> Self::Kept<V>;
    /// Samples from `at` to the next cache line of the first row.
    fn to_line(&self, at: usize) -> usize;
    /// The first columns, so that one check of the length serves all blocks.
    fn first(self, columns: usize) -> Self;
    /// The block at `at`, folded; samples `after` behind it are prefetched.
    fn fold<V: Lanes>(&self, v: V, level: &LevelLanes<'_, V>, at: usize, after: usize)
    -> Folded<V>;
    /// As [`Self::fold`], for the blocks of a cache line in their order. The first loads all of
    /// each row's line before the next row's, and keeps the others: frames that begin at pages have
    /// equal pixels in the same set of the cache, which holds fewer lines than there are frames.
    /// The line of the sample `ahead` is prefetched. With [`Place::Other`] nothing is read.
    fn fold_in_line<V: Lanes>(
        &self,
        v: V,
        level: &LevelLanes<'_, V>,
        at: usize,
        ahead: usize,
        place: Place,
        kept: &mut Self::Kept<V>,
    ) -> Folded<V>;
}

/// Which block of a cache line is folded.
#[derive(Clone, Copy)]
pub(crate) enum Place {
    /// The first block: the other blocks of the line are kept.
    First,
    /// Another block of the line, 1 for the second.
    Other(usize),
    /// A block by itself, without those around it.
    Alone,
}

impl<const N: usize> Frames for [&[u8]; N] {
    const DOUBLED: bool = false;
    const LINES: bool = true;
    /// The samples of each block of a line but the first.
    type Kept<V: Lanes> = [[V::B; N]; 3];

    #[inline(always)]
    fn nothing_kept<V: Lanes>(v: V) -> Self::Kept<V> {
        [[v.splat8(0); N]; 3]
    }

    #[inline(always)]
    fn to_line(&self, at: usize) -> usize {
        let address = self[0].as_ptr() as usize + at;
        address.next_multiple_of(LINE) - address
    }

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
        fold_bytes(v, level, blocks(v, self, at, after))
    }

    #[inline(always)]
    fn fold_in_line<V: Lanes>(
        &self,
        v: V,
        level: &LevelLanes<'_, V>,
        at: usize,
        ahead: usize,
        place: Place,
        kept: &mut Self::Kept<V>,
    ) -> Folded<V> {
        let mut blocks = [v.splat8(0); N];
        let mut k = 0;
        match place {
            Place::Alone => return self.fold(v, level, at, ahead.wrapping_sub(at)),
            Place::Other(block) => blocks = kept[block - 1],
            Place::First => {
                while k < N {
                    // Two rows at once where there are registers for it: their blocks are
                    // neighbours in what is kept, and are stored in pairs.
                    let pair = if V::FEW_REGISTERS {
                        k
                    } else {
                        (k + 1).min(N - 1)
                    };
                    v.fetch_line(self[k], ahead);
                    let one = v.load_line(self[k], at);
                    let mut two = one;
                    if pair > k {
                        v.fetch_line(self[pair], ahead);
                        two = v.load_line(self[pair], at);
                    }
                    (blocks[pair], blocks[k]) = (two[0], one[0]);
                    let mut block = 1;
                    while block < LINE / V::PIXELS {
                        kept[block - 1][k] = one[block];
                        kept[block - 1][pair] = two[block];
                        block += 1;
                    }
                    k = pair + 1;
                    // Keeps the compiler from reading the second halves later.
                    if k.is_multiple_of(2) {
                        compiler_fence(Ordering::SeqCst);
                    }
                }
            }
        }
        fold_bytes(v, level, blocks)
    }
}

#[inline(always)]
fn fold_bytes<V: Lanes, const N: usize>(
    v: V,
    level: &LevelLanes<'_, V>,
    blocks: [V::B; N],
) -> Folded<V> {
    if N == 4 {
        return fold_four(v, level, [blocks[0], blocks[1], blocks[2], blocks[N - 1]]);
    }
    fold(v, level, of_shifts::<V, u8, N>(v, level, &blocks))
}

impl<T: BlockSample> Frames for Rows<'_, T> {
    const DOUBLED: bool = true;
    const LINES: bool = false;
    type Kept<V: Lanes> = ();

    #[inline(always)]
    fn nothing_kept<V: Lanes>(_v: V) {}

    #[inline(always)]
    fn to_line(&self, _at: usize) -> usize {
        0
    }

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

    #[inline(always)]
    fn fold_in_line<V: Lanes>(
        &self,
        v: V,
        level: &LevelLanes<'_, V>,
        at: usize,
        ahead: usize,
        _place: Place,
        _kept: &mut (),
    ) -> Folded<V> {
        self.fold(v, level, at, ahead.wrapping_sub(at))
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
        Block::Folded(self.fold(v, level, at, V::AHEAD_OF_MANY))
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
