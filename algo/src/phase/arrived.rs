//! What is kept of levels that were decoded on arrival, while the next level was being exposed.
//!
//! Geometric levels update one set of maps in place: the phase that the levels so far predict for
//! the next one. Levels about a known map are combined after the last one, so wrapped phase and
//! flags of each are kept. Rows are at least one block wide, so that frames narrower than a block
//! need no copies of them.

use super::level::Demodulated;
use crate::simd::{Lanes, MAX_PIXELS};
use alloc::vec;
use alloc::vec::Vec;
use core::ops::Range;

/// The levels that have arrived, coarse to fine, of a whole frame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Arrived {
    /// Width and height of the frames.
    size: (usize, usize),
    /// How many levels.
    levels: usize,
    layout: Layout,
    /// The words of all rows, one row after the other, and the bytes.
    words: Vec<u16>,
    bytes: Vec<u8>,
}

/// What a row of the maps consists of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Layout {
    /// Pixels per row, at least a block.
    pixels: usize,
    /// Words and bytes per pixel.
    each: (usize, usize),
    /// Whether rows are of geometric levels.
    geometric: bool,
}

/// A row of what has arrived, borrowed as words `W` and bytes `B`.
#[derive(Debug)]
pub(crate) enum ArrivedRow<W, B> {
    /// Of geometric levels: what they predict for the next level.
    Predicted(Predicted<W, B>),
    /// Of levels about a known map.
    Wrapped {
        /// All levels but the finest, coarse to fine, one after the other.
        levels: Wrapped<W, B>,
        /// Pixels of each level.
        pixels: usize,
    },
}

/// The phase predicted for the next level ([`super::unwrap_step::PredictedPhase`]) along a row, with
/// maps of words `W` and of bytes `B`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Predicted<W, B> {
    /// Modulo one turn, 1/65536 turn.
    pub fraction: W,
    /// The whole turns of that phase, in the fixed point of the step to the next level.
    pub turns: W,
    /// The first [`crate::trust::Trust`] that rejects the pixel, or [`NO_REASON`].
    pub reason: B,
}

/// A row of [`Predicted`], borrowed.
pub(crate) type PredictedRow<'a> = Predicted<&'a [u16], &'a [u8]>;
/// A row of [`Predicted`], to be written.
pub(crate) type PredictedRowMut<'a> = Predicted<&'a mut [u16], &'a mut [u8]>;

/// No reason so far to reject a pixel. Larger than every reason, so that the smaller of two numbers
/// is the first reason.
pub(super) const NO_REASON: u8 = u8::MAX;

/// A demodulated level along a row, with maps of words `W` and of bytes `B`: owned or borrowed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Wrapped<W, B> {
    /// φ in 1/65536 turn.
    pub phase: W,
    /// [`WEAK`] and [`SATURATED`].
    pub flags: B,
}

/// A row of [`Wrapped`], borrowed.
pub(crate) type WrappedRow<'a> = Wrapped<&'a [u16], &'a [u8]>;
/// A row of [`Wrapped`], to be written.
pub(crate) type WrappedRowMut<'a> = Wrapped<&'a mut [u16], &'a mut [u8]>;

/// The modulation is below the trusted minimum.
const WEAK: u8 = 1;
/// A sample is at full scale and the level does not tolerate that.
const SATURATED: u8 = 2;

impl Arrived {
    /// Room for geometric levels.
    pub(super) fn geometric(width: usize, height: usize) -> Self {
        Self::new((width, height), (2, 1), true)
    }

    /// Room for this many levels about a known map.
    pub(super) fn about_map(width: usize, height: usize, levels: usize) -> Self {
        Self::new((width, height), (levels, levels), false)
    }

    fn new(size: (usize, usize), each: (usize, usize), geometric: bool) -> Self {
        let layout = Layout {
            pixels: size.0.max(MAX_PIXELS),
            each,
            geometric,
        };
        Self {
            size,
            levels: 0,
            layout,
            words: vec![0; layout.words() * size.1],
            bytes: vec![NO_REASON; layout.bytes() * size.1],
        }
    }

    /// How many levels have arrived.
    pub fn levels(&self) -> usize {
        self.levels
    }

    /// Width and height of the frames.
    pub fn size(&self) -> (usize, usize) {
        self.size
    }

    /// Forgets all levels, so that those of another measurement may arrive.
    pub fn restart(&mut self) {
        self.levels = 0;
    }

    /// Counts the level that has been written to [`Self::maps_mut`].
    pub(crate) fn add_level(&mut self) {
        self.levels += 1;
    }

    /// Row `v`.
    pub(super) fn row(&self, v: usize) -> ArrivedRow<&[u16], &[u8]> {
        let (words, bytes) = (self.layout.words(), self.layout.bytes());
        let words = &self.words[v * words..(v + 1) * words];
        let bytes = &self.bytes[v * bytes..(v + 1) * bytes];
        self.layout.row(words, bytes, <[u16]>::split_at)
    }

    /// Words and bytes of all rows, for the next level to be written to, and the layout of a row.
    pub(crate) fn maps_mut(&mut self) -> (Layout, &mut [u16], &mut [u8]) {
        (self.layout, &mut self.words, &mut self.bytes)
    }
}

impl Layout {
    /// Words of a row.
    pub fn words(&self) -> usize {
        self.pixels * self.each.0
    }

    /// Bytes of a row.
    pub fn bytes(&self) -> usize {
        self.pixels * self.each.1
    }

    /// The row that these words and bytes are, to be written.
    pub fn row_mut<'a>(
        &self,
        words: &'a mut [u16],
        bytes: &'a mut [u8],
    ) -> ArrivedRow<&'a mut [u16], &'a mut [u8]> {
        self.row(words, bytes, <[u16]>::split_at_mut)
    }

    fn row<W, B>(
        &self,
        words: W,
        bytes: B,
        split: impl FnOnce(W, usize) -> (W, W),
    ) -> ArrivedRow<W, B> {
        let pixels = self.pixels;
        if self.geometric {
            let (fraction, turns) = split(words, pixels);
            ArrivedRow::Predicted(Predicted {
                fraction,
                turns,
                reason: bytes,
            })
        } else {
            let levels = Wrapped {
                phase: words,
                flags: bytes,
            };
            ArrivedRow::Wrapped { levels, pixels }
        }
    }
}

impl PredictedRowMut<'_> {
    /// Borrowed to be read.
    #[inline(always)]
    pub fn row(&self) -> PredictedRow<'_> {
        Predicted {
            fraction: self.fraction,
            turns: self.turns,
            reason: self.reason,
        }
    }
}

impl PredictedRow<'_> {
    /// These columns.
    #[inline(always)]
    pub fn part(self, columns: Range<usize>) -> Self {
        Self {
            fraction: &self.fraction[columns.clone()],
            turns: &self.turns[columns.clone()],
            reason: &self.reason[columns],
        }
    }
}

impl WrappedRow<'_> {
    /// These columns.
    #[inline(always)]
    pub fn part(self, columns: Range<usize>) -> Self {
        Self {
            phase: &self.phase[columns.clone()],
            flags: &self.flags[columns],
        }
    }

    /// Mask: the block's pixels that are not [`WEAK`].
    #[inline(always)]
    pub fn strong<V: Lanes>(&self, v: V, at: usize) -> V::B {
        let weak = v.splat8(WEAK);
        v.eq8(v.and8(v.load8(self.flags, at), weak), v.splat8(0))
    }

    /// The block at `at`.
    #[inline(always)]
    pub fn block<V: Lanes>(&self, v: V, at: usize) -> Demodulated<V> {
        let saturated = v.splat8(SATURATED);
        let flags = v.load8(self.flags, at);
        Demodulated {
            phase: v.load16(self.phase, at),
            strong: self.strong(v, at),
            brightest: v.eq8(v.and8(flags, saturated), saturated),
        }
    }
}

impl WrappedRowMut<'_> {
    /// Of several levels of `pixels` each: the coarsest, if it has arrived before, and level `at`
    /// to be written. `None` if there is no room for level `at`, as for the finest
    /// level, which is never stored.
    pub fn level(
        &mut self,
        at: usize,
        pixels: usize,
    ) -> Option<(Option<WrappedRow<'_>>, WrappedRowMut<'_>)> {
        let (words, phase) = self.phase.split_at_mut_checked(at * pixels)?;
        let (bytes, flags) = self.flags.split_at_mut_checked(at * pixels)?;
        let coarsest = (at > 0).then(|| Wrapped {
            phase: &words[..pixels],
            flags: &bytes[..pixels],
        });
        let level = Wrapped {
            phase: phase.get_mut(..pixels)?,
            flags: flags.get_mut(..pixels)?,
        };
        Some((coarsest, level))
    }

    /// Borrowed to be written.
    pub fn again(&mut self) -> WrappedRowMut<'_> {
        Wrapped {
            phase: self.phase,
            flags: self.flags,
        }
    }

    /// Whether one of these pixels is rejected for a sample at full scale alone.
    pub fn has_saturated(&self, columns: Range<usize>) -> bool {
        self.flags[columns].contains(&SATURATED)
    }

    /// Writes the block at `at`.
    #[inline(always)]
    pub fn store<V: Lanes>(&mut self, v: V, at: usize, block: &Demodulated<V>) {
        v.store16(self.phase, at, block.phase);
        let weak = v.pick8(block.strong, v.splat8(0), v.splat8(WEAK));
        let saturated = v.eq8(block.brightest, v.splat8(u8::MAX));
        let flags = v.or8(weak, v.and8(saturated, v.splat8(SATURATED)));
        v.store8(self.flags, at, flags);
    }

    /// Writes a block that was not decoded: all of it weak.
    #[inline(always)]
    pub fn store_weak<V: Lanes>(&mut self, v: V, at: usize) {
        v.store16(self.phase, at, [v.splat16(0); 2]);
        v.store8(self.flags, at, v.splat8(WEAK));
    }
}
