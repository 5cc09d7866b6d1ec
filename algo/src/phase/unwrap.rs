//! What both ways of unwrapping share: when a step is trusted, and what a plan says of its accuracy.

use super::about::About;
use super::geometric::Geometric;
use crate::pattern::{PhaseRange, Sequence, SequenceError, Unwrapping};
use crate::simd::Lanes;

/// Largest rounding residual of an unwrapping step, in turns.
pub(super) const MAX_RESIDUAL: f64 = 0.40;
/// The same in 1/65536 turn.
pub(super) const MAX_RESIDUAL_BITS: i16 = (MAX_RESIDUAL * 65_536.0) as i16;

/// How to combine the levels of a pixel; prepared once per plan.
#[derive(Clone, Debug)]
pub(super) enum Unwrapper {
    /// From coarse to fine.
    Geometric(Geometric),
    /// About a known map.
    About(About),
}

impl Unwrapper {
    pub fn new(
        unwrapping: Unwrapping,
        sequence: &Sequence,
        range: PhaseRange,
    ) -> Result<Self, SequenceError> {
        let levels = sequence.levels();
        Ok(match unwrapping {
            Unwrapping::Geometric => Self::Geometric(Geometric::new(levels, range)?),
            _ => Self::About(About::new(unwrapping, levels).ok_or_else(|| {
                SequenceError::Ratios(levels.iter().map(|level| level.ratio).collect())
            })?),
        })
    }
}

/// Σ N_i r_i² over the levels whose noise is the result's noise: coarser geometric levels only give the fringe order,
/// dense ones are averaged.
pub(super) fn information(unwrapping: Unwrapping, sequence: &Sequence) -> f64 {
    let levels = sequence.levels();
    let accurate = match unwrapping {
        Unwrapping::Geometric => &levels[levels.len() - 1..],
        _ => levels,
    };
    accurate
        .iter()
        .map(|level| level.steps() as f64 * level.ratio * level.ratio)
        .sum()
}

/// |x| of a residual in 1/65536 turn, unsigned.
#[inline(always)]
pub(super) fn farness<V: Lanes>(v: V, x: V::W) -> V::W {
    v.abs(x)
}

/// Mask: a residual of this farness is too large.
#[inline(always)]
pub(super) fn too_far<V: Lanes>(v: V, farness: V::W) -> V::W {
    // With the sign bit turned the order of unsigned words is that of signed ones.
    let turn = v.splat16(i16::MIN);
    v.gt(
        v.xor(farness, turn),
        v.splat16(MAX_RESIDUAL_BITS ^ i16::MIN),
    )
}
