//! A step from a coarse phase to a fine one: k = round(n·Φ − φ), Φ_fine = k + φ, in words.
//!
//! A phase is a number of turns and −½…½ of one. The fraction of n·Φ is exact to 2/65536 turn and decides whether the step is
//! trusted; its whole part is needed only to within ± 0.1 turn, because a residual above 0.40 turn is rejected anyhow,
//! and is taken from a fixed-point product with as many fractional bits as fit beside the largest number of turns.

use super::unwrap::farness;
use crate::simd::Lanes;

/// A step prepared for any back-end.
#[derive(Clone, Copy, Debug)]
pub(super) struct Step {
    /// Whole part of n.
    whole: i16,
    /// Fraction of n in Q15, for phases, and in Q16, for turns.
    part_q15: i16,
    part_q16: i16,
    /// Fraction of n · (what the coarse phase counts from), Q16.
    origin: i16,
    /// The coarse number of turns takes this many bits, with its sign.
    order_bits: u8,
    /// n in the fixed point of the product with the coarse phase.
    gain: i16,
    /// Fractional bits of the product.
    bits: u8,
    /// The product's origin, and half a turn for rounding.
    offset: i16,
}

/// Fewest fractional bits of the product: with 4 the order is off by at most 1/16 turn for the product and 1/16 for the
/// fine phase.
const LEAST_BITS: f64 = 4.0;

/// An n this near to a whole number is that number: over 1000 turns 1e-6 turn.
const WHOLE: f64 = 1e-9;

impl Step {
    /// From phases of at most `reach` turns either way of an origin to n times as many; `behind` is n · that origin less the
    /// origin of the fine phase, in turns. `None` if a word cannot hold the fine ones with enough precision.
    pub fn new(n: f64, reach: f64, behind: f64) -> Option<Self> {
        // A whole n that comes out of ratios is off in its last digits.
        let next = libm::rint(n);
        let n = if libm::fabs(n - next) < WHOLE {
            next
        } else {
            n
        };
        let order_bits = if reach <= 0.5 {
            0.0
        } else {
            libm::ceil(libm::log2(2.0 * (reach + 0.5)))
        };
        let range = libm::pow(2.0, order_bits);
        // The product is taken by Q15, so its gain is half of n · range.
        let largest = (n * (reach + 0.5) + libm::fabs(behind) + 1.0).max(n * range / 2.0);
        let bits = libm::floor(libm::log2(32_767.0 / largest)).min(15.0);
        if !(bits >= LEAST_BITS) {
            return None;
        }
        let unit = libm::pow(2.0, bits);
        let part = n - libm::floor(n);
        Some(Self {
            whole: word(libm::floor(n)),
            part_q15: q15(part),
            part_q16: word(part * 65_536.0),
            origin: word(behind * 65_536.0),
            order_bits: order_bits as u8,
            gain: word(n * range / 2.0 * unit),
            bits: bits as u8,
            offset: word((behind + 0.5) * unit),
        })
    }
}

/// In Q15, at most 32767.
pub(super) fn q15(x: f64) -> i16 {
    libm::rint(x * 32_768.0).clamp(-32_767.0, 32_767.0) as i16
}

/// The low 16 bits of the number next to x.
pub(super) fn word(x: f64) -> i16 {
    libm::rint(x) as i64 as i16
}

/// Half a block of phases: whole turns, and what is beyond them in 1/65536.
#[derive(Clone, Copy)]
pub(super) struct Turns<V: Lanes> {
    /// Rounded down.
    pub order: V::W,
    /// 0…1 turn, as an unsigned word.
    pub phase: V::W,
}

impl<V: Lanes> Turns<V> {
    /// Of a phase of −½…½ turn.
    #[inline(always)]
    pub fn within_half(v: V, phase: V::W) -> Self {
        Self {
            order: v.sar::<15>(phase),
            phase,
        }
    }

    /// The turns of half a block of phases in 1/65536 turn.
    #[inline(always)]
    pub fn of(v: V, x: [V::D; 2]) -> Self {
        let (phase, order) = v.split(x);
        Self { order, phase }
    }

    /// Whole turns next to the phase, of which it is −½…½ away.
    #[inline(always)]
    pub fn nearest(self, v: V) -> V::W {
        v.sub(self.order, v.sar::<15>(self.phase))
    }
}

/// What half a block's coarse phases say of the fine ones: n·Φ.
#[derive(Clone, Copy)]
pub(super) struct Ahead<V: Lanes> {
    /// Its fraction, 1/65536 turn.
    pub fraction: V::W,
    /// n·Φ + ½ in the step's fixed point.
    pub turns: V::W,
}

/// A step with every constant in all lanes.
#[derive(Clone, Copy)]
pub(super) struct StepLanes<V: Lanes> {
    whole: V::W,
    part_q15: V::W,
    part_q16: V::W,
    origin: V::W,
    gain: V::W,
    offset: V::W,
    /// Whether n is whole.
    integral: bool,
    /// How turns of the coarse phase and what is beyond them make one word.
    order_left: V::Count,
    phase_right: V::Count,
    fine_right: V::Count,
    bits_right: V::Count,
}

impl<V: Lanes> StepLanes<V> {
    #[inline(always)]
    pub fn new(v: V, step: &Step) -> Self {
        Self {
            whole: v.splat16(step.whole),
            part_q15: v.splat16(step.part_q15),
            part_q16: v.splat16(step.part_q16),
            origin: v.splat16(step.origin),
            gain: v.splat16(step.gain),
            offset: v.splat16(step.offset),
            integral: step.part_q16 == 0 && step.part_q15 == 0,
            order_left: v.left(16 - step.order_bits),
            phase_right: v.right(step.order_bits),
            fine_right: v.right(16 - step.bits),
            bits_right: v.right(step.bits),
        }
    }

    /// What is expected at the fine level above coarse phases of −½…½ turn, for a step made for no more than that.
    #[inline(always)]
    pub fn ahead_of_start(&self, v: V, coarse: [V::W; 2]) -> [Ahead<V>; 2] {
        let mut fraction = self.fraction(v, coarse);
        if !self.integral {
            fraction = self.add_part(v, fraction, coarse);
        }
        self.ahead_of(v, fraction, coarse)
    }

    /// What is expected at the fine level above coarse phases of any number of turns.
    #[inline(always)]
    pub fn ahead(&self, v: V, coarse: [Turns<V>; 2]) -> [Ahead<V>; 2] {
        let [low, high] = coarse;
        let phase = [low.phase, high.phase];
        let mut fraction = self.fraction(v, phase);
        if !self.integral {
            fraction = self.add_part(v, fraction, phase);
            fraction = [
                v.add(fraction[0], v.mul_low(low.nearest(v), self.part_q16)),
                v.add(fraction[1], v.mul_low(high.nearest(v), self.part_q16)),
            ];
        }
        let product = [self.word(v, low), self.word(v, high)];
        self.ahead_of(v, fraction, product)
    }

    /// The fraction of the origin's and of the whole part of n's share of n·Φ.
    #[inline(always)]
    fn fraction(&self, v: V, phase: [V::W; 2]) -> [V::W; 2] {
        [
            v.add(v.mul_low(phase[0], self.whole), self.origin),
            v.add(v.mul_low(phase[1], self.whole), self.origin),
        ]
    }

    #[inline(always)]
    fn add_part(&self, v: V, fraction: [V::W; 2], phase: [V::W; 2]) -> [V::W; 2] {
        [
            v.add(fraction[0], v.mul_q15(phase[0], self.part_q15)),
            v.add(fraction[1], v.mul_q15(phase[1], self.part_q15)),
        ]
    }

    /// As much of a phase as a word holds.
    #[inline(always)]
    fn word(&self, v: V, Turns { order, phase }: Turns<V>) -> V::W {
        let high = v.shl_by(order, self.order_left);
        v.add(high, v.shr_by(phase, self.phase_right))
    }

    #[inline(always)]
    fn ahead_of(&self, v: V, fraction: [V::W; 2], product: [V::W; 2]) -> [Ahead<V>; 2] {
        let turns = [
            v.add(v.mul_q15(product[0], self.gain), self.offset),
            v.add(v.mul_q15(product[1], self.gain), self.offset),
        ];
        [
            Ahead {
                fraction: fraction[0],
                turns: turns[0],
            },
            Ahead {
                fraction: fraction[1],
                turns: turns[1],
            },
        ]
    }

    /// The fine phase of which `fine` is the wrapped one, and what was left over ([`farness`]).
    #[inline(always)]
    pub fn land(&self, v: V, ahead: Ahead<V>, fine: V::W) -> (Turns<V>, V::W) {
        let left = farness(v, v.sub(ahead.fraction, fine));
        let turns = v.sub(ahead.turns, v.shr_by(fine, self.fine_right));
        let climbed = Turns {
            order: v.sar_by(turns, self.bits_right),
            phase: fine,
        };
        (climbed, left)
    }
}
