//! Unwrapping from coarse to fine.

use super::unwrap_step::Step;
use crate::pattern::{Level, PhaseRange, SequenceError};
use crate::units::AbsolutePhase;
use alloc::vec::Vec;

/// Coarse-to-fine levels prepared for unwrapping.
#[derive(Clone, Debug)]
pub(super) struct Geometric {
    /// The middle of the turn that the coarsest level can have, 1/65536 turn of that level.
    pub middle: i32,
    /// From each level to the next finer one.
    pub steps: Vec<Step>,
    /// What the finest level's phase counts from, 1/65536 turn.
    pub origin: i32,
    /// 1 / ratio of the finest level, Q20, where that is not 1.
    pub scale: Option<i64>,
}

impl Geometric {
    pub fn new(levels: &[Level], range: PhaseRange) -> Result<Self, SequenceError> {
        let coarsest = levels[0].ratio;
        // What the coarsest level leaves free of its turn is noise margin on both sides.
        let margin = (1.0 - coarsest * range.span()).max(0.0) / 2.0;
        let middle = libm::rint((coarsest * range.min - margin + 0.5) * 65_536.0);
        // Φ of a level = origin + what is found, which is at most `reach` turns either way.
        let mut origin = middle / 65_536.0;
        let mut reach = 0.5;
        let mut steps = Vec::new();
        for pair in levels.windows(2) {
            let n = pair[1].ratio / pair[0].ratio;
            let next = libm::rint(n * origin);
            let step = Step::new(n, reach, n * origin - next).ok_or(SequenceError::Step {
                from: pair[0].ratio,
                to: pair[1].ratio,
            })?;
            steps.push(step);
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

    /// What few sequences need: an origin between two orders (of a single level), a finest ratio that is not 1.
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
