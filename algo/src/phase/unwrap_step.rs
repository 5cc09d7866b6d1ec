//! One step of temporal unwrapping: the absolute phase of a coarse level gives the fringe order of
//! a finer one.
//!
//! **Idea.** The coarse phase times the quotient of the two ratios predicts the fine phase. The
//! fine level's wrapped phase is more accurate but lacks its whole turns; the prediction supplies
//! them.
//!
//! **Equation** (Huntley & Saldner 1993; Zuo et al. 2016), with n = r_fine / r_coarse:
//!
//! ```text
//! predicted = n · Φ_coarse
//! k         = round(predicted − φ_fine)
//! Φ_fine    = k + φ_fine
//! residual  = |predicted − Φ_fine|        a pixel with more than 0.40 turn is rejected
//! ```
//!
//! **Shapes and units.** Half a block of pixels in 16-bit words; phases in 1/65536 turn, so that
//! the wrap of the word is the wrap of the phase. An absolute phase takes two words, its fringe
//! order and its fraction ([`Turns`]).
//!
//! **Departure.** n · Φ does not fit a word, so it is computed twice ([`PredictedPhase`]). Modulo
//! one turn it is within 2/65536 turn; that gives the residual. Its whole turns are needed only
//! within ± 0.1 turn, because a residual above 0.40 is rejected anyway; they come from a
//! fixed-point product with as many fractional bits as fit beside the largest number of turns. The
//! coarse phase in this product is one word ([`Absolute`]): its whole turns and the leading bits of
//! its fraction, with the fractional bits of the step before, whose order and fraction are then
//! merged by a mask.
//!
//! **Accuracy.** No fringe order differs from the exact one:
//! `no_fringe_order_slips_at_any_wrap_of_a_hundred_fringes`,
//! `as_many_turns_as_documented_decode_in_every_fringe_and_more_are_refused`,
//! `the_largest_step_between_levels_decodes_and_a_larger_one_is_refused`.

use crate::simd::Lanes;

/// An unwrapping step, prepared for any back-end.
#[derive(Clone, Copy, Debug)]
pub(super) struct UnwrapStep {
    /// Whole part of n.
    whole: i16,
    /// Fraction of n in Q15, for phases, and in Q16, for turns.
    part_q15: i16,
    part_q16: i16,
    /// What the origins of both levels add to the fraction of n·Φ, Q16.
    origin: i16,
    /// n in the fixed point of the product with the coarse phase.
    gain: i16,
    /// Fractional bits of that product.
    bits: u8,
    /// Fractional bits of the coarse phase in one word.
    coarse_bits: u8,
    /// By how much that word is shifted to the left before the product.
    coarse_left: u8,
    /// What the origins add to the product, and half a turn for rounding.
    offset: i16,
}

/// Fewest fractional bits of the product: with 4, truncation of the product and of the fine phase
/// moves what is rounded to the fringe order by at most 1/16 turn each.
const LEAST_BITS: f64 = 4.0;

/// An n this near to a whole number is taken as that number: over 1000 turns that is 1e-6 turn.
const WHOLE: f64 = 1e-9;

impl UnwrapStep {
    /// A step from coarse phases within ± `reach` turns of their origin to n times as many;
    /// `behind` is n · that origin less the origin of the fine phase, in turns. The coarse phases
    /// come from the step `before`, or are wrapped ones. `None` if a word cannot hold the fine
    /// phases with enough precision.
    pub fn new(n: f64, reach: f64, behind: f64, before: Option<&Self>) -> Option<Self> {
        // The quotient of two ratios has rounding errors even where n is whole.
        let next = libm::rint(n);
        let n = if libm::fabs(n - next) < WHOLE {
            next
        } else {
            n
        };
        let coarse_bits = before.map_or(16, |step| step.bits);
        // From the third step on the word may have room for more turns than there are.
        let order_bits = libm::ceil(libm::log2(2.0 * (reach + 0.5))) as u8;
        let coarse_left = match before {
            Some(step) if step.coarse_bits < 16 => (16 - coarse_bits).saturating_sub(order_bits),
            _ => 0,
        };
        // Turns in the word of a coarse phase.
        let range = libm::pow(2.0, 16.0 - f64::from(coarse_bits + coarse_left));
        // The product is taken by Q15, so its gain is half of n · range.
        let largest = (n * reach + libm::fabs(behind) + 1.0).max(n * range / 2.0);
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
            gain: word(n * range / 2.0 * unit),
            bits: bits as u8,
            coarse_bits,
            coarse_left,
            offset: word((behind + 0.5) * unit),
        })
    }
}

/// x in Q15, saturated to ± 32767.
pub(super) fn q15(x: f64) -> i16 {
    libm::rint(x * 32_768.0).clamp(-32_767.0, 32_767.0) as i16
}

/// The low 16 bits of x rounded to nearest.
pub(super) fn word(x: f64) -> i16 {
    libm::rint(x) as i64 as i16
}

/// The absolute phases of half a block.
#[derive(Clone, Copy)]
pub(super) struct Turns<V: Lanes> {
    /// Fringe order: the phase rounded down.
    pub order: V::W,
    /// The fraction, 0…1 turn as an unsigned word in 1/65536 turn.
    pub phase: V::W,
}

impl<V: Lanes> Turns<V> {
    /// From wrapped phases, taken as −½…½ turn.
    #[inline(always)]
    pub fn from_wrapped(v: V, phase: V::W) -> Self {
        Self {
            order: v.sar::<15>(phase),
            phase,
        }
    }

    /// From double words in 1/65536 turn.
    #[inline(always)]
    pub fn split(v: V, x: [V::D; 2]) -> Self {
        let (phase, order) = v.split(x);
        Self { order, phase }
    }

    /// The nearest whole number of turns.
    #[inline(always)]
    pub fn nearest_order(self, v: V) -> V::W {
        v.sub(self.order, v.sar::<15>(self.phase))
    }
}

/// The absolute phases of half a block, as a step found them.
#[derive(Clone, Copy)]
pub(super) struct Absolute<V: Lanes> {
    pub turns: Turns<V>,
    /// Fringe order and fraction in one word, with the fractional bits of that step's product.
    word: V::W,
}

impl<V: Lanes> Absolute<V> {
    /// From wrapped phases, taken as −½…½ turn.
    #[inline(always)]
    pub fn from_wrapped(v: V, phase: V::W) -> Self {
        Self {
            turns: Turns::from_wrapped(v, phase),
            word: phase,
        }
    }
}

/// The phases that half a block's coarse level predicts for the finer one: n·Φ.
#[derive(Clone, Copy)]
pub(super) struct PredictedPhase<V: Lanes> {
    /// n·Φ modulo one turn, 1/65536 turn.
    pub fraction: V::W,
    /// n·Φ + ½ in the step's fixed point, for its whole turns.
    pub turns: V::W,
}

/// [`UnwrapStep`] with every constant in all lanes.
#[derive(Clone, Copy)]
pub(super) struct UnwrapStepLanes<V: Lanes> {
    whole: V::W,
    part_q15: V::W,
    part_q16: V::W,
    origin: V::W,
    gain: V::W,
    offset: V::W,
    /// Whether n is whole.
    integral: bool,
    fine_right: V::Count,
    bits_right: V::Count,
    coarse_right: V::Count,
    coarse_left: V::Count,
    /// Mask: the bits of the product that are whole turns.
    whole_turns: V::W,
}

impl<V: Lanes> UnwrapStepLanes<V> {
    #[inline(always)]
    pub fn new(v: V, step: &UnwrapStep) -> Self {
        Self {
            whole: v.splat16(step.whole),
            part_q15: v.splat16(step.part_q15),
            part_q16: v.splat16(step.part_q16),
            origin: v.splat16(step.origin),
            gain: v.splat16(step.gain),
            offset: v.splat16(step.offset),
            integral: step.part_q16 == 0 && step.part_q15 == 0,
            fine_right: v.right(16 - step.bits),
            bits_right: v.right(step.bits),
            // A wrapped phase has no bit of a whole turn but its sign.
            coarse_right: v.right(step.coarse_bits.min(15)),
            coarse_left: v.left(step.coarse_left),
            whole_turns: v.splat16((u16::MAX << step.bits).cast_signed()),
        }
    }

    /// The predicted phases from coarse ones.
    #[inline(always)]
    pub fn predicted(&self, v: V, coarse: Absolute<V>) -> PredictedPhase<V> {
        PredictedPhase {
            fraction: self.fraction(v, coarse),
            turns: self.turns(v, v.shl_by(coarse.word, self.coarse_left)),
        }
    }

    /// Unwraps `wrapped`, the fine level's phases, by predicted phases: the absolute phases, and the
    /// residuals' magnitudes (unsigned, 1/65536 turn).
    #[inline(always)]
    pub fn unwrap_predicted(
        &self,
        v: V,
        predicted: PredictedPhase<V>,
        wrapped: V::W,
    ) -> (Absolute<V>, V::W) {
        let residual = v.sub(wrapped, predicted.fraction);
        let part = v.shr_by(wrapped, self.fine_right);
        let turns = v.sub(predicted.turns, part);
        let phase = Absolute {
            turns: Turns {
                order: v.sar_by(turns, self.bits_right),
                phase: wrapped,
            },
            word: v.merge(self.whole_turns, turns, part),
        };
        (phase, v.abs(residual))
    }

    /// As [`Self::unwrap_predicted`] by coarse phases, in one of the first two steps: there the
    /// coarse word is not shifted.
    #[inline(always)]
    pub fn unwrap(&self, v: V, coarse: Absolute<V>, wrapped: V::W) -> (Absolute<V>, V::W) {
        let predicted = PredictedPhase {
            fraction: self.fraction(v, coarse),
            turns: self.turns(v, coarse.word),
        };
        self.unwrap_predicted(v, predicted, wrapped)
    }

    /// n·Φ modulo one turn.
    #[inline(always)]
    fn fraction(&self, v: V, coarse: Absolute<V>) -> V::W {
        let fraction = v.add(v.mul_low(coarse.turns.phase, self.whole), self.origin);
        if self.integral {
            return fraction;
        }
        v.add(fraction, self.part(v, coarse))
    }

    /// (Fraction of n) · Φ modulo one turn.
    #[inline(always)]
    fn part(&self, v: V, coarse: Absolute<V>) -> V::W {
        // From the word, so that no fringe order has to be kept where n is whole.
        let turns = Turns {
            order: v.sar_by(coarse.word, self.coarse_right),
            phase: coarse.turns.phase,
        };
        let orders = v.mul_low(turns.nearest_order(v), self.part_q16);
        v.add(orders, v.mul_q15(turns.phase, self.part_q15))
    }

    /// n·Φ + ½ in the step's fixed point, from the word of Φ.
    #[inline(always)]
    fn turns(&self, v: V, coarse: V::W) -> V::W {
        v.add(v.mul_q15(coarse, self.gain), self.offset)
    }
}
