//! Coarse-to-fine unwrapping: its plan (the turn of the coarsest level, the steps between levels,
//! the scale of the result), and what it does with a block of pixels.
//!
//! The coarsest level spans at most one turn of the pattern, so its wrapped phase is absolute once
//! it is known where that turn begins. Each further level is one [`UnwrapStep`] (Huntley & Saldner
//! 1993). Phases are counted from an origin per level near the middle of its range, so that orders
//! take as few bits as possible.
//!
//! The kernel ([`super::kernel::geometric`]) keeps what a level predicts for the next one until
//! that has arrived.

use super::fold::{AngleLanes, Folded};
use super::quality::{Quality, doubled, doubled_where, resolved_mask, trust};
use super::unwrap_step::{Absolute, PredictedPhase, UnwrapStep, UnwrapStepLanes};
use crate::pattern::{Level, PhaseRange, SequenceError};
use crate::simd::{Lanes, Results};
use crate::trust::Trust;
use crate::units::AbsolutePhase;
use alloc::vec::Vec;

/// The plan of geometric levels.
#[derive(Clone, Debug)]
pub(super) struct Geometric {
    /// Middle of the coarsest level's turn, 1/65536 turn of that level.
    middle: i32,
    /// From each level to the next finer one.
    pub steps: Vec<UnwrapStep>,
    /// Origin of the finest level's phase, 1/65536 turn.
    origin: i32,
    /// 1 / ratio of the finest level, Q20, where that is not 1.
    scale: Option<i64>,
}

impl Geometric {
    pub fn new(levels: &[Level], range: PhaseRange) -> Result<Self, SequenceError> {
        let coarsest = levels[0].ratio;
        // The part of a turn that the coarsest level does not use is margin for noise, half on each
        // side.
        let margin = (1.0 - coarsest * range.span()).max(0.0) / 2.0;
        let middle = libm::rint((coarsest * range.min - margin + 0.5) * 65_536.0);
        // A level's phase lies within ± `reach` turns of its origin.
        let mut origin = middle / 65_536.0;
        let mut reach = 0.5;
        let mut steps = Vec::new();
        for pair in levels.windows(2) {
            let n = pair[1].ratio / pair[0].ratio;
            let next = libm::rint(n * origin);
            let step = UnwrapStep::new(n, reach, n * origin - next, steps.last());
            steps.push(step.ok_or(SequenceError::Step {
                from: pair[0].ratio,
                to: pair[1].ratio,
            })?);
            reach = n * reach + 1.0;
            origin = next;
        }
        let finest = levels[levels.len() - 1].ratio;
        let whole = libm::fabs(finest - 1.0) < 1e-12;
        Ok(Self {
            middle: middle as i32,
            steps,
            origin: libm::rint(origin * 65_536.0) as i32,
            scale: (!whole).then(|| libm::rint(f64::from(1_u32 << 20) / finest) as i64),
        })
    }

    /// Adds the origin's fraction and divides by the finest level's ratio, for the few sequences
    /// that need it: a single level (its origin lies between two orders), or a finest ratio other
    /// than 1.
    pub fn finish(&self, phases: &mut [i32]) {
        let part = self.origin & 0xFFFF;
        if part == 0 && self.scale.is_none() {
            return;
        }
        for phase in phases {
            if *phase != AbsolutePhase::UNKNOWN.to_bits() {
                let whole = i64::from(*phase) + i64::from(part);
                let scaled = self
                    .scale
                    .map_or(whole, |scale| (whole * scale + (1 << 19)) >> 20);
                *phase = AbsolutePhase::saturate(scaled).to_bits();
            }
        }
    }
}

/// [`Geometric`] with every constant in all lanes.
pub(super) struct GeometricLanes<V: Lanes> {
    pub angle: AngleLanes<V>,
    /// Middle of the coarsest level's turn.
    middle: V::W,
    /// Whole turns of the finest level's origin.
    origin: V::W,
}

/// A block, unwrapped up to a level, and what this level says about its pixels.
#[derive(Clone, Copy)]
pub(super) struct UnwrappedBlock<V: Lanes> {
    pub phase: [Absolute<V>; 2],
    pub quality: Quality<V>,
}

impl<V: Lanes> UnwrappedBlock<V> {
    /// What it predicts for the next level.
    #[inline(always)]
    pub fn predicted(&self, v: V, next: &UnwrapStepLanes<V>) -> [PredictedPhase<V>; 2] {
        [
            next.predicted(v, self.phase[0]),
            next.predicted(v, self.phase[1]),
        ]
    }
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

    /// Wrapped phases of a level that only gives the fringe order of the next, in rough quality.
    #[inline(always)]
    pub fn rough(&self, v: V, folded: &Folded<V>) -> [V::W; 2] {
        [
            self.angle.rough(v, folded, 0),
            self.angle.rough(v, folded, 1),
        ]
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

    /// A finer level, whose wrapped phases get their fringe orders from the phases that the level
    /// before predicts.
    #[inline(always)]
    pub fn finer(
        &self,
        v: V,
        step: &UnwrapStepLanes<V>,
        predicted: [PredictedPhase<V>; 2],
        phase: [V::W; 2],
        folded: &Folded<V>,
    ) -> UnwrappedBlock<V> {
        let (low, residual_low) = step.unwrap_predicted(v, predicted[0], phase[0]);
        let (high, residual_high) = step.unwrap_predicted(v, predicted[1], phase[1]);
        UnwrappedBlock {
            phase: [low, high],
            quality: Quality {
                strong: folded.strong,
                brightest: folded.brightest,
                residual: [residual_low, residual_high],
            },
        }
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
            let phases = [[low.phase, high.phase], order];
            let resolved = v.splat8(Trust::Resolved as u8);
            out.store_turns(v, at, phases, doubled(v, modulation), resolved);
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
        let trust = trust(v, reason);
        out.note_saturated(v, trust);
        out.store_turns(v, at, phases, modulation, trust);
    }
}
