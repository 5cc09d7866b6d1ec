//! Temporal unwrapping of one block, from the coarsest geometric level to the finest.
//!
//! A block goes back and forth between two states: [`UnwrappedBlock`], absolute up to a level, and
//! [`ExpectedBlock`], what that predicts for the next one. [`crate::phase::unwrap_step`] has the
//! equations; the reasons to reject pixels are collected on the way ([`Quality`]).
//! [`super::geometric`] stores the prediction between two levels.

use super::quality::{Quality, resolved_mask, trust};
use crate::phase::angle::AngleLanes;
use crate::phase::fold::Folded;
use crate::phase::geometric::Geometric;
use crate::phase::level::{Level, LevelLanes, Samples};
use crate::phase::samples::BlockSample;
use crate::phase::source::Frames;
use crate::phase::unwrap_step::{Absolute, ExpectedPhase, UnwrapStep, UnwrapStepLanes};
use crate::simd::{Lanes, Results};
use crate::trust::Trust;
use crate::units::AbsolutePhase;

/// [`Geometric`] with every constant in all lanes, for all blocks of a row.
pub(super) struct GeometricLanes<V: Lanes> {
    pub angle: AngleLanes<V>,
    /// Middle of the coarsest level's turn.
    middle: V::W,
    /// Whole turns of the finest level's origin.
    origin: V::W,
}

impl<V: Lanes> GeometricLanes<V> {
    #[inline(always)]
    pub fn new(v: V, plan: &Geometric) -> Self {
        Self {
            angle: AngleLanes::new(v),
            middle: v.splat16(plan.middle as i16),
            origin: v.splat16((plan.origin >> 16) as i16),
        }
    }

    /// The coarsest level, whose wrapped phases are absolute about the middle of its turn.
    #[inline(always)]
    pub fn coarsest(&self, v: V, phase: [V::W; 2], folded: &Folded<V>) -> UnwrappedBlock<V> {
        UnwrappedBlock {
            phase: [
                Absolute::from_wrapped(v, v.sub(phase[0], self.middle)),
                Absolute::from_wrapped(v, v.sub(phase[1], self.middle)),
            ],
            quality: Quality {
                strong: folded.strong,
                brightest: folded.brightest,
                residual: [v.splat16(0); 2],
            },
        }
    }

    /// Wrapped phases of a level that only gives the fringe order of the next, in rough quality.
    #[inline(always)]
    pub fn rough(&self, v: V, folded: &Folded<V>) -> [V::W; 2] {
        [
            self.angle.rough(v, folded, 0),
            self.angle.rough(v, folded, 1),
        ]
    }

    /// Stores a block at the finest level: absolute phase and modulation of resolved pixels, the
    /// reason of others. `before` are the reasons of coarser levels; the mask `clear` is set where
    /// there is no such reason, or where `unwrapped` has one, too.
    #[inline(always)]
    #[allow(clippy::too_many_arguments)]
    pub fn store(
        &self,
        v: V,
        unwrapped: &UnwrappedBlock<V>,
        clear: V::B,
        before: V::B,
        modulation: [V::W; 2],
        at: usize,
        out: &mut Results<'_>,
    ) {
        let (low, high) = (unwrapped.phase[0].turns, unwrapped.phase[1].turns);
        let order = [
            v.add(low.order, self.origin),
            v.add(high.order, self.origin),
        ];
        if unwrapped.quality.all_resolved(v, clear) {
            // Nearly every block of the part.
            let modulation = [
                v.add(modulation[0], modulation[0]),
                v.add(modulation[1], modulation[1]),
            ];
            let (phases, trust) = (
                [[low.phase, high.phase], order],
                v.splat8(Trust::Resolved as u8),
            );
            out.store_turns(v, at, phases, modulation, trust);
            return;
        }
        let reason = v.min8(before, unwrapped.quality.first_reason(v));
        let resolved = resolved_mask(v, reason);
        // `AbsolutePhase::UNKNOWN` elsewhere.
        let unknown = v.splat16((AbsolutePhase::UNKNOWN.to_bits() >> 16) as i16);
        let phases = [
            [
                v.and(low.phase, resolved[0]),
                v.and(high.phase, resolved[1]),
            ],
            [
                v.pick(resolved[0], order[0], unknown),
                v.pick(resolved[1], order[1], unknown),
            ],
        ];
        let modulation = doubled_where(v, resolved, modulation);
        out.store_turns(v, at, phases, modulation, trust(v, reason));
    }
}

/// A block, unwrapped up to a level.
#[derive(Clone, Copy)]
pub(super) struct UnwrappedBlock<V: Lanes> {
    pub phase: [Absolute<V>; 2],
    pub quality: Quality<V>,
}

impl<V: Lanes> UnwrappedBlock<V> {
    /// What it predicts for the next level.
    #[inline(always)]
    pub fn expected(&self, v: V, step: &UnwrapStepLanes<V>) -> ExpectedBlock<V> {
        ExpectedBlock {
            phase: step.expected(v, self.phase),
            quality: self.quality,
        }
    }
}

/// What a block predicts for the next level.
#[derive(Clone, Copy)]
pub(super) struct ExpectedBlock<V: Lanes> {
    pub phase: [ExpectedPhase<V>; 2],
    pub quality: Quality<V>,
}

/// A level, its frames and the unwrapping step to it.
pub(super) struct FinerLevel<'a, V: Lanes, S> {
    pub level: LevelLanes<'a, V>,
    pub frames: S,
    pub step: UnwrapStepLanes<V>,
}

impl<'a, V: Lanes, S: Frames> FinerLevel<'a, V, S> {
    #[inline(always)]
    pub fn new(v: V, step: &UnwrapStep, level: &'a Level, frames: S) -> Self {
        Self {
            level: LevelLanes::new(v, level),
            frames,
            step: UnwrapStepLanes::new(v, step),
        }
    }

    /// Unwraps a block at this level in rough quality.
    #[inline(always)]
    pub fn rough(
        &self,
        v: V,
        lanes: &GeometricLanes<V>,
        coarser: &ExpectedBlock<V>,
        folded: &Folded<V>,
    ) -> UnwrappedBlock<V> {
        self.unwrap(v, coarser, lanes.rough(v, folded), folded)
    }

    /// Unwraps a block at this level in fine quality, with its modulation.
    #[inline(always)]
    pub fn fine(
        &self,
        v: V,
        lanes: &GeometricLanes<V>,
        coarser: &ExpectedBlock<V>,
        folded: &Folded<V>,
    ) -> (UnwrappedBlock<V>, [V::W; 2]) {
        let (block, modulation) = (self.level).fine(v, &lanes.angle, folded, S::DOUBLED);
        (self.unwrap(v, coarser, block.phase, folded), modulation)
    }

    #[inline(always)]
    fn unwrap(
        &self,
        v: V,
        coarser: &ExpectedBlock<V>,
        phase: [V::W; 2],
        folded: &Folded<V>,
    ) -> UnwrappedBlock<V> {
        let [(low, residual_low), (high, residual_high)] =
            self.step.unwrap_expected(v, coarser.phase, phase);
        let before = coarser.quality;
        let mut quality = before;
        quality.add(v, folded.strong, folded.brightest);
        quality.residual = [
            v.max_unsigned(before.residual[0], residual_low),
            v.max_unsigned(before.residual[1], residual_high),
        ];
        UnwrappedBlock {
            phase: [low, high],
            quality,
        }
    }
}

/// The rows of a level of N shifts of 8 bits that start at 0.
pub(super) fn of_bytes<'r, 'a, T: BlockSample, const N: usize>(
    level: &Level,
    rows: &'r [&'a [T]],
) -> Option<&'r [&'a [u8]; N]> {
    let rows: &[&[T]; N] = rows.try_into().ok()?;
    if level.samples == Samples::Weighted {
        return None;
    }
    T::bytes(rows)
}

/// Twice the words where the mask is set, 0 elsewhere.
#[inline(always)]
pub(super) fn doubled_where<V: Lanes>(v: V, mask: [V::W; 2], x: [V::W; 2]) -> [V::W; 2] {
    [
        v.and(mask[0], v.add(x[0], x[0])),
        v.and(mask[1], v.add(x[1], x[1])),
    ]
}
