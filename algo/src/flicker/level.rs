//! The frames of a level, a run of its pixels, and what the light of a frame does to them.

use crate::pattern::{Level, Waveform};
use alloc::vec::Vec;
use core::f64::consts::TAU;

/// Neighbouring pixels of a row that are looked at together: some three fringes.
pub(super) const RUN: usize = 24;
/// The mean of a run's sines is at most this: else the run is less than a fringe.
const OFF_CENTRE: f64 = 0.5;
/// Rounds of finding the signal of a pixel whose fringes moved.
const SHIFTED: usize = 3;

/// The frames of a level.
#[derive(Clone, Debug)]
pub(super) struct LevelShifts {
    /// Their places in the sequence.
    pub frames: Vec<usize>,
    /// cos and sin of 2πs_k.
    pub shifts: Vec<[f64; 2]>,
    /// N, if its fringes are no sines: of their harmonics the N-th is the same in all frames, and looks
    /// like a brightness that ripples along the fringes.
    pub harmonic: Option<usize>,
    /// What no sine explains: N − 3 orthonormal vectors with a number per frame.
    pub others: Vec<Vec<f64>>,
}

/// The change of a frame's light against the mean of its level.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FrameLight {
    /// a and b of its offset.
    pub offset: [f64; 2],
    /// g, its gain less 1.
    pub gain: f64,
    /// ε, how much farther its fringes lie than its shift says, turns: the part moved.
    pub shift: f64,
}

/// The samples of a run in each frame of a level.
pub(super) type Run = Vec<[f64; RUN]>;

/// A run of a level's pixels: A, B, and sin and cos of 2πφ.
#[derive(Clone, Debug)]
pub(super) struct SeenRun {
    pub offset: [f64; RUN],
    pub modulation: [f64; RUN],
    pub phase: [[f64; 2]; RUN],
    /// B/A of all pixels together.
    pub contrast: f64,
}

impl LevelShifts {
    /// None of a level of two shifts, which tells nothing of its light.
    pub fn of(level: &Level) -> Option<Self> {
        let count = level.shifts();
        if count < 3 {
            return None;
        }
        let shifts = (0..count).map(|k| {
            let (sin, cos) = libm::sincos(TAU * (level.start + k as f64 / count as f64));
            [cos, sin]
        });
        let wave = |harmonic: usize, of: fn(f64) -> f64| {
            let norm = if 2 * harmonic == count { 1.0 } else { 2.0 };
            let scale = libm::sqrt(norm / count as f64);
            let angle = move |k: usize| TAU * (harmonic * k) as f64 / count as f64;
            (0..count).map(|k| scale * of(angle(k))).collect()
        };
        let waves = |harmonic: usize| {
            let sine = (2 * harmonic < count).then(|| wave(harmonic, libm::sin));
            [Some(wave(harmonic, libm::cos)), sine]
                .into_iter()
                .flatten()
        };
        Some(Self {
            frames: level.frames.iter().map(|&at| usize::from(at)).collect(),
            shifts: shifts.collect(),
            harmonic: (level.waveform != Waveform::SINE).then_some(count),
            others: (2..=count / 2).flat_map(waves).collect(),
        })
    }

    /// A and the real and the imaginary part of B e^{2πiφ} of a pixel.
    #[inline]
    pub fn demodulate(&self, samples: impl Iterator<Item = f64>) -> [f64; 3] {
        let mut sums = [0.0; 3];
        for (sample, [cos, sin]) in samples.zip(&self.shifts) {
            sums[0] += sample;
            sums[1] += sample * sin;
            sums[2] += sample * cos;
        }
        let [sum, re, im] = sums.map(|sum| sum / self.count());
        [sum, 2.0 * re, 2.0 * im]
    }

    /// N.
    pub fn count(&self) -> f64 {
        self.frames.len() as f64
    }
}

impl FrameLight {
    /// What its shift adds to a sample of the signal B e^{2πiφ}, whose frame has this shift.
    fn shifted(&self, [re, im]: [f64; 2], [cos, sin]: [f64; 2]) -> f64 {
        // B sin 2π(φ + s) and B cos 2π(φ + s).
        let (wave, slope) = (im * cos + re * sin, re * cos - im * sin);
        let angle = TAU * self.shift;
        slope * angle - wave * angle * angle / 2.0
    }

    /// What a sample lacks of A where the contrast is B/A, as a share of A.
    fn less(&self, contrast: f64) -> f64 {
        self.gain - self.offset[0] - self.offset[1] * contrast
    }
}

/// A pixel's samples in the light that the frames of its level have together, whose mean A is
/// (1/N) Σ (I_k + A (g_k − a_k − b_k B/A)) / (1 + g_k), and with its fringes where the shifts say.
#[inline]
pub(super) fn steady(
    level: &LevelShifts,
    samples: &mut [f64],
    light: &[FrameLight],
    contrast: f64,
) {
    let (mut sum, mut share) = (0.0, level.count());
    for (sample, light) in samples.iter().zip(light) {
        let gain = 1.0 / (1.0 + light.gain);
        sum += sample * gain;
        share -= light.less(contrast) * gain;
    }
    let mean = sum / share;
    for (sample, light) in samples.iter_mut().zip(light) {
        *sample = (*sample + mean * light.less(contrast)) / (1.0 + light.gain);
    }
    if light.iter().all(|light| light.shift == 0.0) {
        return;
    }
    // B e^{2πiφ} is as far off as shifts are, in the next round as far as their squares.
    let mut signal = [0.0; 2];
    for _ in 0..SHIFTED {
        let pixel = samples.iter().zip(light).zip(&level.shifts);
        let moved = pixel.map(|((sample, light), shift)| sample - light.shifted(signal, *shift));
        [_, signal[0], signal[1]] = level.demodulate(moved);
    }
    for ((sample, light), shift) in samples.iter_mut().zip(light).zip(&level.shifts) {
        *sample -= light.shifted(signal, *shift);
    }
}

/// Takes a harmonic of the fringes out of the brightness of a run.
fn flatten(offset: &mut [f64; RUN], phase: &[[f64; 2]; RUN], harmonic: usize) {
    let mean = offset.iter().sum::<f64>() / RUN as f64;
    let waves = phase.map(|[sin, cos]| {
        let turned = |[s, c]: [f64; 2]| [s * cos + c * sin, c * cos - s * sin];
        (0..harmonic).fold([0.0, 1.0], |wave, _| turned(wave))
    });
    for part in [0, 1] {
        let (mut product, mut square) = (0.0, f64::MIN_POSITIVE);
        for (offset, wave) in offset.iter().zip(&waves) {
            product += (offset - mean) * wave[part];
            square += wave[part] * wave[part];
        }
        for (offset, wave) in offset.iter_mut().zip(&waves) {
            *offset -= product / square * wave[part];
        }
    }
}

impl SeenRun {
    /// Of pixels whose sample in frame k is `sample(k, pixel)`.
    pub fn of(level: &LevelShifts, sample: impl Fn(usize, usize) -> f64) -> Self {
        let [mut offset, mut modulation] = [[0.0; RUN]; 2];
        let mut phase = [[0.0; 2]; RUN];
        for at in 0..RUN {
            let pixel = (0..level.frames.len()).map(|k| sample(k, at));
            let [mean, re, im] = level.demodulate(pixel);
            let length = libm::sqrt(re * re + im * im);
            (offset[at], modulation[at]) = (mean, length);
            phase[at] = [im / length, re / length];
        }
        if let Some(harmonic) = level.harmonic {
            flatten(&mut offset, &phase, harmonic);
        }
        Self {
            contrast: modulation.iter().sum::<f64>() / offset.iter().sum::<f64>(),
            offset,
            modulation,
            phase,
        }
    }

    /// Whether all pixels have more modulation than `least`.
    pub fn is_lit(&self, least: f64) -> bool {
        self.modulation.iter().all(|modulation| *modulation > least)
    }

    /// Whether its phases lie on one side of the circle: they are of less than a fringe, or wrong.
    pub fn is_one_sided(&self) -> bool {
        let sum = |part: usize| self.phase.iter().map(|phase| phase[part]).sum::<f64>();
        [0, 1]
            .iter()
            .any(|&part| sum(part).abs() > OFF_CENTRE * RUN as f64)
    }

    /// B/A of each pixel over that of all, less 1.
    pub fn ripple(&self) -> [f64; RUN] {
        let ratio = |at: usize| self.modulation[at] / (self.offset[at] * self.contrast);
        core::array::from_fn(|at| ratio(at) - 1.0)
    }
}
