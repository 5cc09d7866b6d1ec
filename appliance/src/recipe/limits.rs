//! Sets the squares and the limits of the gauges that teaching proposes, by what good parts are
//! predicted to read and by what golden reads at other places.
//!
//! `proof` tries them on golden, on displaced parts and on the part itself.

use super::archive::Arrays;
use super::failure::TeachError;
use super::golden::GoldenPart;
use super::good_parts::{BEND, DENT, DEVIATION_MM, GoodPartsFile, Noise};
use super::plan::window;
use super::proof::{self, COVERAGE_CHANGE, Magnitudes, Proof};
use super::refusal;
use super::{GaugeFile, RecipeFile, SequenceFile};
use crate::station::Inspection;
use crate::system::headway::Headway;
use algo::inspect::{Basis, Measure, eroded};
use algo::pipeline::KnownSurface;

/// How far what displaced parts deviate by scatters from placement to placement, as a multiple of what golden
/// misses of them.
const BEND_SPREAD: f64 = 0.12;

impl GoldenPart<'_> {
    /// Sets the squares and the limits of the gauges by what good parts are predicted to read,
    /// wherever they lie within the placement tolerance; overwrites `arrays.valid` (0 or 1) with
    /// the weights of the pixels and `arrays.smoothing` with the sides of their squares. Returns
    /// what to say of it. `limit_mm` is the limit of the deviation that is asked for; without one none is
    /// promised.
    ///
    /// # Errors
    /// If good parts would not keep that limit, or the recipe cannot be planned.
    pub(super) fn set_limits(
        &self,
        surface: KnownSurface,
        manifest: &mut RecipeFile,
        arrays: &mut Arrays,
        limit_mm: Option<f64>,
        headway: Headway<'_>,
    ) -> Result<Vec<String>, TeachError> {
        let (sequences, production) = (&manifest.sequences, manifest.production);
        let expected = sequences[production..].iter();
        let expected = expected.filter_map(|of| self.expected_coverage(of, &arrays.phase_reach));
        let coverage = expected.fold(f64::INFINITY, f64::min) - COVERAGE_CHANGE;
        let noise = self.noise(surface, arrays, sequences, production);
        let away = window::pixels(&self.triangulator, manifest.placement_tolerance_mm);
        let mut words = Vec::new();
        if self.surroundings.is_some() && noise.leaves_open(&arrays.valid) {
            // A pixel at the rim may see what surrounds the part, and where the part lies is not known.
            let valid: Vec<bool> = arrays.valid.iter().map(|valid| *valid != 0).collect();
            let inside = eroded(&valid, self.heights.width, away);
            arrays.valid = inside.into_iter().map(u8::from).collect();
            words.push(format!(
                "heights leave open how far the part is moved along its surface: its rims are not compared within {} mm",
                manifest.placement_tolerance_mm
            ));
        }
        let weighing = headway.part(0.0, 0.2);
        let asked = limit_mm.unwrap_or(DEVIATION_MM);
        let mut weighed = noise.weigh(&arrays.valid, asked, weighing.part(0.0, 0.7));
        let held = weighed.found.limit_mm;
        if limit_mm.is_some() && held > asked {
            return Err(TeachError::Scene(refusal::too_noisy(asked, held)));
        }
        arrays.valid = weighed.bits().into();
        for gauge in &mut manifest.gauges {
            match gauge.measures.facts().basis {
                Basis::Squares(_) => set_deviation(gauge, &weighed.found),
                // The coverage of the whole frame; that of openings has an upper limit.
                Basis::Pixels => gauge.low = gauge.low.map(|_| coverage.max(0.0)),
                _ => {}
            }
        }
        let (sides, bend) = weighed.settle(&noise, away, weighing.part(0.7, 1.0));
        let mut good_parts = weighed.found;
        let pixel_mm = window::pitch(&self.triangulator).unwrap_or_default();
        good_parts.dent_mm = DENT * sides.smallest as f64 * pixel_mm;
        set_deviation(&mut manifest.gauges[0], &good_parts);
        drop((weighed, noise));
        arrays.smoothing = sides.least.into();
        let proof = Proof::new(manifest, arrays, self.calibration, headway.part(0.2, 0.35));
        let proof = proof?;
        let mut judged = proof.displaced(headway.part(0.35, 1.0));
        drop(proof);
        if let Some(magnitudes) = Magnitudes::of(&judged, 0) {
            (good_parts.displaced_mm, good_parts.displaced_scatter_mm) = (
                magnitudes.middle.max(BEND * bend),
                magnitudes.spread.hypot(BEND_SPREAD * bend),
            );
            let value = |inspection: &Inspection| inspection.gauges.first()?.value;
            judged.retain(|of| value(of).is_none_or(|value| !magnitudes.is_wrong(value)));
        }
        words.extend(good_parts.words());
        words.extend(proof::leave_out_covered(manifest, &mut judged));
        manifest.good_parts = Some(good_parts);
        if limit_mm.is_some()
            && let Some(exceeded) = refusal::exceeded(manifest, &judged)
        {
            let cause = self.cause(exceeded.square, &arrays.golden_height);
            return Err(exceeded.refusal(cause));
        }
        words.extend(proof::hold(manifest, &judged));
        manifest.tried = proof::tried(manifest, &judged);
        let tolerance_mm = manifest.placement_tolerance_mm;
        words.extend(manifest.tried.iter().map(|of| of.words(tolerance_mm)));
        Ok(words)
    }

    /// The noise of the part by the sequence that it is measured with first.
    fn noise<'a>(
        &'a self,
        surface: KnownSurface,
        arrays: &Arrays,
        sequences: &[SequenceFile],
        production: usize,
    ) -> Noise<'a> {
        let first = &sequences[production];
        let production = {
            let variance = self.variance(first.kind, &first.frames, arrays);
            (0..arrays.valid.len())
                .map(|at| variance(at) as f32)
                .collect()
        };
        // Golden's phase is that by the first sequence, or by the full one, the last.
        let golden = match sequences.last().filter(|_| self.offsets.is_empty()) {
            Some(full) => (full.sigma_mm / first.sigma_mm.max(f64::MIN_POSITIVE)).powi(2),
            None => 1.0,
        };
        Noise {
            triangulator: &self.triangulator,
            surface,
            phases: &self.phases,
            production,
            golden: golden / self.captures as f64,
        }
    }
}

/// Gives a deviation the squares and the limit of a prediction.
fn set_deviation(gauge: &mut GaugeFile, good_parts: &GoodPartsFile) {
    let limit = good_parts.limit_mm;
    (gauge.low, gauge.high) = (Some(-limit), Some(limit));
    let smoothing_px = good_parts.smoothing_px;
    gauge.measures = Measure::of_shape(smoothing_px);
}
