//! The signal of a part: the light of each pixel as it was demodulated, for measurements that need
//! more than the phase, and the mean signal by the modulation.
//!
//! **Equation.** Z = (2/N) Σ I_k (sin 2πs_k + i cos 2πs_k) = B e^{2πiφ} over the N shifts s_k of
//! the finest level, in which samples are I_k = A + B sin 2π(φ + s_k) (`phase/fold.rs`). It is
//! linear in the light: where an edge cuts a pixel, Z is the mean of both sides.
//!
//! **Shape and unit.** Per pixel the real and the imaginary part behind each other, in 1/64 count
//! of an 8-bit sample, whatever the camera's; [`CLIPPED`] where a sample is at full scale.

use super::{PhaseMap, for_each_row, map_rows};
use crate::frame::{FrameView, Samples};
use crate::pattern::{Sequence, Shot};
use crate::phase::Trust;
use alloc::vec;
use alloc::vec::Vec;
use core::f64::consts::TAU;

/// Steps of the signal per count.
const STEPS: f64 = 64.0;
/// Counts of an 8-bit sample at full scale.
const EIGHT_BIT: f64 = 255.0;

/// In both parts of a pixel whose signal is not known, because a sample is at full scale.
pub const CLIPPED: i16 = i16::MIN;

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
        let levels: Vec<_> = level.iter().map(|(_, frame)| frame.row(v)).collect();
        for (u, (pixel, sum)) in row.iter_mut().zip(sums).enumerate() {
            let clipped = levels.iter().any(|row| row.at(u) >= full_scale);
            // Casts keep to the range of their type.
            *pixel = match clipped {
                true => [CLIPPED; 2],
                false => sum.map(|part| libm::round(part) as i16),
            };
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

/// The mean signal of a resolved pixel without clipped samples by its modulation, both of the finest level: offset in
/// counts, and counts per count, neither below 0. It is the least-squares line, because not all
/// light is modulated: light from elsewhere is not, nor what blur takes. Samples have `full_scale`
/// counts at most.
pub fn signal_by_modulation(
    sequence: &Sequence,
    frames: &[FrameView<'_>],
    full_scale: u16,
    phases: &PhaseMap,
) -> [f64; 2] {
    let (Some(finest), Some(first)) = (sequence.levels().last(), frames.first()) else {
        return [0.0, 1.0];
    };
    let width = first.width();
    let finest = finest.frames.iter().map(|&at| frames[usize::from(at)]);
    let finest: Vec<FrameView<'_>> = finest.collect();
    let rows = map_rows(first.height(), |v| {
        let rows: Vec<Samples<'_>> = finest.iter().map(|frame| frame.row(v)).collect();
        // Whole numbers below 2⁶⁴: x is the modulation, y the sum of all samples.
        let mut sums = [0_u64; 5];
        for u in (0..width).filter(|u| phases.trust[v * width + u] == Trust::Resolved) {
            let x = u64::from(phases.modulation[v * width + u].to_bits());
            if rows.iter().any(|row| row.at(u) >= full_scale) {
                continue;
            }
            let y: u64 = rows.iter().map(|row| u64::from(row.at(u))).sum();
            for (sum, term) in sums.iter_mut().zip([1, x, y, x * x, x * y]) {
                *sum += term;
            }
        }
        sums
    });
    let mut sums = [0_u64; 5];
    for row in rows {
        sums.iter_mut()
            .zip(row)
            .for_each(|(sum, here)| *sum += here);
    }
    let [n, x, y, xx, xy] = sums.map(|sum| sum as f64);
    let slope = ((n * xy - x * y) / (n * xx - x * x)).max(0.0);
    let (offset, slope) = match (y - slope * x) / n {
        offset if offset > 0.0 => (offset, slope),
        _ if xx > 0.0 => (0.0, xy / xx),
        _ => return [0.0, 1.0],
    };
    let samples = finest.len() as f64;
    [
        offset / samples,
        slope / samples * f64::from(u16::MAX) / f64::from(full_scale),
    ]
}

/// The mean of two signals.
pub fn mean_signal(first: &[i16], second: &[i16]) -> Vec<i16> {
    let mean = |(a, b): (&i16, &i16)| match [*a, *b].contains(&CLIPPED) {
        true => CLIPPED,
        false => a.midpoint(*b),
    };
    first.iter().zip(second).map(mean).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pipeline::noise::tests::{frames, views};
    use crate::units::Modulation;

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

    /// A part of several shades in light from elsewhere: frames of two levels, and what is found in
    /// them.
    #[test]
    fn the_signal_follows_from_the_modulation_with_light_from_elsewhere() {
        const SIDE: usize = 64;
        let shots: Vec<Shot> = [0.25, 1.0]
            .iter()
            .flat_map(|&r| Shot::level(r, 4))
            .collect();
        let sequence = Sequence::from_frames(&shots).unwrap();
        for (elsewhere, shades) in [(12.0, 40), (0.0, 40), (30.0, 1)] {
            let modulation = |at: usize| 50.0 + (at % shades) as f64;
            // Blur takes a tenth of the modulation.
            let frames = frames(SIDE, &shots, |shot, at| {
                let turns = shot.ratio * at as f64 / 37.3 + shot.shift;
                elsewhere + modulation(at) / 0.9 * (1.0 + 0.9 * libm::sin(TAU * turns))
            });
            let views = views(SIDE, &frames);
            let mut phases = PhaseMap::new(SIDE, SIDE);
            phases.trust.fill(Trust::Resolved);
            for (at, here) in phases.modulation.iter_mut().enumerate() {
                *here = Modulation::from_bits((modulation(at) * 257.0) as u16);
            }
            let [offset, slope] = signal_by_modulation(&sequence, &views, 255, &phases);
            let signal = |b: f64| offset + slope * b;
            for b in [50.0, 50.0 + (shades - 1) as f64] {
                let found = signal(b) - (elsewhere + b / 0.9);
                assert!(
                    found.abs() < 0.1,
                    "{elsewhere}, {shades} shades, {b}: {found}"
                );
            }
            // Beyond the shades only where there are several.
            let dark = signal(0.0) - elsewhere;
            assert_eq!(dark.abs() < 0.3, shades > 1, "{dark}");
        }
        let nothing = PhaseMap::new(SIDE, SIDE);
        assert_eq!(
            signal_by_modulation(&sequence, &[], 255, &nothing),
            [0.0, 1.0]
        );
    }
}
