//! The plan of coarse-to-fine unwrapping: the turn of the coarsest level, the steps between levels,
//! the scale of the result.
//!
//! The coarsest level spans at most one turn of the pattern, so its wrapped phase is absolute once
//! it is known where that turn begins. Each further level is one [`UnwrapStep`] (Huntley & Saldner
//! 1993). Phases are counted from an origin per level near the middle of its range, so that orders
//! take as few bits as possible.

use super::unwrap_step::UnwrapStep;
use crate::pattern::{Level, PhaseRange, SequenceError};
use crate::units::AbsolutePhase;
use alloc::vec::Vec;

/// Coarse-to-fine levels prepared for unwrapping.
#[derive(Clone, Debug)]
pub(super) struct Geometric {
    /// Middle of the coarsest level's turn, 1/65536 turn of that level.
    pub middle: i32,
    /// From each level to the next finer one.
    pub steps: Vec<UnwrapStep>,
    /// Origin of the finest level's phase, 1/65536 turn.
    pub origin: i32,
    /// 1 / ratio of the finest level, Q20, where that is not 1.
    pub scale: Option<i64>,
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
