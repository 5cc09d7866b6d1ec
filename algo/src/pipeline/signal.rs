//! The signal of a part: the light of each pixel as it was demodulated, for measurements that need more
//! than the phase.
//!
//! **Equation.** Z = (2/N) Σ I_k (sin 2πs_k + i cos 2πs_k) = B e^{2πiφ} over the N shifts s_k of the
//! finest level, in which samples are I_k = A + B sin 2π(φ + s_k) (`phase/fold.rs`). It is
//! linear in the light: where an edge cuts a pixel, Z is the mean of both sides.
//!
//! **Shape and unit.** Per pixel the real and the imaginary part behind each other, in 1/64 count
//! of an 8-bit sample, whatever the camera's.

use super::for_each_row;
use crate::frame::{FrameView, Samples};
use crate::pattern::Shot;
use alloc::vec;
use alloc::vec::Vec;
use core::f64::consts::TAU;

/// Steps of the signal per count.
const STEPS: f64 = 64.0;
/// Counts of an 8-bit sample at full scale.
const EIGHT_BIT: f64 = 255.0;

/// The signal of the frames of `shots`, whose samples are `full_scale` at most.
pub fn signal(shots: &[Shot], frames: &[FrameView<'_>], full_scale: u16) -> Vec<i16> {
    let finest = shots.iter().map(|shot| shot.ratio).fold(0.0, f64::max);
    let level: Vec<_> = shots
        .iter()
        .zip(frames)
        .filter(|(shot, _)| shot.ratio == finest)
        .collect();
    let Some((_, first)) = level.first() else {
        return Vec::new();
    };
    let (width, height) = (first.width(), first.height());
    let unit = 2.0 / level.len() as f64 * EIGHT_BIT / f64::from(full_scale) * STEPS;
    let mut signal = vec![[0_i16; 2]; width * height];
    for_each_row(&mut signal, width, |v, row| {
        let mut sums = vec![[0.0; 2]; row.len()];
        for (shot, frame) in &level {
            let (sin, cos) = libm::sincos(TAU * shot.shift);
            let weights = [sin * unit, cos * unit];
            match frame.row(v) {
                Samples::Eight(samples) => add(&mut sums, samples, weights),
                Samples::Sixteen(samples) => add(&mut sums, samples, weights),
            }
        }
        for (pixel, sum) in row.iter_mut().zip(sums) {
            // Casts keep to the range of their type.
            *pixel = sum.map(|part| libm::round(part) as i16);
        }
    });
    signal.into_flattened()
}

fn add<T: Copy + Into<f64>>(sums: &mut [[f64; 2]], samples: &[T], [sin, cos]: [f64; 2]) {
    for ([real, imaginary], &sample) in sums.iter_mut().zip(samples) {
        let sample: f64 = sample.into();
        *real += sin * sample;
        *imaginary += cos * sample;
    }
}

/// The mean of two signals.
pub fn mean_signal(first: &[i16], second: &[i16]) -> Vec<i16> {
    let pairs = first.iter().zip(second);
    pairs.map(|(a, b)| a.midpoint(*b)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_signal_is_the_modulation_at_the_phase_of_the_finest_level() {
        let (offset, modulation) = (100.0, 60.0);
        let shots: Vec<Shot> = Shot::level(0.25, 4).chain(Shot::level(1.0, 5)).collect();
        for phase in [0.0, 0.13, 0.5, 0.77] {
            let sample = |shot: &Shot| {
                // Other levels do not matter.
                let phase = if shot.ratio == 1.0 { phase } else { 0.3 };
                let light = offset + modulation * (TAU * (phase + shot.shift)).sin();
                [(light * 257.0).round() as u16; 2]
            };
            let samples: Vec<[u16; 2]> = shots.iter().map(sample).collect();
            let views = samples
                .iter()
                .map(|samples| FrameView::new(Samples::Sixteen(samples), 2, 1, 2).unwrap());
            let views: Vec<_> = views.collect();
            let signal = signal(&shots, &views, u16::MAX);
            let (sin, cos) = (TAU * phase).sin_cos();
            for pair in signal.chunks(2) {
                for (part, expected) in pair.iter().zip([cos, sin]) {
                    let expected = expected * modulation * STEPS;
                    assert!(
                        (f64::from(*part) - expected).abs() < 1.0,
                        "{phase}: {pair:?}"
                    );
                }
            }
            assert_eq!(signal.len(), 4);
        }
    }
}
