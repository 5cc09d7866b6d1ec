//! Unwrapping from coarse to fine: k = round(n·Φ_coarse − φ), Φ = k + φ, with n the real ratio between two levels.
//!
//! In words: the fraction of n·Φ_coarse is exact to 2/65536 turn and decides whether the step is trusted; its whole
//! part is needed only to within ± 0.1 turn, because a residual above 0.40 turn is rejected anyhow, and is taken
//! from a fixed-point product with as many fractional bits as fit beside the largest order.

use super::unwrap::{MAX_RESIDUAL_BITS, beyond};
use crate::pattern::{Level, PhaseRange, SequenceError};
use crate::simd::Lanes;
use alloc::vec::Vec;

/// Coarse-to-fine levels prepared for unwrapping.
#[derive(Clone, Debug)]
pub(super) struct Geometric {
    /// The lowest phase that the coarsest level can have, 1/65536 turn of that level.
    pub lowest: i32,
    /// From each level to the next finer one.
    pub steps: Vec<Step>,
    /// What the finest level's (order, phase) counts from, 1/65536 turn.
    pub origin: i32,
    /// 1 / ratio of the finest level, Q20, where that is not 1.
    pub scale: Option<i64>,
}

/// A step from a level to the next finer one.
#[derive(Clone, Copy, Debug)]
pub(super) struct Step {
    /// Whole part of n.
    whole: i16,
    /// Fraction of n in Q16.
    part: i16,
    /// Fraction of n · (what the coarse phase counts from), Q16.
    origin: i16,
    /// The coarse order takes this many bits.
    order_bits: u8,
    /// n in the fixed point of the product with the coarse phase.
    gain: i16,
    /// Fractional bits of the product.
    bits: u8,
    /// The product's origin, and half a turn for rounding.
    offset: i16,
}

/// Fewest fractional bits of the product from which the order is taken: with 4 it is off by at most 1/16 turn for the
/// product, 1/16 for the fine phase.
const LEAST_BITS: u32 = 4;

impl Geometric {
    pub fn new(levels: &[Level], range: PhaseRange) -> Result<Self, SequenceError> {
        let coarsest = levels[0].ratio;
        // What the coarsest level leaves free of its turn is noise margin on both sides.
        let margin = (1.0 - coarsest * range.span()).max(0.0) / 2.0;
        let lowest = libm::rint((coarsest * range.min - margin) * 65_536.0);
        // Φ of a level = origin + order + φ; the coarsest level's order is 0 and its φ counts from `lowest`.
        let mut origin = lowest / 65_536.0;
        let mut reach = 1.0;
        let mut orders = 0.0;
        let mut steps = Vec::new();
        for pair in levels.windows(2) {
            let too_far = SequenceError::Step {
                from: pair[0].ratio,
                to: pair[1].ratio,
            };
            let n = pair[1].ratio / pair[0].ratio;
            // One below, so that no order is negative.
            let next = libm::floor(n * origin) - 1.0;
            let order_bits = (orders as u32 + 1).next_power_of_two().ilog2();
            reach = n * reach + 2.0;
            let span = n * f64::from(1_u32 << order_bits) + 3.0;
            let bits = libm::floor(libm::log2(65_535.0 / span));
            if !(bits >= f64::from(LEAST_BITS)) {
                return Err(too_far);
            }
            let unit = libm::pow(2.0, bits);
            let word = |x: f64| (libm::rint(x) as i64 as u16).cast_signed();
            let behind = n * origin - next;
            steps.push(Step {
                whole: word(libm::floor(n)),
                part: word(libm::rint((n - libm::floor(n)) * 65_536.0).min(65_535.0)),
                origin: word(behind * 65_536.0),
                order_bits: order_bits as u8,
                gain: word(n * f64::from(1_u32 << order_bits) * unit),
                bits: bits as u8,
                offset: word((behind + 0.5) * unit),
            });
            origin = next;
            orders = libm::ceil(reach);
        }
        let finest = levels[levels.len() - 1].ratio;
        let whole = libm::fabs(finest - 1.0) < 1e-12;
        Ok(Self {
            lowest: lowest as i32,
            steps,
            origin: libm::rint(origin * 65_536.0) as i32,
            scale: (!whole).then(|| libm::rint(f64::from(1_u32 << 20) / finest) as i64),
        })
    }
}

/// Half a block on its way from coarse to fine.
#[derive(Clone, Copy)]
pub(super) struct Climb<V: Lanes> {
    /// Fringe order, from the level's origin.
    pub order: V::W,
    /// Phase in 1/65536 turn.
    pub phase: V::W,
    /// Mask: a step left too much over.
    pub doubtful: V::W,
}

impl Step {
    /// From a coarse phase to the fine one whose wrapped phase is `fine`.
    #[inline(always)]
    pub fn climb<V: Lanes>(&self, v: V, coarse: Climb<V>, fine: V::W) -> Climb<V> {
        let (order, phase) = (coarse.order, coarse.phase);
        let (whole, part) = (v.splat16(self.whole), v.splat16(self.part));
        // frac(n·Φ) in 1/65536 turn, and what is left when a whole order is taken off.
        let fraction = v.add(v.mul_low(phase, whole), v.mul_high(phase, part));
        let fraction = v.add(fraction, v.splat16(self.origin));
        let (fraction, product) = if self.order_bits == 0 {
            (fraction, phase)
        } else {
            let high = v.shl_by(order, 16 - self.order_bits);
            let low = v.shr_by(phase, self.order_bits);
            (v.add(fraction, v.mul_low(order, part)), v.or(high, low))
        };
        let doubtful = v.or(
            coarse.doubtful,
            beyond(v, v.sub(fraction, fine), MAX_RESIDUAL_BITS),
        );
        let product = v.mul_high(product, v.splat16(self.gain));
        let turns = v.add(product, v.splat16(self.offset));
        let turns = v.sub(turns, v.shr_by(fine, 16 - self.bits));
        Climb {
            order: v.shr_by(turns, self.bits),
            phase: fine,
            doubtful,
        }
    }
}
