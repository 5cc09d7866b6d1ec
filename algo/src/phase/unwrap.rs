//! Temporal unwrapping: the wrapped phases of all levels of a pixel → its absolute phase.
//!
//! *Geometric* levels, coarse to fine: k = round(n·Φ_coarse − φ), Φ = k + φ with n the real ratio
//! between two levels. *Dense* levels, relative to a known map Φ₀: q_i = φ_i − frac(r_i Φ₀); the slow
//! beat a = q₁ − q₂ = D/n² unwraps the fast one b = q₁ − q₃ = D/n, which unwraps each level; the D_i
//! are averaged with weights N_i r_i² B_i². Integer: phases in 1/65536 turn (i64), factors in Q20.

use super::demodulate::LevelPixel;
use crate::pattern::{Level, PhaseRange, Sequence, Unwrapping};
use crate::units::{AbsolutePhase, Modulation};
use alloc::vec::Vec;

/// Largest rounding residual of an unwrapping step, in turns.
pub(super) const MAX_RESIDUAL: f64 = 0.40;

/// Fractional bits of factors (ratios, n).
const FACTOR_BITS: u32 = 20;
/// Fractional bits of a product of a phase (16) and a factor.
const PRODUCT_BITS: u32 = 16 + FACTOR_BITS;
/// [`MAX_RESIDUAL`] at [`PRODUCT_BITS`].
const MAX_RESIDUAL_BITS: i64 = (MAX_RESIDUAL * (1_u64 << PRODUCT_BITS) as f64) as i64;
/// Fractional bits of r in r·Φ₀: the map may hold 32,768 turns, and r·Φ₀ is needed to 1/65536.
const RATIO_BITS: u32 = 31;

/// A factor in Q20.
fn factor(x: f64) -> i64 {
    libm::rint(x * f64::from(1_u32 << FACTOR_BITS)) as i64
}

/// Rounds a number with `bits` fractional bits to nearest.
#[inline(always)]
fn round(x: i64, bits: u32) -> i64 {
    (x + (1 << (bits - 1))) >> bits
}

/// How to combine the levels of one pixel; prepared once per plan.
#[derive(Clone, Debug)]
pub(super) struct Unwrapper {
    form: Form,
    /// Σ N_i r_i² over the levels whose noise is the result's noise.
    information: f64,
}

#[derive(Clone, Debug)]
enum Form {
    Geometric {
        /// Lowest phase that the coarsest level can have, 1/65536 turn of that level.
        base: i64,
        /// n of each step from a level to the next finer one, Q20.
        steps: Vec<i64>,
        /// 1 / ratio of the finest level, Q20.
        scale: i64,
    },
    About {
        /// The beats that lead to D, for more than one level.
        beat: Option<Beat>,
        /// The levels in the order in which they are averaged.
        levels: Vec<DenseLevel>,
    },
}

#[derive(Clone, Copy, Debug)]
struct Beat {
    /// n, Q20.
    n: i64,
    /// Whether a level 1 − 1/n² unwraps the fast beat.
    slow: bool,
}

#[derive(Clone, Copy, Debug)]
struct DenseLevel {
    /// Place among the levels from coarse to fine.
    at: usize,
    /// r in Q31 and Q20, 1/r in Q20.
    ratio: i64,
    ratio_factor: i64,
    inverse: i64,
    /// N r², Q8.
    weight: u64,
}

/// A pixel whose phase is known.
pub(super) struct Unwrapped {
    pub phase: AbsolutePhase,
    /// Effective modulation: B with Σ N_i r_i² B_i² = (Σ N_i r_i²) · B².
    pub modulation: Modulation,
}

impl Unwrapper {
    pub fn new(unwrapping: Unwrapping, sequence: &Sequence, range: PhaseRange) -> Self {
        let levels = sequence.levels();
        let finest = &levels[levels.len() - 1];
        let form = match unwrapping {
            Unwrapping::Geometric => {
                let coarsest = levels[0].ratio;
                // What the coarsest level leaves free of its turn is noise margin on both sides.
                let margin = (1.0 - coarsest * range.span()).max(0.0) / 2.0;
                let base = coarsest * range.min - margin;
                Form::Geometric {
                    base: libm::rint(base * 65_536.0) as i64,
                    steps: levels
                        .windows(2)
                        .map(|pair| factor(pair[1].ratio / pair[0].ratio))
                        .collect(),
                    scale: factor(1.0 / finest.ratio),
                }
            }
            Unwrapping::DenseThree { n } => Form::About {
                beat: Some(Beat {
                    n: factor(n),
                    slow: true,
                }),
                // Ratio 1 first, then the coarsest, then the one that is almost 1.
                levels: [2, 0, 1].map(|at| DenseLevel::new(at, &levels[at])).into(),
            },
            Unwrapping::DenseTwo { n } => Form::About {
                beat: Some(Beat {
                    n: factor(n),
                    slow: false,
                }),
                levels: [1, 0].map(|at| DenseLevel::new(at, &levels[at])).into(),
            },
            Unwrapping::Single => Form::About {
                beat: None,
                levels: [DenseLevel::new(0, &levels[0])].into(),
            },
        };
        // Coarser geometric levels only give the fringe order; dense ones are averaged.
        let accurate = if unwrapping.needs_map() {
            levels
        } else {
            core::slice::from_ref(finest)
        };
        let weight = |level: &Level| level.steps() as f64 * level.ratio * level.ratio;
        Self {
            form,
            information: accurate.iter().map(weight).sum(),
        }
    }

    /// Σ N_i r_i² over the levels that carry the result's accuracy.
    pub fn information(&self) -> f64 {
        self.information
    }

    /// The absolute phase of a pixel from its levels, coarse to fine, and the map there; `None`
    /// where a rounding step leaves too much over or the map does not know.
    #[inline]
    pub fn pixel(&self, levels: &[LevelPixel], map: AbsolutePhase) -> Option<Unwrapped> {
        match &self.form {
            Form::Geometric { base, steps, scale } => geometric(levels, *base, steps, *scale),
            Form::About {
                beat,
                levels: dense,
            } => about(levels, *beat, dense, map),
        }
    }
}

impl DenseLevel {
    fn new(at: usize, level: &Level) -> Self {
        let ratio = level.ratio;
        Self {
            at,
            ratio: libm::rint(ratio * f64::from(1_u32 << RATIO_BITS)) as i64,
            ratio_factor: factor(ratio),
            inverse: factor(1.0 / ratio),
            weight: libm::rint(level.steps() as f64 * ratio * ratio * 256.0).max(1.0) as u64,
        }
    }

    /// N r² B², with B at 12 bits: 14 + 24 bits.
    #[inline(always)]
    fn weight_of(&self, pixel: &LevelPixel) -> u64 {
        let modulation = u64::from(pixel.modulation >> 4);
        self.weight * modulation * modulation
    }
}

#[inline(always)]
fn geometric(levels: &[LevelPixel], base: i64, steps: &[i64], scale: i64) -> Option<Unwrapped> {
    // base + frac(φ − base): the phase of the coarsest level within its one turn.
    let mut phase = base + i64::from(levels[0].phase.wrapping_sub(base as u16));
    for (n, level) in steps.iter().zip(&levels[1..]) {
        let wrapped = i64::from(level.phase);
        let order = nearest_order(n * phase - (wrapped << FACTOR_BITS))?;
        phase = (order << 16) + wrapped;
    }
    Some(Unwrapped {
        phase: AbsolutePhase::saturate(round(phase * scale, FACTOR_BITS)),
        modulation: Modulation::from_bits(levels[levels.len() - 1].modulation),
    })
}

/// The whole number next to x (in [`PRODUCT_BITS`]), unless the residual is too large.
#[inline(always)]
fn nearest_order(x: i64) -> Option<i64> {
    let order = round(x, PRODUCT_BITS);
    ((x - (order << PRODUCT_BITS)).abs() <= MAX_RESIDUAL_BITS).then_some(order)
}

#[inline(always)]
fn about(
    levels: &[LevelPixel],
    beat: Option<Beat>,
    dense: &[DenseLevel],
    map: AbsolutePhase,
) -> Option<Unwrapped> {
    if !map.is_known() {
        return None;
    }
    let known = i64::from(map.to_bits());
    // q_i = φ_i − frac(r_i Φ₀), wrapped.
    let q = |level: &DenseLevel| {
        let expected = round(level.ratio * known, RATIO_BITS) as u16;
        levels[level.at].phase.wrapping_sub(expected)
    };
    let mut delta = match beat {
        None => i64::from(q(&dense[0]) as i16),
        Some(Beat { n, slow }) => {
            let one = q(&dense[0]);
            let fast = i64::from(one.wrapping_sub(q(&dense[1])) as i16);
            let unwrapped = if slow {
                let a = i64::from(one.wrapping_sub(q(&dense[2])) as i16);
                fast + (nearest_order(n * a - (fast << FACTOR_BITS))? << 16)
            } else {
                fast
            };
            round(n * unwrapped, FACTOR_BITS)
        }
    };
    let (mut weights, mut powers, mut shares) = (0_u64, 0_u64, 0_u64);
    for level in dense {
        let pixel = &levels[level.at];
        let weight = level.weight_of(pixel);
        weights += weight;
        powers += weight;
        shares += level.weight;
        let wrapped = i64::from(q(level));
        let here = if beat.is_some() {
            let order = nearest_order(level.ratio_factor * delta - (wrapped << FACTOR_BITS))?;
            (order << 16) + wrapped
        } else {
            delta
        };
        let here = round(here * level.inverse, FACTOR_BITS);
        // The weighted mean so far, moved by this level's share.
        delta = if weight == weights {
            here
        } else {
            let weight = weight as i64;
            let sum = weights as i64;
            delta + ((here - delta) * weight + sum / 2).div_euclid(sum)
        };
    }
    let modulation = ((powers / shares).isqrt() << 4).min(65_535);
    Some(Unwrapped {
        phase: AbsolutePhase::saturate(known + delta),
        modulation: Modulation::from_bits(modulation as u16),
    })
}
