//! The error of a part's heights, divided into noise and what remains without it.

use super::measure;
use crate::experiment::{OpticsKind, Run, Scene};
use algo::phase::Trust;
use appliance::head::calibrated::MeasureError;
use appliance::measure::{GROSS_MM, Truth};
use serde::Serialize;

/// The error of one part with one setting of the optics, mm.
#[derive(Clone, Debug, Serialize)]
pub struct Share {
    /// The part.
    pub part: &'static str,
    /// The optics.
    pub optics: &'static str,
    /// RMS error with the study's noise.
    pub total_mm: f64,
    /// RMS error without noise; the camera rounds.
    pub systematic_mm: f64,
    /// √(total² − systematic²).
    pub noise_mm: f64,
    /// RMS of the σ that is stated for the pixels.
    pub stated_mm: f64,
    /// 99 % of the errors without noise are smaller.
    pub systematic_p99_mm: f64,
}

/// The division, and the map of the errors without noise: mm, row-major, NaN where they are not
/// known.
pub struct Budget {
    /// The division.
    pub share: Share,
    /// Columns and rows of the map.
    pub size: [u32; 2],
    /// The map.
    pub bias_mm: Vec<f32>,
}

/// Measures a part with the noise of `seed` and without.
///
/// # Errors
/// If the part cannot be simulated or measured.
pub fn budget(scene: &Scene, optics: OpticsKind, seed: u64) -> Result<Budget, MeasureError> {
    let (noisy, run) = measure(scene, optics, seed)?;
    let with_noise = errors(&Truth::from(noisy.truth()), noisy.truth(), &run);
    let sigmas = run.measured.heights.sigma.iter().zip(&with_noise);
    let sigmas = sigmas.filter(|(_, error)| !error.is_nan());
    let stated = rms(sigmas.map(|(&sigma, _)| f64::from(sigma)));
    let quiet = Scene {
        noise_counts: 0.0,
        ..scene.clone()
    };
    let (runner, run) = measure(&quiet, optics, seed)?;
    let bias_mm = errors(&Truth::from(runner.truth()), runner.truth(), &run);
    let known = |errors: &[f32]| -> Vec<f64> {
        let known = errors.iter().filter(|error| !error.is_nan());
        known.map(|&error| f64::from(error)).collect()
    };
    let total = rms(known(&with_noise).into_iter());
    let mut biases = known(&bias_mm);
    let systematic = rms(biases.iter().copied());
    biases.sort_by(|a, b| a.abs().total_cmp(&b.abs()));
    let p99 = biases.get(biases.len() * 99 / 100);
    let width = run.measured.heights.width.max(1);
    Ok(Budget {
        share: Share {
            part: scene.name,
            optics: optics.word(),
            total_mm: total,
            systematic_mm: systematic,
            noise_mm: (total * total - systematic * systematic).max(0.0).sqrt(),
            stated_mm: stated,
            systematic_p99_mm: p99.map_or(f64::NAN, |error| error.abs()),
        },
        size: [width as u32, (bias_mm.len() / width) as u32],
        bias_mm,
    })
}

/// The errors of the resolved, wholly lit pixels but the gross ones, mm; NaN elsewhere.
fn errors(known: &Truth<'_>, truth: &sim::Truth, run: &Run) -> Vec<f32> {
    let (heights, trust) = (&run.measured.heights.height, &run.measured.phases.trust);
    let mut errors = vec![f32::NAN; heights.len()];
    for at in known.whole_pixels() {
        let error = heights[at].mm() - f64::from(truth.height[at]);
        if trust[at] == Trust::Resolved && error.abs() <= GROSS_MM {
            errors[at] = error as f32;
        }
    }
    errors
}

fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (mut squares, mut count) = (0.0, 0.0);
    for value in values {
        squares += value * value;
        count += 1.0;
    }
    (squares / f64::max(count, 1.0)).sqrt()
}
