//! Which pixels of a block are resolved, and the first reason why not.
//!
//! Reasons are bytes: the numbers of [`Trust`], or [`NO_REASON`], which is larger than all of them.
//! So the smaller of two bytes is the reason that comes first, and levels are combined by a
//! minimum.

use super::arrived::NO_REASON;
use crate::simd::Lanes;
use crate::trust::{MAX_RESIDUAL, Trust};

/// [`MAX_RESIDUAL`] in 1/65536 turn.
const MAX_RESIDUAL_BITS: i16 = (MAX_RESIDUAL * 65_536.0) as i16;

/// What decides about the pixels of a block.
#[derive(Clone, Copy)]
pub(super) struct Quality<V: Lanes> {
    /// Mask: every level has at least the trusted modulation.
    pub strong: V::B,
    /// 255 where a sample is at full scale and the phase was not found without it.
    pub brightest: V::B,
    /// The largest residual, unsigned, 1/65536 turn.
    pub residual: [V::W; 2],
}

impl<V: Lanes> Quality<V> {
    /// The state before any level, for pixels where this mask is set.
    #[inline(always)]
    pub fn new(v: V, strong: V::B) -> Self {
        Self {
            strong,
            brightest: v.splat8(0),
            residual: [v.splat16(0); 2],
        }
    }

    /// Adds modulation and saturation of a level.
    #[inline(always)]
    pub fn add(&mut self, v: V, strong: V::B, brightest: V::B) {
        self.strong = v.and8(self.strong, strong);
        self.brightest = v.max8(self.brightest, brightest);
    }

    /// The first reason against each pixel. [`Trust::Dark`] is not
    /// distinguished from [`Trust::LowModulation`].
    #[inline(always)]
    pub fn first_reason(&self, v: V) -> V::B {
        let residual = v.splat8(Trust::Residual as u8);
        let first = v.pick8(self.ambiguous(v), residual, v.splat8(NO_REASON));
        let first = v.pick8(self.saturated(v), v.splat8(Trust::Saturated as u8), first);
        v.pick8(self.strong, first, v.splat8(Trust::LowModulation as u8))
    }

    /// Whether all pixels of the block are resolved: no reason here, and the mask `clear` is set.
    #[inline(always)]
    pub fn all_resolved(&self, v: V, clear: V::B) -> bool {
        // All pixels of the block are decided together, so the halves may be merged.
        let residual = v.max_unsigned(self.residual[0], self.residual[1]);
        let ambiguous = v.excess(residual, v.splat16(MAX_RESIDUAL_BITS));
        // 255 less the brightest sample is 0 where that is at full scale.
        let good = v.excess8(v.and8(self.strong, clear), self.brightest);
        v.none8(v.or8(v.bytes_of(ambiguous), v.eq8(good, v.splat8(0))))
    }

    /// Mask: the residual is too large for the fringe order to be trusted.
    #[inline(always)]
    fn ambiguous(&self, v: V) -> V::B {
        v.narrow_mask([
            too_large(v, self.residual[0]),
            too_large(v, self.residual[1]),
        ])
    }

    #[inline(always)]
    fn saturated(&self, v: V) -> V::B {
        v.eq8(self.brightest, v.splat8(u8::MAX))
    }
}

/// Mask: a residual's magnitude (unsigned, 1/65536 turn) is above the limit.
#[inline(always)]
fn too_large<V: Lanes>(v: V, residual: V::W) -> V::W {
    // With the sign bit inverted, signed comparison orders unsigned words.
    let sign = v.splat16(i16::MIN);
    v.gt(
        v.xor(residual, sign),
        v.splat16(MAX_RESIDUAL_BITS ^ i16::MIN),
    )
}

/// Reasons of a block by the mask of lit pixels: [`NO_REASON`] or [`Trust::Dark`].
#[inline(always)]
pub(super) fn dark_unless<V: Lanes>(v: V, lit: V::B) -> V::B {
    v.max8(lit, v.splat8(Trust::Dark as u8))
}

/// Masks of words: there is no reason against the pixel.
#[inline(always)]
pub(super) fn resolved_mask<V: Lanes>(v: V, reason: V::B) -> [V::W; 2] {
    let none = v.eq8(reason, v.splat8(NO_REASON));
    v.widen(none, none)
}

/// Reasons as numbers of [`Trust`].
#[inline(always)]
pub(super) fn trust<V: Lanes>(v: V, reason: V::B) -> V::B {
    // `NO_REASON` becomes 0, which is `Resolved`; every other number stays.
    v.xor8(reason, v.eq8(reason, v.splat8(NO_REASON)))
}

/// Twice the modulation of a block, which is in units of full scale / 32767.5 until it is stored
/// ([`super::level`]).
#[inline(always)]
pub(super) fn doubled<V: Lanes>(v: V, modulation: [V::W; 2]) -> [V::W; 2] {
    [
        v.add(modulation[0], modulation[0]),
        v.add(modulation[1], modulation[1]),
    ]
}

/// [`doubled`] where the mask is set, 0 elsewhere.
#[inline(always)]
pub(super) fn doubled_where<V: Lanes>(v: V, mask: [V::W; 2], modulation: [V::W; 2]) -> [V::W; 2] {
    let modulation = doubled(v, modulation);
    [v.and(mask[0], modulation[0]), v.and(mask[1], modulation[1])]
}
