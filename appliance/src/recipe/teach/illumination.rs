//! How long frames are exposed, and how much of the projector's light each place of a part gets, by what
//! straight fringes show of it.
//!
//! In the order of what they cost a cycle: one exposure of the whole light; less light where the part
//! mirrors it, which costs no time; longer exposures, where all of the part is dark, also with less light
//! where they would be at full scale.

use super::adaptive::Preliminary;
use super::golden::Naming;
use super::part;
use super::{LEAST_RESOLVED, TeachError};
use crate::head::calibrated::{CalibratedHead, MeasuredPart, STRAIGHT_SHIFTS};
use crate::head::rasters::Illumination;
use crate::recipe::file::MAX_EXPOSURES;
use algo::adaptive::ProjectorMap;
use algo::adaptive::amplitude::{Received, Wanted, amplitude, reach};
use algo::phase::Trust;
use algo::pipeline::PhaseMap;
use hal::error::Error;

/// Samples may reach this share of full scale, less their noise: a part that lies differently
/// reflects a little more.
const MOST: f64 = 0.9;
/// Noise that a sample may have beyond that, in σ.
const NOISE_SIGMAS: f64 = 4.0;
/// Fewer pixels at full scale, as a share of the picture, change nothing.
const FEW: f64 = 1e-3;
/// The light of the second look at places that are at full scale, in 1/255: a quarter.
const DIM: u8 = 64;
/// Below this median of the modulation, as a share of full scale, a part is dark.
const DARK: f64 = 1.0 / 16.0;
/// What longer exposures of a dark part are to reach.
const ENOUGH: f64 = 1.0 / 8.0;

/// Whether so many pixels are at full scale, in each level, that they are worth a second look: noise alone
/// takes a sample there, but not in all.
pub(super) fn shines(first: &MeasuredPart) -> bool {
    let levels = first.frames.chunks(STRAIGHT_SHIFTS).map(part::clipped);
    let both = |a: Vec<bool>, b: Vec<bool>| a.iter().zip(b).map(|(a, b)| *a && b).collect();
    let clipped = levels.reduce(both).unwrap_or_default();
    let count = clipped.iter().filter(|clipped| **clipped).count();
    count as f64 > FEW * clipped.len() as f64
}

/// `wanted` exposures, or one where the head cannot expose for longer and nobody has told so many.
pub(super) fn possible(
    wanted: u32,
    naming: &Naming,
    head: &mut CalibratedHead<'_>,
) -> Result<u32, TeachError> {
    match head.head.expose(wanted) {
        Err(Error::Unsupported { .. }) if naming.exposures.is_none() => Ok(1),
        exposed => Ok(exposed.map(|()| wanted)?),
    }
}

/// How many times as long as the head is set to frames of the part are to be exposed: as told, else once
/// unless the part is dark.
pub(super) fn wanted(first: &MeasuredPart, naming: &Naming) -> u32 {
    if let Some(told) = naming.exposures {
        return told;
    }
    let (phases, decoder) = (&first.phases, &first.decoder);
    let full_scale = decoder.full_scale();
    let found = part::of(&first.heights, &first.triangulator, naming.told());
    let found = found.ok().flatten();
    let is_part = |at: usize| found.as_ref().is_none_or(|found| found.part[at]);
    let pixels = phases.trust.len();
    let resolved = (0..pixels).filter(|&at| phases.trust[at] == Trust::Resolved && is_part(at));
    let mut counts: Vec<f64> = resolved
        .map(|at| phases.modulation[at].counts(full_scale))
        .collect();
    let are_few = |count: usize| (count as f64) < LEAST_RESOLVED * pixels as f64;
    if are_few(counts.len()) {
        // What is seen but not resolved is not too dark.
        let seen = [Trust::Saturated, Trust::Residual, Trust::OutOfRange];
        let seen = seen.map(|trust| phases.count(trust)).iter().sum();
        return if are_few(seen) { MAX_EXPOSURES } else { 1 };
    }
    let middle = counts.len() / 2;
    let median = *counts.select_nth_unstable_by(middle, f64::total_cmp).1;
    let share = median / f64::from(full_scale);
    match share < DARK {
        true => ((ENOUGH / share).ceil() as u32).clamp(2, MAX_EXPOSURES),
        false => 1,
    }
}

/// How much of a part stays at full scale, as the end of a sentence.
pub(super) fn unseen(phases: &PhaseMap) -> String {
    let [seen, unseen] = [Trust::Resolved, Trust::Saturated].map(|trust| phases.count(trust));
    match unseen {
        0 => String::new(),
        _ => format!(
            "; {:.2} % of it stays at full scale and is not measured",
            100.0 * unseen as f64 / (seen + unseen) as f64
        ),
    }
}

impl Preliminary {
    /// The part in a quarter of the light.
    ///
    /// # Errors
    /// If a device fails.
    pub(super) fn dimmed(&self, head: &mut CalibratedHead<'_>) -> Result<MeasuredPart, TeachError> {
        let dim = Illumination {
            exposures: 1,
            amplitude: vec![DIM; self.function.columns() * self.function.rows()],
        };
        Ok(head.measure_lit(&dim, &self.function, &self.shots, None, &|_| ())?)
    }

    /// The light for a part that was measured with these fringes in one exposure of their whole light and,
    /// where that is at full scale, in a quarter of it.
    pub(super) fn illumination(
        &self,
        part: &MeasuredPart,
        dimmed: Option<&MeasuredPart>,
        (exposures, naming): (u32, &Naming),
        noise_counts: f64,
    ) -> Illumination {
        let full_scale = f64::from(part.decoder.full_scale());
        // The coarsest level, which blur weakens least.
        let samples = |part: &MeasuredPart| -> [Vec<f32>; STRAIGHT_SHIFTS] {
            std::array::from_fn(|shift| part.frames[shift].counts())
        };
        let (whole, quarter) = (samples(part), dimmed.map(samples));
        let of = |shifts: &[Vec<f32>; STRAIGHT_SHIFTS], at: usize, share: f64| {
            let samples = std::array::from_fn(|shift| f64::from(shifts[shift][at]) / full_scale);
            Received::of(samples, share)
        };
        let received = (0..whole[0].len()).map(|at| {
            let light = of(&whole, at, 1.0);
            let quarter = quarter.as_ref().filter(|_| light.white.is_infinite());
            quarter.map_or(light, |quarter| of(quarter, at, f64::from(DIM) / 255.0))
        });
        let mut heights = part.heights.clone();
        for (height, dimmed) in heights
            .height
            .iter_mut()
            .zip(dimmed.iter().flat_map(|dimmed| &dimmed.heights.height))
            .filter(|(height, _)| !height.is_known())
        {
            *height = *dimmed;
        }
        let (triangulator, tolerance) = (&part.triangulator, naming.placement_tolerance_mm);
        let most = MOST - NOISE_SIGMAS * noise_counts / full_scale;
        let wanted: Vec<Wanted> = received
            .map(|light| light.wanted(exposures, most))
            .collect();
        let map = ProjectorMap::from_heights(triangulator, &heights);
        let (columns, rows) = (self.function.columns(), self.function.rows());
        let reach = reach(triangulator, &heights, tolerance, dimmed.is_some());
        Illumination {
            exposures,
            amplitude: amplitude(&map, &wanted, columns, rows, reach),
        }
    }
}
