//! The taught part in the form that production needs: weights, safe maps and the golden surface, and
//! the part of the frame that the gauges need.

use crate::recipe::file::archive::Arrays;
use crate::recipe::file::demands::LabelledFeature;
use crate::recipe::{Demands, Element, Part, RecipeSequence, Refusal, SequenceKind, safe};
use algo::adaptive::Field;
use algo::frame::SampleNoise;
use algo::geometry::Triangulator;
use algo::inspect::{Cut, Feature, Gauge, GoldenSignal, Region, RegionError, Taught, Weight};
use algo::phase::Decoder;
use algo::pipeline;
use algo::pipeline::KnownSurface;
use algo::units::{AbsolutePhase, Height, Modulation, PhaseDelta};
use rayon::prelude::*;
use std::ops::Range;

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

/// The region of a section is so many times as wide as the section, and some pixels wider: pixels
/// are not of the same size everywhere.
const WIDER: f64 = 1.2;
const BESIDE_PX: f64 = 2.0;

/// The columns of each row of a frame of (width, height) that some gauge needs: its region, half of
/// its smoothing square and around it as many pixels as the part may be displaced by, which are the
/// second value. Nothing outside is computed. A part's motion is found from all pixels that are
/// compared.
pub(super) fn window(
    (features, gauges): (&[Feature], &[Gauge]),
    (width, height): (usize, usize),
    triangulator: &Triangulator,
    demands: &Demands,
    arrays: &Arrays,
) -> (Vec<Range<usize>>, usize) {
    let (mut window, widest) = (vec![0..0; height], arrays.widest());
    let away = match demands.aligned {
        true => pixels(triangulator, demands.tolerance_mm),
        false => 0,
    };
    for gauge in gauges {
        let margin = away + gauge.measure.facts().margin_px(widest);
        let features = gauge.needs(features).filter_map(|at| features.get(at));
        for (row, columns) in features.flat_map(|feature| feature.region.spans()) {
            let left = columns.start.saturating_sub(margin);
            let right = (columns.end + margin).min(width);
            let near = row.saturating_sub(margin)..(row + margin + 1).min(height);
            for columns in &mut window[near] {
                widen(columns, left..right);
            }
        }
    }
    if demands.aligned {
        for (columns, valid) in window.iter_mut().zip(arrays.valid.chunks(width.max(1))) {
            let first = valid.iter().position(|&valid| valid != 0);
            let last = valid.iter().rposition(|&valid| valid != 0);
            if let Some((first, last)) = first.zip(last) {
                widen(columns, first..last + 1);
            }
        }
    }
    (window, away)
}

/// Gives sections the region that sees them: about their way, somewhat wider than they are.
///
/// # Errors
/// In words: one lies outside of the frame.
pub(super) fn of_sections(
    (features, labels): (&mut [Feature], &[LabelledFeature]),
    (width, height): (usize, usize),
    triangulator: &Triangulator,
) -> Result<(), Refusal> {
    let pitch = pitch(triangulator).ok_or("the camera sees no plane in its middle")?;
    for ((place, feature), label) in features.iter_mut().enumerate().zip(labels) {
        let Some(Cut {
            from: [u0, v0],
            to: [u1, v1],
            width_mm,
            ..
        }) = feature.cut
        else {
            continue;
        };
        let (along, down) = (u1 - u0, v1 - v0);
        let length = along.hypot(down);
        let half = WIDER * width_mm / 2.0 / pitch + BESIDE_PX;
        let (along, down) = (along / length * half, down / length * half);
        let corners = [
            (u0 - down, v0 + along),
            (u1 - down, v1 + along),
            (u1 + down, v1 - along),
            (u0 + down, v0 - along),
        ];
        let refused = |error: RegionError| Refusal {
            words: error.to_string(),
            of: Some(Element::new(Part::Feature, place, &label.name)),
        };
        feature.region = Region::polygon(&corners, width, height).map_err(refused)?;
    }
    Ok(())
}

fn widen(columns: &mut Range<usize>, by: Range<usize>) {
    *columns = match columns.start == columns.end {
        true => by,
        false => columns.start.min(by.start)..columns.end.max(by.end),
    };
}

/// About how many pixels the image of a part that is displaced by `mm` moves at most.
pub(in crate::recipe) fn pixels(triangulator: &Triangulator, mm: f64) -> usize {
    let middle = triangulator.camera().width() as f64 / 2.0;
    // One pixel more for rounding.
    let pixels = |pitch: f64| (mm / pitch).ceil().min(middle) as usize + 1;
    pitch(triangulator).map_or(0, pixels)
}

/// What a pixel in the middle of the frame sees of a surface that faces the camera, mm.
pub(in crate::recipe) fn pitch(triangulator: &Triangulator) -> Option<f64> {
    let camera = triangulator.camera();
    let (u, v) = (camera.width() / 2, camera.height() / 2);
    let at = |u: usize| triangulator.point(u, v, Height::from_nm(0));
    at(u).zip(at(u + 1)).map(|(a, b)| (b - a).length())
}
