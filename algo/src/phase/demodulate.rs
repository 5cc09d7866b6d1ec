//! N-step demodulation: samples of one level → wrapped phase and modulation.
//!
//! S = Σ I_k cos 2πs_k, C = Σ I_k sin 2πs_k, φ = atan2(S, C)/2π, B = (2/N)·√(S² + C²), for
//! I_k = A + B sin 2π(φ + s_k) (Peng & Gupta 2008, eq. 1 with a phase step; the generalised
//! N-step method). For N = 4 and shifts k/4 this is exactly S = I₀ − I₂, C = I₁ − I₃.
//!
//! Integer: the weights are Q20, sums of up to 64 samples of 16 bits need 43 bits, and are then
//! brought to at most 30 bits, so that S² + C² < 2⁶¹. The weights' rounding moves the phase by at
//! most 2⁻²⁰ · A/B turn.

use super::trust::MIN_MODULATION_8_BIT;
use crate::frame::Sample;
use crate::math::atan::atan2_u16;
use crate::pattern::Level;
use alloc::vec::Vec;
use core::f64::consts::TAU;

/// Levels of at least this many shifts are trusted even with samples at full scale: the periodic
/// error of a slight saturation falls from 3e-3 to 7e-4 turn.
pub const FULL_TRUST_STEPS: usize = 8;

/// Fractional bits of the weights.
const WEIGHT_BITS: u32 = 20;
/// Modulations of exactly the minimum are trusted: what the weights' rounding can take from S² + C²
/// there, as a share (2 · 255 · 2⁻²¹ / 8 at 8 bit is 3e-5; far below the step of one count).
const TIE: f64 = 1e-4;
/// Bits of S and C after normalisation.
const SUM_BITS: u32 = 30;

/// A level prepared for demodulation at one bit depth.
#[derive(Clone, Debug)]
pub(super) struct LevelKernel {
    /// Per shift: place of the frame in the sequence, cos and sin of its shift in Q20.
    taps: Vec<Tap>,
    /// Right shift that brings the sums to [`SUM_BITS`].
    shift: u32,
    /// Smallest trusted S² + C².
    power_min: u64,
    /// √(S² + C²) → modulation in units of full scale / 65535, Q32.
    modulation_scale: u64,
    /// A sample that rejects its pixel; above full scale where saturation is tolerated.
    saturated_from: i32,
}

#[derive(Clone, Copy, Debug)]
struct Tap {
    frame: usize,
    cos: i64,
    sin: i64,
}

/// What one level says about one pixel.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct LevelPixel {
    /// Wrapped phase, units of 1/65536 turn.
    pub phase: u16,
    /// Modulation, units of full scale / 65535.
    pub modulation: u16,
    /// The modulation is below the trusted minimum.
    pub weak: bool,
    /// A sample is at full scale (in a level where that matters).
    pub saturated: bool,
}

impl LevelKernel {
    pub fn new(level: &Level, bit_depth: u8) -> Self {
        let steps = level.steps();
        let full_scale = (1_u32 << bit_depth) - 1;
        let weight = |x: f64| libm::rint(x * f64::from(1_u32 << WEIGHT_BITS)) as i64;
        let taps = (0..steps)
            .map(|k| {
                let angle = TAU * (level.start + k as f64 / steps as f64);
                Tap {
                    frame: usize::from(level.frames[k]),
                    cos: weight(libm::cos(angle)),
                    sin: weight(libm::sin(angle)),
                }
            })
            .collect();
        let sum_bits = u32::from(bit_depth) + steps.next_power_of_two().ilog2() + WEIGHT_BITS;
        let shift = sum_bits.saturating_sub(SUM_BITS);
        // B = (2/N) · √power / unit, where `unit` is what one count weighs in S and C.
        let unit = f64::from(1_u32 << WEIGHT_BITS) / libm::pow(2.0, f64::from(shift));
        let half_steps = steps as f64 / 2.0;
        let min = MIN_MODULATION_8_BIT * f64::from(full_scale) / 255.0;
        let min_root = half_steps * min * unit;
        let modulation_scale = 65_535.0 / (f64::from(full_scale) * half_steps * unit);
        Self {
            taps,
            shift,
            power_min: libm::ceil(min_root * min_root * (1.0 - TIE)) as u64,
            modulation_scale: libm::rint(modulation_scale * 4_294_967_296.0) as u64,
            saturated_from: if steps < FULL_TRUST_STEPS {
                full_scale as i32
            } else {
                i32::MAX
            },
        }
    }

    /// Demodulates one row; `rows` holds the row of every frame of the sequence.
    pub fn row<T: Sample>(&self, rows: &[&[T]], out: &mut [LevelPixel]) {
        for (u, pixel) in out.iter_mut().enumerate() {
            *pixel = self.pixel(|frame| rows[frame][u].count());
        }
    }

    #[inline(always)]
    fn pixel(&self, sample: impl Fn(usize) -> i32) -> LevelPixel {
        let (mut s, mut c, mut brightest) = (0_i64, 0_i64, 0_i32);
        for tap in &self.taps {
            let count = sample(tap.frame);
            s += i64::from(count) * tap.cos;
            c += i64::from(count) * tap.sin;
            brightest = brightest.max(count);
        }
        let half = (1_i64 << self.shift) >> 1;
        let (s, c) = ((s + half) >> self.shift, (c + half) >> self.shift);
        let power = (s * s + c * c) as u64;
        let modulation = (power.isqrt() * self.modulation_scale + (1 << 31)) >> 32;
        LevelPixel {
            phase: atan2_u16(s as i32, c as i32),
            modulation: modulation.min(65_535) as u16,
            weak: power < self.power_min,
            saturated: brightest >= self.saturated_from,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pattern::Sequence;
    use std::vec::Vec;

    /// Half a unit of the angle, the arctangent's 1e-7, and the weights' share.
    const PHASE_BOUND: f64 = 0.5 / 65_536.0 + 1e-6;

    fn kernel(shifts: &[f64], depth: u8) -> LevelKernel {
        let frames: Vec<_> = shifts.iter().map(|&shift| (1.0, shift)).collect();
        LevelKernel::new(&Sequence::from_frames(&frames).unwrap().levels()[0], depth)
    }

    /// Rounded samples cannot be compared with the true phase; with the textbook formula on the
    /// same samples they can.
    fn textbook(samples: &[u16], shifts: &[f64]) -> (f64, f64) {
        let (mut s, mut c) = (0.0, 0.0);
        for (&sample, &shift) in samples.iter().zip(shifts) {
            s += f64::from(sample) * libm::cos(TAU * shift);
            c += f64::from(sample) * libm::sin(TAU * shift);
        }
        let modulation = 2.0 / samples.len() as f64 * libm::sqrt(s * s + c * c);
        (libm::atan2(s, c) / TAU, modulation)
    }

    #[test]
    fn any_number_of_steps_at_any_depth_agrees_with_the_textbook() {
        for depth in 8..=16_u8 {
            let full = f64::from((1_u32 << depth) - 1);
            for steps in (3..=16).chain([33, 64]) {
                for start in [0.0, 0.25, -0.37] {
                    let shifts: Vec<f64> = (0..steps)
                        .map(|k| start - f64::from(k) / f64::from(steps))
                        .collect();
                    let kernel = kernel(&shifts, depth);
                    for i in 0..40 {
                        let phase = f64::from(i) / 40.0 + 0.003;
                        let samples: Vec<u16> = shifts
                            .iter()
                            .map(|s| {
                                let light = 0.5 + 0.4 * libm::sin(TAU * (phase + s));
                                libm::rint(full * light) as u16
                            })
                            .collect();
                        let found = kernel.pixel(|frame| samples[frame].count());
                        let (turns, counts) = textbook(&samples, &shifts);
                        let error = f64::from(found.phase) / 65_536.0 - turns;
                        assert!((error - libm::rint(error)).abs() <= PHASE_BOUND, "{error}");
                        let modulation = f64::from(found.modulation) * full / 65_535.0;
                        assert!((modulation - counts).abs() <= full / 65_535.0 + 1e-3);
                        assert!(!found.weak && !found.saturated);
                    }
                }
            }
        }
    }

    #[test]
    fn the_modulation_threshold_is_sixteen_counts_exactly() {
        let kernel = kernel(&[0.0, 0.25, 0.5, 0.75], 8);
        let pixel = |samples: [u8; 4]| kernel.pixel(|frame| samples[frame].count());
        assert!(!pixel([132, 100, 100, 100]).weak);
        assert!(pixel([131, 100, 100, 100]).weak);
        assert_eq!(pixel([132, 100, 100, 100]).modulation, 16 * 257);
    }

    #[test]
    fn constant_frames_are_weak_and_full_scale_is_saturated_below_eight_steps() {
        for steps in [3_u8, 4, 5, 7, 8, 9] {
            let shifts: Vec<f64> = (0..steps)
                .map(|k| f64::from(k) / f64::from(steps))
                .collect();
            let kernel = kernel(&shifts, 8);
            let pixel = kernel.pixel(|_| 255);
            assert!(pixel.weak);
            assert_eq!(pixel.saturated, steps < 8);
            assert!(!kernel.pixel(|_| 254).saturated);
        }
    }
}
