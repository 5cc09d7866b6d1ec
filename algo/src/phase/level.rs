//! The plan of a level's demodulation: samples → wrapped phase and modulation.
//!
//! [`super::terms`] has the equations of S and C, [`super::fold`] those of phase and length. This
//! file chooses, per number of shifts and bit depth, how S and C are computed, their scaling, and
//! the threshold in their unit.
//!
//! Modulations come out as shares of full scale in units of full scale / 32767.5, that is half of a
//! [`crate::units::Modulation`]; the stores double them.

use super::clipped::{Clipped, LARGEST};
use crate::pattern;
use crate::simd::Lanes;
use crate::trust::LeastModulation;
use alloc::vec::Vec;
use core::f64::consts::TAU;

/// What rounding may take off √(S² + C²) at the threshold, in units of S and C, so that a
/// modulation of exactly the minimum is trusted.
const TIE: f64 = 0.75;
/// Where |S| and |C| are below this, [`Lanes::normalised`] needs them lifted first.
pub(super) const FAINT: i16 = 1 << 10;
/// Largest bit depth of the forms that subtract samples: four of them must fit a word.
const WORD_FORM_BITS: u8 = 12;
/// √(1 + t²) on 0 ≤ t ≤ 1, coefficients of 1, t² and t⁴: relative error 6.5e-4.
const LENGTH: [f64; 3] = [1.000_644, 0.484_927, -0.072_269];

/// A level prepared for demodulation at one bit depth.
#[derive(Clone, Debug)]
pub(crate) struct LevelPlan {
    /// Places of the level's frames in the sequence, in the order of their shifts.
    pub frames: Vec<usize>,
    /// How S and C come from the samples.
    pub demodulation: Demodulation,
    /// The weights of the terms of S and of C, in pairs ([`pair`]).
    terms: [[i32; 2]; 2],
    /// The weights of the samples in S and in C, two samples at a time ([`pair`]).
    pub weights: Vec<[i32; 2]>,
    /// Bits by which differences of samples are shifted left to fill words.
    lift: u8,
    /// Bits by which sums of products of differences are shifted right to words.
    pub down: u8,
    /// Bits by which samples are shifted left to 16 bits.
    pub to_16_bits: u8,
    /// Full scale less one count, unsigned.
    below_full_scale: i16,
    /// √(S² + C²) of a modulation of one count.
    per_count: f64,
    /// S² + C² must be above this.
    pub below_least_power: i32,
    /// Where |S| or |C| is at least this, S² + C² is above `below_least_power`, and the pointer is
    /// not [`FAINT`].
    long_enough: i16,
    /// Whether a pixel whose pointer is [`FAINT`] can be trusted.
    pub faint: bool,
    /// The least modulation for four shifts of 8 bits, which are folded in bytes.
    four: LeastOfFour,
    /// Coefficients of √(1 + t²), scaled so that the product with a length is a modulation.
    hypotenuse: [i16; 3],
    /// Whether the product of these coefficients and a length is half of the modulation, because
    /// they would not fit Q15 else.
    doubled: bool,
    /// How a pixel with samples at full scale is demodulated; they reject it if it is not.
    pub(super) clipped: Option<Clipped>,
}

/// The least modulation of four shifts of 8 bits, with S and C in counts.
#[derive(Clone, Copy, Debug, Default)]
struct LeastOfFour {
    /// The least S² + C², at most 255².
    power: u16,
    /// The least |S| or |C| that is enough by itself.
    long_enough: u8,
    /// The largest |S| and |C| that are too short even together.
    too_short: u8,
}

/// How S and C come from the samples of a level ([`super::terms`]).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Demodulation {
    /// N = 4: differences of opposite shifts.
    Four,
    /// N = 4 with samples of more than 12 bits.
    WideFour,
    /// N = 3 and 6: sums and differences, and one product.
    Thirds,
    /// N = 5, 7, 8 and 9: products of differences.
    Terms,
    /// Products of the samples.
    Weighted,
}

/// A demodulated block of a level.
#[derive(Clone, Copy)]
pub(crate) struct Demodulated<V: Lanes> {
    /// Wrapped phase, 1/65536 turn.
    pub phase: [V::W; 2],
    /// Mask: the modulation is at least the trusted minimum.
    pub strong: V::B,
    /// 255 where a sample is at full scale and the phase was not found without it.
    pub brightest: V::B,
}

impl LevelPlan {
    pub fn new(level: &pattern::Level, bit_depth: u8) -> Self {
        let shifts = level.shifts();
        let mut frames: Vec<usize> = level.frames.iter().map(|&at| usize::from(at)).collect();
        let full_scale = f64::from((1_u32 << bit_depth) - 1);
        // A start of k/N gives the same shifts as 0, in another order.
        let places = level.start * shifts as f64;
        let on_grid = libm::fabs(places - libm::rint(places)) < 1e-9;
        let wide = bit_depth > WORD_FORM_BITS;
        let demodulation = match shifts {
            4 if on_grid && wide => Demodulation::WideFour,
            4 if on_grid => Demodulation::Four,
            3 | 6 if on_grid && !wide => Demodulation::Thirds,
            5 | 7..=9 if on_grid && !wide => Demodulation::Terms,
            _ => Demodulation::Weighted,
        };
        if demodulation != Demodulation::Weighted {
            let back = (shifts - libm::rint(places) as usize % shifts) % shifts;
            frames.rotate_left(back);
        }
        let to_16_bits = 16 - bit_depth;
        // `unit`: one count in the words of S and C.
        let (mut terms, mut weights) = ([[0; 2]; 2], Vec::new());
        let (mut lift, mut down) = (0, 0);
        let unit = match demodulation {
            Demodulation::WideFour => f64::from(1_u32 << to_16_bits) / 4.0,
            Demodulation::Four | Demodulation::Thirds => {
                lift = lift_of(bit_depth, shifts);
                f64::from(1_u32 << lift)
            }
            Demodulation::Terms => {
                down = bit_depth;
                let scale = LARGEST / largest(shifts, 0.0);
                terms = weights_of_terms(shifts, scale);
                scale / f64::from(1_u32 << down)
            }
            Demodulation::Weighted => {
                let scale = LARGEST / largest(shifts, level.start);
                weights = weights_of_samples(level, scale);
                scale / f64::from(1_u32 << bit_depth)
            }
        };
        // B = (2/N) · length · √(1 + t²) / unit, here as a share of full scale in half units of
        // `Modulation`.
        let mut factor = 2.0 / shifts as f64 / (unit * full_scale) * 32_767.5;
        let doubled = factor * core::f64::consts::SQRT_2 >= 0.999;
        if doubled {
            factor /= 2.0;
        }
        let per_count = shifts as f64 / 2.0 * unit;
        let first = match demodulation {
            Demodulation::Weighted => level.start,
            _ => 0.0,
        };
        let mut planned = Self {
            frames,
            demodulation,
            terms,
            weights,
            lift,
            down,
            to_16_bits,
            below_full_scale: (((1_u32 << bit_depth) - 2) as u16).cast_signed(),
            per_count,
            below_least_power: 0,
            long_enough: 0,
            faint: false,
            four: LeastOfFour::default(),
            hypotenuse: LENGTH.map(|c| libm::rint(c * factor * 32_768.0) as i16),
            doubled,
            clipped: Clipped::new(level, first, per_count, full_scale),
        };
        planned.trust_from(LeastModulation::default(), full_scale as u16);
        planned
    }

    /// Sets the least modulation that is trusted.
    pub fn trust_from(&mut self, least: LeastModulation, full_scale: u16) {
        let length = self.per_count * least.counts(full_scale) - TIE;
        self.below_least_power = libm::ceil(length * length) as i32 - 1;
        if let Some(clipped) = &mut self.clipped {
            clipped.least = length;
        }
        // The longer of two components is at least 1/√2 of the length.
        self.faint = length < f64::from(FAINT) * core::f64::consts::SQRT_2;
        let enough = libm::ceil(length) as i16;
        self.long_enough = if self.faint {
            enough.max(FAINT)
        } else {
            enough
        };
        // The words of four shifts of 8 bits are differences shifted left by 7 bits; other levels
        // do not use this.
        let below = (self.below_least_power >> (2 * lift_of(8, 4))).min(255 * 255 - 1);
        self.four = LeastOfFour {
            power: below as u16 + 1,
            long_enough: below.isqrt() as u8 + 1,
            too_short: (below / 2).isqrt() as u8,
        };
    }
}

/// [`LevelPlan`] with every constant in all lanes.
#[derive(Clone, Copy)]
pub(super) struct LevelLanes<'a, V: Lanes> {
    pub plan: &'a LevelPlan,
    pub terms: [[V::D; 2]; 2],
    pub lift: V::Count,
    /// `lift` less one bit.
    pub half_lift: V::Count,
    pub to_16_bits: V::Count,
    pub long_enough: V::W,
    /// Full scale less one count, with its sign bit inverted.
    pub below_full_scale: V::W,
    pub hypotenuse: [V::W; 3],
    pub doubled: V::Count,
    pub four: LeastOfFourLanes<V>,
}

/// [`LeastOfFour`] in all lanes.
#[derive(Clone, Copy)]
pub(super) struct LeastOfFourLanes<V: Lanes> {
    pub power: V::W,
    pub long_enough: V::Bound,
    pub too_short: V::Bound,
}

impl<'a, V: Lanes> LevelLanes<'a, V> {
    #[inline(always)]
    pub fn new(v: V, plan: &'a LevelPlan) -> Self {
        let [along, across] = plan.terms;
        Self {
            plan,
            terms: [
                [v.splat32(along[0]), v.splat32(along[1])],
                [v.splat32(across[0]), v.splat32(across[1])],
            ],
            lift: v.left(plan.lift),
            half_lift: v.left(plan.lift.saturating_sub(1)),
            to_16_bits: v.left(plan.to_16_bits),
            long_enough: v.splat16(plan.long_enough),
            below_full_scale: v.xor(v.splat16(plan.below_full_scale), v.splat16(i16::MIN)),
            hypotenuse: [
                v.splat16(plan.hypotenuse[0]),
                v.splat16(plan.hypotenuse[1]),
                v.splat16(plan.hypotenuse[2]),
            ],
            doubled: v.left(u8::from(plan.doubled)),
            four: LeastOfFourLanes {
                power: v.splat16(plan.four.power.cast_signed()),
                long_enough: v.bound(plan.four.long_enough),
                too_short: v.bound(plan.four.too_short),
            },
        }
    }
}

/// Bits by which differences of samples are shifted left to fill words, for N = 3, 4 and 6.
pub(super) const fn lift_of(bit_depth: u8, shifts: usize) -> u8 {
    // The differences of 6 shifts are twice as large.
    16 - bit_depth - if shifts == 6 { 2 } else { 1 }
}

/// The largest S or C of samples from 0 to 1: half of the sum of the weights' magnitudes, because
/// the weights add up to 0.
fn largest(shifts: usize, start: f64) -> f64 {
    let sum = |weight: fn(f64) -> f64| -> f64 {
        let weights = (0..shifts).map(|k| weight(TAU * (start + k as f64 / shifts as f64)));
        weights.map(libm::fabs).sum()
    };
    sum(libm::cos).max(sum(libm::sin)) / 2.0
}

/// The weights of the terms of S and C ([`super::terms`]), multiplied by `scale`.
fn weights_of_terms(shifts: usize, scale: f64) -> [[i32; 2]; 2] {
    let angle = |k: usize| TAU * k as f64 / shifts as f64;
    let mut terms = [[0.0; 4]; 2];
    let [along, across] = &mut terms;
    if shifts.is_multiple_of(2) {
        // N = 8.
        *along = [1.0, libm::cos(angle(1)), 0.0, 0.0];
        *across = [1.0, libm::sin(angle(1)), 0.0, 0.0];
    } else {
        for k in 1..=shifts / 2 {
            along[k - 1] = -libm::cos(angle(k));
            across[k - 1] = libm::sin(angle(k));
        }
    }
    terms.map(|terms| {
        let [a, b, c, d] = terms.map(|weight| libm::rint(weight * scale) as i16);
        [pair(a, b), pair(c, d)]
    })
}

/// The weights of a level's samples in S and C, multiplied by `scale`, two samples at a time. Those
/// of S add up to 0, and so do those of C: the offset A drops out exactly.
fn weights_of_samples(level: &pattern::Level, scale: f64) -> Vec<[i32; 2]> {
    let shifts = level.shifts();
    let angle = |k: usize| TAU * (level.start + k as f64 / shifts as f64);
    let along: Vec<f64> = (0..shifts).map(|k| scale * libm::cos(angle(k))).collect();
    let across: Vec<f64> = (0..shifts).map(|k| scale * libm::sin(angle(k))).collect();
    let (along, across) = (balanced(&along), balanced(&across));
    let weights = along.chunks(2).zip(across.chunks(2));
    let second = |weights: &[i16]| weights.get(1).copied().unwrap_or(0);
    weights
        .map(|(s, c)| [pair(s[0], second(s)), pair(c[0], second(c))])
        .collect()
}

/// Two weights as the words of a double word, as [`Lanes::dot_pair`] takes them.
fn pair(first: i16, second: i16) -> i32 {
    i32::from(first.cast_unsigned()) | i32::from(second) << 16
}

/// The numbers, rounded so that their sum stays 0.
fn balanced(exact: &[f64]) -> Vec<i16> {
    let mut rounded: Vec<i16> = exact.iter().map(|&x| libm::rint(x) as i16).collect();
    let mut over: i32 = rounded.iter().map(|&x| i32::from(x)).sum();
    while over != 0 {
        let step = over.signum();
        // The number whose rounding the other way adds the least error.
        let cost = |at: usize| {
            let error = f64::from(rounded[at]) - exact[at];
            -error * f64::from(step)
        };
        let best = (0..exact.len()).min_by(|&a, &b| cost(a).total_cmp(&cost(b)));
        let Some(best) = best else { break };
        rounded[best] -= step as i16;
        over -= step;
    }
    rounded
}
