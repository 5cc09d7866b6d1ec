//! The taught part in the form that production needs: weights, safe maps and the golden surface.

use crate::recipe::archive::Arrays;
use crate::recipe::{RecipeSequence, SequenceKind, safe};
use algo::adaptive::Field;
use algo::frame::SampleNoise;
use algo::inspect::{Feature, Gauge, GoldenSignal, Taught, Weight};
use algo::phase::Decoder;
use algo::pipeline::{self, KnownSurface};
use algo::units::{AbsolutePhase, Height, Modulation, PhaseDelta};
use rayon::prelude::*;

/// The weight of each pixel's deviation, which lies by these `shares` along the normal, and the
/// uncertainty of its taught height. The sequence has `brighter` times the modulation of golden;
/// `noise` is a function of golden's modulation.
pub(super) fn taught(
    (noise, brighter): (SampleNoise, f64),
    arrays: &Arrays,
    shares: &[f32],
    decoder: &Decoder,
) -> Taught {
    let full_scale = f64::from(decoder.full_scale());
    let noises = arrays.modulation.iter().zip(&*arrays.height_slope);
    let sigmas = noises.map(|(&counts, &slope)| {
        let share = (f64::from(counts) / full_scale * 65_535.0).round() as u16;
        let turns = decoder.phase_noise(Modulation::from_bits(share), noise) / brighter;
        turns * f64::from(slope).abs()
    });
    let valid = arrays.valid.iter().zip(&*arrays.golden_height);
    let weights = valid.map(|(&valid, height)| match height.is_finite() {
        true => Weight::from_bits(valid),
        false => Weight::NONE,
    });
    let pixels = weights.zip(shares).zip(sigmas);
    let taught = Taught::new(pixels.map(|((weight, &share), sigma)| (weight, share, sigma)));
    taught.with_least_sides(arrays.smoothing.to_vec())
}

/// σ of a sample, the same at all pixels, with which σ_z of the compared part has the RMS that it
/// has by `noise`; counts.
pub(super) fn even_noise(noise: SampleNoise, arrays: &Arrays) -> f64 {
    let compared = (0..arrays.valid.len()).filter(|&at| arrays.valid[at] != 0);
    let (mut sum, mut weights) = (0.0, 0.0);
    for at in compared {
        let counts = f64::from(arrays.modulation[at]);
        let weight = (f64::from(arrays.height_slope[at]) / counts).powi(2);
        if weight.is_finite() {
            sum += weight * noise.at(counts).powi(2);
            weights += weight;
        }
    }
    match weights > 0.0 {
        true => (sum / weights).sqrt(),
        false => noise.at(0.0),
    }
}

/// The phase that a sequence is unwrapped about and compared with: golden's phase by this sequence,
/// which is `offset` more than that by the full sequence. For a sequence of limited reach it is
/// unknown where a placement could move the phase further than the reach. `None` if it is the phase
/// of the golden surface, which is that by the sequence with the offset `base`.
pub(super) fn map(
    arrays: &Arrays,
    kind: SequenceKind,
    (offset, base): (&[i16], &[i16]),
) -> Option<Vec<AbsolutePhase>> {
    match kind.reach() {
        Some(limit) => Some(safe(&phase(arrays, offset), &arrays.phase_reach, limit)),
        None => (!base.is_empty()).then(|| phase(arrays, offset)),
    }
}

/// Golden's phase by a sequence less that by the full one; empty if they are the same.
pub(super) fn offset(arrays: &Arrays, at: Option<usize>) -> &[i16] {
    let pixels = arrays.golden_phase.len();
    at.map_or(&[], |at| &arrays.sequence_offset[at * pixels..][..pixels])
}

/// Golden's phase by the sequence with this offset; an empty one is 0.
fn phase(arrays: &Arrays, offset: &[i16]) -> Vec<AbsolutePhase> {
    let by = |(at, &turns): (usize, &f64)| match AbsolutePhase::from_turns(turns) {
        AbsolutePhase::UNKNOWN => AbsolutePhase::UNKNOWN,
        full => full + delta(offset, at),
    };
    arrays.golden_phase.par_iter().enumerate().map(by).collect()
}

/// Golden's signal, which is by the last of the sequences; `None` if no gauge is of a contour.
pub(super) fn signal(
    arrays: &mut Arrays,
    sequences: &[RecipeSequence],
    (features, gauges): (&[Feature], &[Gauge]),
    lenient: bool,
) -> Option<GoldenSignal> {
    let values = std::mem::take(&mut arrays.golden_signal);
    let is_contour = |at: usize| features[at].kind.is_contour();
    let is_needed = gauges
        .iter()
        .any(|gauge| gauge.needs(features).any(is_contour));
    let finest = sequences.last()?.levels.levels().last()?;
    (is_needed && !values.is_empty()).then(|| GoldenSignal {
        values,
        ratio: finest.ratio,
        shifts: finest.shifts(),
        brighter: 1.0,
        lenient,
    })
}

/// The offset of a pixel.
fn delta(offset: &[i16], at: usize) -> PhaseDelta {
    PhaseDelta::from_bits(offset.get(at).copied().map_or(0, i32::from))
}

/// The surface that deviations refer to, as the sequence with this offset measured it. Where golden
/// has none, such as in an opening, it is interpolated from the surface around: material that
/// should not be there must be found, by the full sequence at least.
pub(super) fn surface(width: usize, arrays: &Arrays, offset: &[i16]) -> KnownSurface {
    let mut height = vec![Height::UNKNOWN; arrays.golden_height.len()];
    pipeline::for_each_row(&mut height, width, |v, row| {
        let places = v * width..(v + 1) * width;
        let taught = places.map(|at| match arrays.golden_height[at] {
            mm if offset.is_empty() => f64::from(mm),
            mm => f64::from(mm) + delta(offset, at).turns() * f64::from(arrays.height_slope[at]),
        });
        let mut line = Field {
            columns: width,
            values: taught.collect(),
        };
        line.fill_rows(0.0);
        for (height, mm) in row.iter_mut().zip(line.values) {
            *height = Height::from_mm(mm);
        }
    });
    KnownSurface {
        width,
        phase: phase(arrays, offset),
        height,
    }
}
