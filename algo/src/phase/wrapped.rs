//! A level that has been demodulated while the next was still being exposed: wrapped phase, modulation and doubts.

use super::level::Demodulated;
use crate::simd::Lanes;
use alloc::vec;
use alloc::vec::Vec;

/// One demodulated level of a whole frame, row-major.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Wrapped {
    /// Pixels per row.
    pub(crate) width: usize,
    /// φ in 1/65536 turn.
    pub(crate) phase: Vec<u16>,
    /// Modulation in units of full scale / 32767.5; 0 where weak.
    pub(crate) modulation: Vec<u16>,
    /// [`WEAK`] and [`SATURATED`].
    pub(crate) doubts: Vec<u8>,
}

/// The modulation is below the trusted minimum.
const WEAK: u8 = 1;
/// A sample is at full scale, where that matters.
const SATURATED: u8 = 2;

impl Wrapped {
    /// Room for a level of frames of this size; every pixel is weak.
    pub fn new(width: usize, height: usize) -> Self {
        let pixels = width * height;
        Self {
            width,
            phase: vec![0; pixels],
            modulation: vec![0; pixels],
            doubts: vec![WEAK; pixels],
        }
    }

    /// Row `v`.
    pub(crate) fn row(&self, v: usize) -> WrappedRow<'_> {
        let row = v * self.width..(v + 1) * self.width;
        WrappedRow {
            phase: &self.phase[row.clone()],
            modulation: &self.modulation[row.clone()],
            doubts: &self.doubts[row],
        }
    }

    /// Every row, to be written.
    pub(crate) fn rows(&mut self) -> Vec<WrappedRowMut<'_>> {
        let width = self.width.max(1);
        self.phase
            .chunks_mut(width)
            .zip(self.modulation.chunks_mut(width))
            .zip(self.doubts.chunks_mut(width))
            .map(|((phase, modulation), doubts)| WrappedRowMut {
                phase,
                modulation,
                doubts,
            })
            .collect()
    }
}

/// A row of a demodulated level.
#[derive(Clone, Copy, Debug)]
pub(crate) struct WrappedRow<'a> {
    pub phase: &'a [u16],
    pub modulation: &'a [u16],
    pub doubts: &'a [u8],
}

/// A row of a demodulated level, to be written.
#[derive(Debug)]
pub(crate) struct WrappedRowMut<'a> {
    pub phase: &'a mut [u16],
    pub modulation: &'a mut [u16],
    pub doubts: &'a mut [u8],
}

impl WrappedRow<'_> {
    /// Mask: the block's pixels that are not weak.
    #[inline(always)]
    pub fn strong<V: Lanes>(&self, v: V, at: usize) -> V::B {
        let weak = v.splat8(WEAK);
        v.eq8(v.and8(v.load8(self.doubts, at), weak), v.splat8(0))
    }

    #[inline(always)]
    pub fn block<V: Lanes>(&self, v: V, at: usize) -> Demodulated<V> {
        let saturated = v.splat8(SATURATED);
        let doubts = v.load8(self.doubts, at);
        Demodulated {
            phase: v.load16(self.phase, at),
            modulation: v.load16(self.modulation, at),
            strong: self.strong(v, at),
            brightest: v.eq8(v.and8(doubts, saturated), saturated),
        }
    }
}

impl WrappedRowMut<'_> {
    #[inline(always)]
    pub fn store<V: Lanes>(&mut self, v: V, at: usize, block: &Demodulated<V>) {
        let strong = v.widen(block.strong, block.strong);
        v.store16(self.phase, at, block.phase);
        v.store16(
            self.modulation,
            at,
            [
                v.and(strong[0], block.modulation[0]),
                v.and(strong[1], block.modulation[1]),
            ],
        );
        let weak = v.pick8(block.strong, v.splat8(0), v.splat8(WEAK));
        let saturated = v.eq8(block.brightest, v.splat8(u8::MAX));
        let doubts = v.or8(weak, v.and8(saturated, v.splat8(SATURATED)));
        v.store8(self.doubts, at, doubts);
    }

    /// A block of which nothing is known but that it is weak.
    #[inline(always)]
    pub fn store_weak<V: Lanes>(&mut self, v: V, at: usize) {
        let zero = v.splat16(0);
        v.store16(self.phase, at, [zero; 2]);
        v.store16(self.modulation, at, [zero; 2]);
        v.store8(self.doubts, at, v.splat8(WEAK));
    }
}
