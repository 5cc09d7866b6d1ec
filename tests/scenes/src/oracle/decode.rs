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
    /// B of the finest level, as a share of full scale.
    pub modulation: Vec<f64>,
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
        modulation: pixels.iter().map(PixelTwin::modulation).collect(),
        reason: pixels.iter().map(|pixel| pixel.reason).collect(),
        tie: pixels.iter().map(PixelTwin::is_tie).collect(),
    }
}

/// σ of one sample in counts: the recording's, else estimated from the residuals of N ≥ 4 shifts
/// after fitting offset, modulation and phase of each pixel (N − 3 degrees of freedom), and in each
/// run of pixels the harmonics 2 to N − 2 that a response adds to all of them alike, over all pixels
/// that are resolved by `reason` and have no clipped sample.
pub fn sample_noise(recording: &Recording, at: usize, reason: &[Reason]) -> Option<f64> {
    if recording.noise_counts.is_some() {
        return recording.noise_counts;
    }
    let (mut squares, mut freedom) = (0.0, 0.0);
    let full = Scale::of(recording.bit_depth, None).full;
    let levels = levels_of(recording, at);
    let is_whole = |pixel: usize| {
        let mut all = levels
            .iter()
            .flat_map(|level| samples(recording, level, pixel));
        all.all(|sample| sample < full)
    };
    for level in &levels {
        let shifts = level.shifts.len() as f64;
        if shifts < 4.0 {
            continue;
        }
        let width = recording.width as usize;
        for run in (0..reason.len() / width).flat_map(|row| {
            let pixels = row * width..(row + 1) * width;
            pixels
                .step_by(RUN)
                .map(move |from| from..(from + RUN).min((row + 1) * width))
        }) {
            let resolved = run.filter(|&at| reason[at] == Reason::Resolved && is_whole(at));
            let resolved: Vec<_> = resolved
                .map(|pixel| samples(recording, level, pixel))
                .collect();
            let left = left_of_run(&resolved, &level.shifts);
            squares += left.0;
            freedom += left.1;
        }
    }
    (freedom > 0.0).then(|| (squares / freedom).sqrt())
}

/// Pixels of a row that a response adds the same harmonics to. Part of the definition.
const RUN: usize = 64;
/// A harmonic whose square is less than this share of its own beside the others is none of its own.
/// Part of the definition.
const ALIKE: f64 = 1e-6;

/// The sum of squares that sines with harmonics leave of some pixels, and its degrees of freedom.
fn left_of_run(pixels: &[Vec<f64>], shifts: &[f64]) -> (f64, f64) {
    let fits: Vec<_> = pixels.iter().map(|of| demodulate(of, shifts)).collect();
    let turns = |order: f64, function: fn(f64) -> f64| {
        let samples = fits.iter().flat_map(|fit| {
            let at = move |shift: &f64| std::f64::consts::TAU * order * (fit.turns + shift);
            shifts
                .iter()
                .map(move |shift| fit.modulation * function(at(shift)))
        });
        samples.collect::<Vec<f64>>()
    };
    let sines = turns(1.0, f64::sin);
    let means = pixels.iter().flat_map(|of| {
        let mean = of.iter().sum::<f64>() / shifts.len() as f64;
        of.iter().map(move |sample| sample - mean)
    });
    let mut left: Vec<f64> = means
        .zip(&sines)
        .map(|(sample, sine)| sample - sine)
        .collect();
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let mut basis: Vec<Vec<f64>> = Vec::new();
    for order in 2..shifts.len() - 1 {
        for function in [f64::cos as fn(f64) -> f64, f64::sin] {
            let mut column = turns(order as f64, function);
            let own = dot(&column, &column);
            // Twice, as rounding asks for.
            for known in basis.iter().chain(&basis) {
                let along = dot(known, &column);
                column
                    .iter_mut()
                    .zip(known)
                    .for_each(|(x, known)| *x -= along * known);
            }
            let size = dot(&column, &column);
            if size > ALIKE * own {
                column.iter_mut().for_each(|x| *x /= size.sqrt());
                basis.push(column);
            }
        }
    }
    for known in &basis {
        let along = dot(known, &left);
        left.iter_mut()
            .zip(known)
            .for_each(|(x, known)| *x -= along * known);
    }
    let free = pixels.len() as f64 * (shifts.len() as f64 - 3.0) - basis.len() as f64;
    (dot(&left, &left), free.max(0.0))
}

/// The samples of a pixel in the frames of a level, in the order of the level's shifts.
pub fn samples(recording: &Recording, level: &Level, pixel: usize) -> Vec<f64> {
    let sample = |&frame: &usize| match recording.frames[frame].frame.samples() {
        Samples::Eight(samples) => f64::from(samples[pixel]),
        Samples::Sixteen(samples) => f64::from(samples[pixel]),
    };
    level.frames.iter().map(sample).collect()
}
