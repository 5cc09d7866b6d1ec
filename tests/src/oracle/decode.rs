//! Frames → absolute phase and mask of a whole recording.

use super::demodulate::{Demodulated, demodulate};
use super::unwrap::{Form, Wrapped, recognise, unwrap};
use super::{Pattern, Reason, Rig};
use hal::frame::Samples;
use hal::replay::Recording;
use rayon::prelude::*;

/// All frames of one ratio.
#[derive(Clone, Debug)]
pub struct Level {
    /// The ratio r.
    pub ratio: f64,
    /// The shift of each frame, turns.
    pub shifts: Vec<f64>,
    /// The place of each frame in the recording.
    pub frames: Vec<usize>,
}

/// Absolute phase of one pattern of a recording, row-major.
#[derive(Clone, Debug)]
pub struct PhaseTwin {
    /// How the levels were combined.
    pub form: Form,
    /// Φ in turns, NaN where rejected.
    pub phase: Vec<f64>,
    /// Σ N r² B² behind the phase, counts².
    pub information: Vec<f64>,
    /// Resolved or why not; heights have not been looked at yet.
    pub reason: Vec<Reason>,
    /// Whether a level's modulation is exactly the least that is trusted, to rounding.
    pub tie: Vec<bool>,
}

/// The levels of pattern `at`, from coarse to fine.
pub fn levels_of(recording: &Recording, at: usize) -> Vec<Level> {
    let mut levels: Vec<Level> = Vec::new();
    for (place, frame) in recording.frames.iter().enumerate() {
        if frame.pattern != at {
            continue;
        }
        if !levels.iter().any(|level| level.ratio == frame.ratio) {
            levels.push(Level {
                ratio: frame.ratio,
                shifts: Vec::new(),
                frames: Vec::new(),
            });
        }
        for level in levels.iter_mut().filter(|l| l.ratio == frame.ratio) {
            level.shifts.push(frame.shift_turns);
            level.frames.push(place);
        }
    }
    levels.sort_by(|a, b| a.ratio.total_cmp(&b.ratio));
    levels
}

/// Decodes pattern `at` of a recording; dense and single levels are unwrapped about the reference map
/// of the recording's models.
///
/// # Panics
/// If the recording's levels are of no form or need a map that its models do not give.
pub fn decode(recording: &Recording, at: usize) -> PhaseTwin {
    let pattern = Pattern::of(recording, at);
    let levels = levels_of(recording, at);
    let ratios: Vec<f64> = levels.iter().map(|level| level.ratio).collect();
    let form = recognise(&ratios, pattern.range()).expect("ratios of a known form");
    let rig = Rig::of(recording);
    let full_scale = f64::from((1_u32 << recording.bit_depth) - 1);
    let width = recording.width as usize;
    let pixels: Vec<_> = (0..width * recording.height as usize)
        .into_par_iter()
        .map(|pixel| {
            let seen: Vec<Demodulated> = levels
                .iter()
                .map(|level| demodulate(&samples(recording, level, pixel), &level.shifts))
                .collect();
            let least = least_modulation(full_scale);
            let tie = seen.iter().any(|s| (s.modulation - least).abs() < TIE);
            let map = match (form, &rig) {
                (Form::Geometric { .. }, _) => f64::NAN,
                (_, Some(rig)) => {
                    rig.reference(&pattern, (pixel % width) as f64, (pixel / width) as f64)
                }
                (_, None) => panic!("a map is needed and there are no models"),
            };
            if map.is_nan() && !matches!(form, Form::Geometric { .. }) {
                return (f64::NAN, 0.0, Reason::Unexpected, false);
            }
            if let Some(reason) = distrust(&levels, &seen, full_scale) {
                return (f64::NAN, 0.0, reason, tie);
            }
            let wrapped: Vec<Wrapped> = levels
                .iter()
                .zip(&seen)
                .map(|(level, seen)| Wrapped {
                    ratio: level.ratio,
                    turns: seen.turns,
                    information: level.shifts.len() as f64
                        * level.ratio.powi(2)
                        * seen.modulation.powi(2),
                })
                .collect();
            match unwrap(form, &wrapped, map) {
                Some((phase, information)) => (phase, information, Reason::Resolved, tie),
                None => (f64::NAN, 0.0, Reason::Residual, tie),
            }
        })
        .collect();
    PhaseTwin {
        form,
        phase: pixels.iter().map(|pixel| pixel.0).collect(),
        information: pixels.iter().map(|pixel| pixel.1).collect(),
        reason: pixels.iter().map(|pixel| pixel.2).collect(),
        tie: pixels.iter().map(|pixel| pixel.3).collect(),
    }
}

/// Sums of sines of 16-bit counts are exact to about 1e-11 of a count: a modulation of exactly 16 is not
/// below 16.
const TIE: f64 = 1e-9;

/// The least modulation that is trusted, in counts: 16 of 255.
fn least_modulation(full_scale: f64) -> f64 {
    16.0 * full_scale / 255.0
}

/// The first reason in the samples not to trust a pixel; `levels` go from coarse to fine.
fn distrust(levels: &[Level], seen: &[Demodulated], full_scale: f64) -> Option<Reason> {
    let least = least_modulation(full_scale);
    let weak = |seen: &Demodulated| seen.modulation < least - TIE;
    let saturated = levels
        .iter()
        .zip(seen)
        .any(|(level, seen)| level.shifts.len() < 8 && seen.brightest >= full_scale);
    if weak(&seen[0]) {
        Some(Reason::Dark)
    } else if seen.iter().any(weak) {
        Some(Reason::LowModulation)
    } else if saturated {
        Some(Reason::Saturated)
    } else {
        None
    }
}

/// σ of one sample in counts: the recording's, else from what N ≥ 4 shifts leave over after offset,
/// modulation and phase are fitted (N − 3 degrees of freedom), over all pixels that `reason` resolves.
pub fn sample_noise(recording: &Recording, at: usize, reason: &[Reason]) -> Option<f64> {
    if recording.noise_counts.is_some() {
        return recording.noise_counts;
    }
    let (mut squares, mut freedom) = (0.0, 0.0);
    for level in levels_of(recording, at) {
        let steps = level.shifts.len() as f64;
        if steps < 4.0 {
            continue;
        }
        for pixel in (0..reason.len()).filter(|&pixel| reason[pixel] == Reason::Resolved) {
            let samples = samples(recording, &level, pixel);
            let offset = samples.iter().sum::<f64>() / steps;
            let fit = demodulate(&samples, &level.shifts);
            for (sample, shift) in samples.iter().zip(&level.shifts) {
                let sine = (std::f64::consts::TAU * (fit.turns + shift)).sin();
                squares += (sample - offset - fit.modulation * sine).powi(2);
            }
            freedom += steps - 3.0;
        }
    }
    (freedom > 0.0).then(|| (squares / freedom).sqrt())
}

fn samples(recording: &Recording, level: &Level, pixel: usize) -> Vec<f64> {
    let sample = |&frame: &usize| match recording.frames[frame].frame.samples() {
        Samples::Eight(samples) => f64::from(samples[pixel]),
        Samples::Sixteen(samples) => f64::from(samples[pixel]),
    };
    level.frames.iter().map(sample).collect()
}
