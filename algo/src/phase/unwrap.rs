//! What both ways of unwrapping share: the choice between them, the limit of residuals, and the
//! information in a sequence.

use super::about::About;
use super::geometric::Geometric;
use crate::pattern::{PhaseRange, Sequence, SequenceError, Unwrapping};
use crate::simd::Lanes;

/// Largest rounding residual of an unwrapping step, in turns.
pub(super) const MAX_RESIDUAL: f64 = 0.40;
/// Largest rounding residual of an unwrapping step, in 1/65536 turn.
pub(super) const MAX_RESIDUAL_BITS: i16 = (MAX_RESIDUAL * 65_536.0) as i16;

/// How the levels of a pixel become one absolute phase; prepared once per plan.
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

/// Σ N_i r_i² (b_i/b_f)² over the levels that carry the result's accuracy: of geometric levels only
/// the finest, because the coarser ones only give fringe orders; of dense levels all, because they
/// are averaged. b_i/b_f is the fundamental of a level's waveform over that of the finest level,
/// whose modulation is known.
pub(super) fn information(unwrapping: Unwrapping, sequence: &Sequence) -> f64 {
    let levels = sequence.levels();
    let accurate = match unwrapping {
        Unwrapping::Geometric => &levels[levels.len() - 1..],
        Unwrapping::DenseThree { .. } | Unwrapping::DenseTwo { .. } | Unwrapping::Single => levels,
    };
    let finest = levels[levels.len() - 1].waveform.fundamental();
    accurate
        .iter()
        .map(|level| {
            let share = level.waveform.fundamental() / finest;
            level.shifts() as f64 * level.ratio * level.ratio * share * share
        })
        .sum()
}

/// Mask: a residual's magnitude (unsigned, 1/65536 turn) is above the limit.
#[inline(always)]
pub(super) fn too_large<V: Lanes>(v: V, residual: V::W) -> V::W {
    // With the sign bit inverted, signed comparison orders unsigned words.
    let turn = v.splat16(i16::MIN);
    v.gt(
        v.xor(residual, turn),
        v.splat16(MAX_RESIDUAL_BITS ^ i16::MIN),
    )
}
