//! Rows of samples that are read block by block, with one bounds check for several rows, and rows
//! of results that blocks are stored to.

use super::Lanes;
use crate::trust::Trust;
use crate::units::{AbsolutePhase, Modulation};
use core::ops::Range;

/// Phases as their bits.
pub(crate) fn phase_bits(phases: &[AbsolutePhase]) -> &[i32] {
    // SAFETY: `AbsolutePhase` is a transparent wrapper of `i32`.
    unsafe { core::slice::from_raw_parts(phases.as_ptr().cast(), phases.len()) }
}

/// Phases as their bits.
fn phase_bits_mut(phases: &mut [AbsolutePhase]) -> &mut [i32] {
    // SAFETY: `AbsolutePhase` is a transparent wrapper of `i32`, and every `i32` is one.
    unsafe { core::slice::from_raw_parts_mut(phases.as_mut_ptr().cast(), phases.len()) }
}

/// Modulations as their bits.
fn modulation_bits_mut(modulations: &mut [Modulation]) -> &mut [u16] {
    // SAFETY: `Modulation` is a transparent wrapper of `u16`, and every `u16` is one.
    unsafe { core::slice::from_raw_parts_mut(modulations.as_mut_ptr().cast(), modulations.len()) }
}

/// Any number of rows that are read up to one length.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rows<'a, T> {
    rows: &'a [&'a [T]],
    /// No row is shorter.
    length: usize,
}

impl<'a, T> Rows<'a, T> {
    /// Rows that are read up to `length`.
    ///
    /// # Panics
    /// If a row ends before.
    pub fn new(rows: &'a [&'a [T]], length: usize) -> Self {
        for row in rows {
            assert!(row.len() >= length);
        }
        Self { rows, length }
    }

    /// The first columns.
    ///
    /// # Panics
    /// If there are fewer.
    pub fn part(self, length: usize) -> Self {
        assert!(length <= self.length);
        Self { length, ..self }
    }

    /// How many rows.
    #[inline(always)]
    pub fn count(&self) -> usize {
        self.rows.len()
    }

    /// The N rows.
    ///
    /// # Panics
    /// If there are fewer.
    #[inline(always)]
    pub fn all<const N: usize>(&self) -> [&'a [T]; N] {
        let mut rows = [self.row(0); N];
        let mut k = 1;
        while k < N {
            rows[k] = self.row(k);
            k += 1;
        }
        rows
    }

    /// Row `at`. All have the same length, so that the compiler merges the checks of their blocks.
    ///
    /// # Panics
    /// If there are fewer rows.
    #[inline(always)]
    pub fn row(&self, at: usize) -> &'a [T] {
        // SAFETY: every row holds at least `length` samples, asserted by `new` and `part`.
        unsafe { self.rows[at].get_unchecked(..self.length) }
    }
}

/// The block of `pixels` at `at`.
///
/// # Panics
/// If it does not end within the row.
#[inline(always)]
pub(super) fn block<T>(row: &[T], at: usize, pixels: usize) -> &[T] {
    assert_fits(at, pixels, row.len());
    // SAFETY: the block ends within the row, asserted above.
    unsafe { row.get_unchecked(at..at + pixels) }
}

/// As [`block`], to be written.
#[inline(always)]
pub(super) fn block_mut<T>(row: &mut [T], at: usize, pixels: usize) -> &mut [T] {
    assert_fits(at, pixels, row.len());
    // SAFETY: the block ends within the row, asserted above.
    unsafe { row.get_unchecked_mut(at..at + pixels) }
}

/// Asserts that a block of `pixels` at `at` ends within `length`. Always in this form, so that the
/// compiler merges the checks of all rows of one length.
#[inline(always)]
fn assert_fits(at: usize, pixels: usize, length: usize) {
    assert!(length >= pixels && at <= length - pixels);
}

/// Phase, modulation and trust of a row as plain numbers, of equal length.
pub(crate) struct Results<'a> {
    /// Φ, 1/65536 turn.
    pub phase: &'a mut [i32],
    modulation: &'a mut [u16],
    trust: &'a mut [Trust],
    /// Whether a pixel is rejected for a sample at full scale.
    saturated: &'a mut bool,
}

impl<'a> Results<'a> {
    /// Whether one of these pixels is rejected for a sample at full scale.
    pub fn has_saturated(&self, columns: Range<usize>) -> bool {
        *self.saturated && self.trust[columns].contains(&Trust::Saturated)
    }

    /// Notes whether a pixel of a block is rejected for a sample at full scale.
    #[inline(always)]
    pub fn note_saturated<V: Lanes>(&mut self, v: V, trust: V::B) {
        let saturated = v.eq8(trust, v.splat8(Trust::Saturated as u8));
        *self.saturated |= !v.none8(saturated);
    }

    /// The first `length` of a row.
    ///
    /// # Panics
    /// If the row ends before.
    pub fn new(
        phase: &'a mut [AbsolutePhase],
        modulation: &'a mut [Modulation],
        trust: &'a mut [Trust],
        saturated: &'a mut bool,
        length: usize,
    ) -> Self {
        Self {
            phase: &mut phase_bits_mut(phase)[..length],
            modulation: &mut modulation_bits_mut(modulation)[..length],
            trust: &mut trust[..length],
            saturated,
        }
    }

    /// The first `length` of a row.
    #[inline(always)]
    pub fn first(&mut self, length: usize) -> Results<'_> {
        Results {
            phase: &mut self.phase[..length],
            modulation: &mut self.modulation[..length],
            trust: &mut self.trust[..length],
            saturated: self.saturated,
        }
    }

    /// Stores a block. A byte above the largest number of [`Trust`] is stored as that number.
    #[inline(always)]
    pub fn store<V: Lanes>(
        &mut self,
        v: V,
        at: usize,
        phase: [[V::D; 2]; 2],
        modulation: [V::W; 2],
        trust: V::B,
    ) {
        v.claim_ahead(self.phase, at);
        v.store32(self.phase, at, phase);
        self.store_others(v, at, modulation, trust);
    }

    /// Stores a block, given by the fractions and the fringe orders of the phases.
    #[inline(always)]
    pub fn store_turns<V: Lanes>(
        &mut self,
        v: V,
        at: usize,
        [fraction, order]: [[V::W; 2]; 2],
        modulation: [V::W; 2],
        trust: V::B,
    ) {
        v.claim_ahead(self.phase, at);
        v.store32_joined(self.phase, at, fraction, order);
        self.store_others(v, at, modulation, trust);
    }

    #[inline(always)]
    fn store_others<V: Lanes>(&mut self, v: V, at: usize, modulation: [V::W; 2], trust: V::B) {
        v.claim_ahead(self.modulation, at);
        v.claim_ahead(self.trust, at);
        v.store16(self.modulation, at, modulation);
        // SAFETY: `Trust` is one byte with the numbers 0 to `LAST`, and no byte above `LAST` is
        // stored.
        let bytes = unsafe {
            core::slice::from_raw_parts_mut(self.trust.as_mut_ptr().cast(), self.trust.len())
        };
        v.store8(bytes, at, v.min8(trust, v.splat8(Trust::LAST)));
    }

    /// Stores a block without any phase; `reason` says why.
    #[inline(always)]
    pub fn store_unknown<V: Lanes>(&mut self, v: V, at: usize, reason: V::B) {
        let unknown = v.splat32(AbsolutePhase::UNKNOWN.to_bits());
        let none = v.splat16(0);
        self.store(v, at, [[unknown; 2]; 2], [none; 2], reason);
    }
}
