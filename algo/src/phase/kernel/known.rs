//! A block of the known map, and the last step of a block: unwrapping about it, and storing the
//! result.

use super::quality::{Quality, resolved_mask, trust};
use super::temporal::doubled_where;
use crate::phase::about::{AboutLanes, BlockLevels};
use crate::phase::unwrap_step::Turns;
use crate::simd::{Lanes, Results};
use crate::trust::Trust;
use crate::units::AbsolutePhase;

/// A block of the known map.
pub(super) struct KnownBlock<V: Lanes> {
    /// Φ₀, 1/65536 turn.
    phase: [[V::D; 2]; 2],
    /// Φ₀ as fringe orders and fractions.
    turns: [Turns<V>; 2],
    /// Mask: Φ₀ is not known.
    pub unknown: V::B,
}

impl<V: Lanes> KnownBlock<V> {
    #[inline(always)]
    pub fn new(v: V, map: &[i32], at: usize) -> Self {
        v.fetch(map, at, V::AHEAD);
        let phase = v.load32(map, at);
        // No known phase has this fringe order.
        let order = v.splat16((AbsolutePhase::UNKNOWN.to_bits() >> 16) as i16);
        let (low, high) = (Turns::split(v, phase[0]), Turns::split(v, phase[1]));
        let unknown = v.narrow_mask([v.eq(low.order, order), v.eq(high.order, order)]);
        Self {
            phase,
            turns: [low, high],
            unknown,
        }
    }

    /// `mask` where Φ₀ is known, 0 elsewhere.
    #[inline(always)]
    pub fn where_known(&self, v: V, mask: V::B) -> V::B {
        v.pick8(self.unknown, v.splat8(0), mask)
    }

    /// The first reasons of a block: [`Trust::Unexpected`], then [`Trust::Dark`], then `reason`.
    #[inline(always)]
    pub fn first_reason(&self, v: V, lit: V::B, reason: V::B) -> V::B {
        let reason = v.pick8(lit, reason, v.splat8(Trust::Dark as u8));
        v.pick8(self.unknown, v.splat8(Trust::Unexpected as u8), reason)
    }
}

/// Unwraps a block about the map and stores it. `lit` is the mask of the coarsest level's
/// modulation, `modulation` is the finest level's.
#[inline(always)]
#[allow(clippy::too_many_arguments)]
pub(super) fn store<V: Lanes>(
    v: V,
    about: &AboutLanes<V>,
    known: &KnownBlock<V>,
    levels: &BlockLevels<V>,
    lit: V::B,
    mut quality: Quality<V>,
    modulation: [V::W; 2],
    at: usize,
    out: &mut Results<'_>,
) {
    let low = about.unwrap(v, known.phase[0], known.turns[0], levels, 0);
    let high = about.unwrap(v, known.phase[1], known.turns[1], levels, 1);
    quality.residual = [low.residual, high.residual];
    if quality.all_resolved(v, quality.strong) {
        let modulation = [
            v.add(modulation[0], modulation[0]),
            v.add(modulation[1], modulation[1]),
        ];
        let resolved = v.splat8(Trust::Resolved as u8);
        out.store(v, at, [low.phase, high.phase], modulation, resolved);
        return;
    }
    let reason = known.first_reason(v, lit, quality.first_reason(v));
    let resolved = resolved_mask(v, reason);
    let unknown = v.splat32(AbsolutePhase::UNKNOWN.to_bits());
    let (masks_low, masks_high) = (
        v.join(resolved[0], resolved[0]),
        v.join(resolved[1], resolved[1]),
    );
    let phase = [
        [
            v.pick32(masks_low[0], low.phase[0], unknown),
            v.pick32(masks_low[1], low.phase[1], unknown),
        ],
        [
            v.pick32(masks_high[0], high.phase[0], unknown),
            v.pick32(masks_high[1], high.phase[1], unknown),
        ],
    ];
    let modulation = doubled_where(v, resolved, modulation);
    out.store(v, at, phase, modulation, trust(v, reason));
}
