//! The plan of a level's demodulation, and demodulation itself: samples → wrapped phase and modulation.
//!
//! [`super::fold`] has the equations of S and C, [`super::angle`] those of phase and length. This file chooses, per number of
//! shifts and bit depth, how S and C are computed, their scaling, and the thresholds in the units of that form.
//!
//! Modulations come out as shares of full scale in units of full scale / 32767.5, that is half of a
//! [`crate::units::Modulation`]; the stores double them.

use super::angle::{AngleLanes, LENGTH, hypotenuse};
use super::fold::Folded;
use crate::pattern;
use crate::simd::Lanes;
use crate::trust::MIN_MODULATION_8_BIT;
use alloc::vec::Vec;
use core::f64::consts::TAU;

/// Levels of at least this many shifts are trusted even with samples at full scale: the periodic
/// error of a slight saturation falls from 3e-3 turn (4 shifts) to 7e-4 turn.
pub const FULL_TRUST_SHIFTS: usize = 8;

/// Share of S² + C² that rounding may take off at the threshold, so that a modulation of exactly the minimum is trusted. It is
/// 2e-3 of the change by one count.
const TIE: f64 = 1e-4;
/// Fractional bits of weights.
const WEIGHT_BITS: u8 = 14;
/// Largest bit depth of the forms for 3 and 4 shifts: 3·(2I₀ − I₁ − I₂) must fit a word.
const WORD_FORM_BITS: u8 = 12;

/// A level prepared for demodulation at one bit depth.
#[derive(Clone, Debug)]
pub(crate) struct Level {
    /// Places of the level's frames in the sequence, in the order of their shifts.
    pub frames: Vec<usize>,
    /// How S and C come from the samples.
    pub samples: Samples,
    /// Weights of the samples in S and in C, Q14; empty for the forms of 3 and 4 shifts.
    pub weights: Vec<[i16; 2]>,
    /// Bits by which S and C are shifted: left from counts to words, or right from 32-bit sums to words.
    pub lift: u8,
    /// Bits by which weighted products are shifted right before they are added.
    pub drop: u8,
    /// Full scale less one count, unsigned.
    pub below_full_scale: i16,
    /// Middle of the range of samples, unsigned.
    pub centre: i16,
    /// S² + C² must be above this, in the units of the forms for 3 and 4 shifts.
    below_least_power: i32,
    /// S² + C² must be above this, in the units of weighted sums.
    below_least_sum_power: f32,
    /// Coefficients of √(1 + t²), scaled so that the product with a length is a modulation.
    hypotenuse: [i16; 3],
    /// Whether that product is half of the modulation, because the coefficients would not fit Q15.
    doubled: bool,
    /// Whether a sample at full scale rejects its pixel.
    pub saturates: bool,
}

/// How S and C come from the samples of a level.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Samples {
    /// By differences of opposite shifts, N = 4.
    Four,
    /// By differences, N = 3.
    Three,
    /// By sums with weights cos 2πs_k for S and sin 2πs_k for C.
    Weighted,
}

/// A demodulated block of a level.
#[derive(Clone, Copy)]
pub(crate) struct Demodulated<V: Lanes> {
    /// Wrapped phase, 1/65536 turn.
    pub phase: [V::W; 2],
    /// Mask: the modulation is at least the trusted minimum.
    pub strong: V::B,
    /// 255 where a sample is at full scale and the level does not tolerate that.
    pub brightest: V::B,
}

impl Level {
    pub fn new(level: &pattern::Level, bit_depth: u8) -> Self {
        let shifts = level.shifts();
        let mut frames: Vec<usize> = level.frames.iter().map(|&at| usize::from(at)).collect();
        let full_scale = f64::from((1_u32 << bit_depth) - 1);
        let least = MIN_MODULATION_8_BIT * full_scale / 255.0;
        // A start of k/N gives the same shifts as 0, in another order.
        let places = level.start * shifts as f64;
        let on_grid = libm::fabs(places - libm::rint(places)) < 1e-9;
        let form = (on_grid && bit_depth <= WORD_FORM_BITS).then_some(shifts);
        let up = 15 - bit_depth.min(WORD_FORM_BITS);
        let lifted = f64::from(1_u32 << up);
        // `unit`: one count in the words of S and C. `powers`: factor from S² + C² in counts² to the units of the form's
        // threshold.
        let (mut weights, mut drop) = (Vec::new(), 0);
        let (samples, lift, unit, powers) = match form {
            Some(4) => (Samples::Four, up, lifted, lifted * lifted),
            Some(3) => (Samples::Three, up, lifted, 4.0),
            _ => {
                let down;
                (weights, drop, down) = weighted_samples(level, bit_depth);
                let bits = f64::from(WEIGHT_BITS) - f64::from(drop);
                let unit = libm::pow(2.0, bits - f64::from(down));
                (Samples::Weighted, down, unit, libm::pow(4.0, bits))
            }
        };
        if samples != Samples::Weighted {
            let back = (shifts - libm::rint(places) as usize % shifts) % shifts;
            frames.rotate_left(back);
        }
        let least_root = shifts as f64 / 2.0 * least;
        let least_power = least_root * least_root * powers * (1.0 - TIE);
        // B = (2/N) · length · √(1 + t²) / unit, here as a share of full scale in half units of `Modulation`.
        let mut factor = 2.0 / shifts as f64 / (unit * full_scale) * 32_767.5;
        let doubled = factor * core::f64::consts::SQRT_2 >= 0.999;
        if doubled {
            factor /= 2.0;
        }
        Self {
            frames,
            samples,
            weights,
            lift,
            drop,
            below_full_scale: (((1_u32 << bit_depth) - 2) as u16).cast_signed(),
            centre: ((1_u32 << (bit_depth - 1)) as u16).cast_signed(),
            below_least_power: libm::ceil(least_power.min(f64::from(i32::MAX))) as i32 - 1,
            below_least_sum_power: f32::from_bits((least_power as f32).to_bits() - 1),
            hypotenuse: LENGTH.map(|c| libm::rint(c * factor * 32_768.0) as i16),
            doubled,
            saturates: shifts < FULL_TRUST_SHIFTS,
        }
    }
}

/// [`Level`] with every constant in all lanes.
#[derive(Clone, Copy)]
pub(super) struct LevelLanes<'a, V: Lanes> {
    pub plan: &'a Level,
    pub lift: V::Count,
    /// `lift` less one bit.
    pub half_lift: V::Count,
    pub below_least_power: V::D,
    pub below_least_sum_power: V::F,
    pub centre: V::W,
    /// Full scale less one count, with its sign bit inverted.
    pub below_full_scale: V::W,
    /// Mask: a sample at full scale rejects its pixel.
    pub saturates: V::B,
    hypotenuse: [V::W; 3],
    doubled: V::Count,
}

impl<'a, V: Lanes> LevelLanes<'a, V> {
    #[inline(always)]
    pub fn new(v: V, plan: &'a Level) -> Self {
        let turn = v.splat16(i16::MIN);
        Self {
            plan,
            lift: v.left(plan.lift),
            half_lift: v.left(plan.lift.saturating_sub(1)),
            below_least_power: v.splat32(plan.below_least_power),
            below_least_sum_power: v.splat_single(plan.below_least_sum_power),
            centre: v.splat16(plan.centre),
            below_full_scale: v.xor(v.splat16(plan.below_full_scale), turn),
            saturates: v.splat8(if plan.saturates { u8::MAX } else { 0 }),
            hypotenuse: [
                v.splat16(plan.hypotenuse[0]),
                v.splat16(plan.hypotenuse[1]),
                v.splat16(plan.hypotenuse[2]),
            ],
            doubled: v.left(u8::from(plan.doubled)),
        }
    }

    /// Wrapped phase of a folded block, and modulation in units of full scale / 32767.5 (not meaningful where it is below the
    /// trusted minimum). `doubled` is [`super::source::Frames::DOUBLED`]: whether the plan's `doubled` can be set at all.
    #[inline(always)]
    pub fn fine(
        &self,
        v: V,
        angle: &AngleLanes<V>,
        folded: &Folded<V>,
        doubled: bool,
    ) -> (Demodulated<V>, [V::W; 2]) {
        let (low, t_low) = angle.fine(v, folded, 0);
        let (high, t_high) = angle.fine(v, folded, 1);
        let mut modulation = [
            hypotenuse(v, folded.length[0], t_low, self.hypotenuse),
            hypotenuse(v, folded.length[1], t_high, self.hypotenuse),
        ];
        if doubled {
            modulation = [
                v.shl_by(modulation[0], self.doubled),
                v.shl_by(modulation[1], self.doubled),
            ];
        }
        let block = Demodulated {
            phase: [low, high],
            strong: folded.strong,
            brightest: folded.brightest,
        };
        (block, modulation)
    }
}

/// The weights of a level's samples, the right shift of products before they are added, and that of the sums to words.
///
/// Samples count from the middle of their range, so that sums fit 31 bits. The weights of S add up to 0, and so do those of C:
/// the offset A drops out exactly.
fn weighted_samples(level: &pattern::Level, bit_depth: u8) -> (Vec<[i16; 2]>, u8, u8) {
    let shifts = level.shifts();
    let log_shifts = shifts.next_power_of_two().ilog2() as u8;
    let drop = (bit_depth - 1 + WEIGHT_BITS + log_shifts).saturating_sub(30);
    let angle = |k: usize| TAU * (level.start + k as f64 / shifts as f64);
    let along: Vec<f64> = (0..shifts).map(|k| libm::cos(angle(k))).collect();
    let across: Vec<f64> = (0..shifts).map(|k| libm::sin(angle(k))).collect();
    let (along, across) = (balanced(&along), balanced(&across));
    let largest = |weights: &[i16]| -> u64 {
        let sum: u64 = weights.iter().map(|w| u64::from(w.unsigned_abs())).sum();
        (sum << (bit_depth - 1)) >> drop
    };
    let mut down = 0;
    while largest(&along).max(largest(&across)) >> down > 32_700 {
        down += 1;
    }
    let weights = along.into_iter().zip(across).map(|(s, c)| [s, c]).collect();
    (weights, drop, down)
}

/// The numbers with [`WEIGHT_BITS`] fractional bits, rounded so that their sum stays 0.
fn balanced(exact: &[f64]) -> Vec<i16> {
    let scale = f64::from(1_u32 << WEIGHT_BITS);
    let mut rounded: Vec<i16> = exact.iter().map(|x| libm::rint(x * scale) as i16).collect();
    let mut over: i32 = rounded.iter().map(|&x| i32::from(x)).sum();
    while over != 0 {
        let step = over.signum();
        // The number whose rounding the other way adds the least error.
        let cost = |at: usize| {
            let error = f64::from(rounded[at]) - exact[at] * scale;
            -error * f64::from(step)
        };
        let best = (0..exact.len()).min_by(|&a, &b| cost(a).total_cmp(&cost(b)));
        let Some(best) = best else { break };
        rounded[best] -= step as i16;
        over -= step;
    }
    rounded
}
