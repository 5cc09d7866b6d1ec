//! A row of results that blocks are stored to: phase, modulation and trust.

use super::Lanes;
use super::plain;
use crate::trust::Trust;
use crate::units::{AbsolutePhase, Modulation};
use core::ops::Range;

/// Phase, modulation and trust of a row as plain numbers, of equal length.
pub(crate) struct Results<'a> {
    /// Φ, 1/65536 turn.
    pub phase: &'a mut [i32],
    modulation: &'a mut [u16],
    trust: &'a mut [Trust],
}

impl<'a> Results<'a> {
    /// The first `length` of a row.
    ///
    /// # Panics
    /// If the row ends before.
    pub fn new(
        phase: &'a mut [AbsolutePhase],
        modulation: &'a mut [Modulation],
        trust: &'a mut [Trust],
        length: usize,
    ) -> Self {
        Self {
            phase: &mut plain::phase_bits_mut(phase)[..length],
            modulation: &mut plain::modulation_bits_mut(modulation)[..length],
            trust: &mut trust[..length],
        }
    }

    /// The first `length` of a row.
    #[inline(always)]
    pub fn first(&mut self, length: usize) -> Results<'_> {
        self.part(&(0..length))
    }

    /// Columns of the row.
    #[inline(always)]
    pub fn part(&mut self, columns: &Range<usize>) -> Results<'_> {
        Results {
            phase: &mut self.phase[columns.clone()],
            modulation: &mut self.modulation[columns.clone()],
            trust: &mut self.trust[columns.clone()],
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
