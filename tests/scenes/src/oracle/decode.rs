//! Decoding a whole recording: frames → absolute phase and mask.

use super::demodulate::demodulate;
use super::unwrap::{Form, recognise};
use super::{Level, Pattern, PixelTwin, Reason, Rig, Scale, levels_of};
use hal::frame::Samples;
use hal::replay::Recording;
use rayon::prelude::*;

/// Absolute phase of one pattern of a recording, row-major.
#[derive(Clone, Debug)]
pub struct PhaseTwin {
    /// How the levels were combined.
    pub form: Form,
    /// Φ in turns, NaN where rejected.
    pub phase: Vec<f64>,
    /// Σ N r² · B², B of the finest level, counts²: the weight of the levels that the phase was
    /// computed from.
    pub information: Vec<f64>,
    /// Resolved or why not, before heights are computed.
    pub reason: Vec<Reason>,
    /// Whether a level's modulation is exactly at the threshold, to rounding.
    pub tie: Vec<bool>,
}

/// Decodes pattern `at` of a recording; dense and single levels are unwrapped about the reference
/// phase map of the recording's models.
///
/// # Panics
/// If the recording's levels have no known form, or need a map and the recording has no models.
pub fn decode(recording: &Recording, at: usize) -> PhaseTwin {
    let pattern = Pattern::of(recording, at);
    let levels = levels_of(recording, at);
    let ratios: Vec<f64> = levels.iter().map(|level| level.ratio).collect();
    let form = recognise(&ratios, pattern.range()).expect("ratios of a known form");
    let rig = Rig::of(recording);
    let scale = Scale::of(recording.bit_depth, recording.noise_counts);
    let width = recording.width as usize;
    let pixels: Vec<PixelTwin> = (0..width * recording.height as usize)
        .into_par_iter()
        .map(|pixel| {
            let samples: Vec<Vec<f64>> = levels
                .iter()
                .map(|level| samples(recording, level, pixel))
                .collect();
            let map = || {
                let rig = rig.as_ref().expect("a map is needed: there must be models");
                rig.reference(&pattern, (pixel % width) as f64, (pixel / width) as f64)
            };
            PixelTwin::of(form, &levels, &samples, scale, map)
        })
        .collect();
    PhaseTwin {
        form,
        phase: pixels.iter().map(|pixel| pixel.phase).collect(),
        information: pixels.iter().map(|pixel| pixel.information).collect(),
        reason: pixels.iter().map(|pixel| pixel.reason).collect(),
        tie: pixels.iter().map(PixelTwin::is_tie).collect(),
    }
}

/// σ of one sample in counts: the recording's, else estimated from the residuals of N ≥ 4 shifts
/// after fitting offset, modulation and phase (N − 3 degrees of freedom), over all pixels that are
/// resolved by `reason`.
pub fn sample_noise(recording: &Recording, at: usize, reason: &[Reason]) -> Option<f64> {
    if recording.noise_counts.is_some() {
        return recording.noise_counts;
    }
    let (mut squares, mut freedom) = (0.0, 0.0);
    for level in levels_of(recording, at) {
        let shifts = level.shifts.len() as f64;
        if shifts < 4.0 {
            continue;
        }
        for pixel in (0..reason.len()).filter(|&pixel| reason[pixel] == Reason::Resolved) {
            let samples = samples(recording, &level, pixel);
            let offset = samples.iter().sum::<f64>() / shifts;
            let fit = demodulate(&samples, &level.shifts);
            for (sample, shift) in samples.iter().zip(&level.shifts) {
                let sine = (std::f64::consts::TAU * (fit.turns + shift)).sin();
                squares += (sample - offset - fit.modulation * sine).powi(2);
            }
            freedom += shifts - 3.0;
        }
    }
    (freedom > 0.0).then(|| (squares / freedom).sqrt())
}

/// The samples of a pixel in the frames of a level, in the order of the level's shifts.
pub fn samples(recording: &Recording, level: &Level, pixel: usize) -> Vec<f64> {
    let sample = |&frame: &usize| match recording.frames[frame].frame.samples() {
        Samples::Eight(samples) => f64::from(samples[pixel]),
        Samples::Sixteen(samples) => f64::from(samples[pixel]),
    };
    level.frames.iter().map(sample).collect()
}
