//! Sets the squares and the limits of the gauges that teaching proposes, by what good parts are
//! predicted to read and by what golden reads at other places.
//!
//! `proof` tries them on golden, on displaced parts and on the part itself.
//!
//! A limit of the deviation that good parts would not keep is never widened: the person who asks for
//! a wider one has to say so.

use super::golden::GoldenPart;
use super::good_parts::{BEND, DENT, DEVIATION_MM, Noise, rounded_up};
use super::proof::{COVERAGE_CHANGE, Magnitudes, Proof, band};
use super::{TeachError, proof};
use crate::recipe::file::GoodPartsFile;
use crate::recipe::file::archive::Arrays;
use crate::recipe::plan::taught;
use crate::recipe::{GaugeFile, RecipeFile, SequenceFile};
use crate::station::{Inspection, Square};
use crate::system::headway::Headway;
use algo::inspect::{Basis, Measure, eroded};
use algo::phase::Trust;
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
    pub(crate) fn set_limits(
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
        let away = taught::pixels(&self.triangulator, manifest.placement_tolerance_mm);
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
            return Err(TeachError::Scene(too_noisy(asked, held)));
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
        let pixel_mm = taught::pitch(&self.triangulator).unwrap_or_default();
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
            && let Some(exceeded) = exceeded(manifest, &judged)
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

/// A limit that is proposed is so many times as wide as the largest deviation.
const WIDER: f64 = 1.2;
/// A place is beside an edge or a highlight within so many pixels.
const BESIDE_PX: usize = 6;
/// Neighbouring heights that differ by more than this are two surfaces, mm.
const STEP_MM: f32 = 1.5;

/// A limit that good parts do not keep.
#[derive(Debug)]
pub(crate) struct Exceeded {
    gauge: String,
    limit_mm: f64,
    deviation_mm: f64,
    within_mm: f64,
    /// Where they deviate most, if that is known.
    pub square: Option<Square>,
}

/// The deviation whose limit some of these cycles of good parts do not keep.
pub(crate) fn exceeded(manifest: &RecipeFile, judged: &[Inspection]) -> Option<Exceeded> {
    let gauges = manifest.gauges.iter().enumerate();
    let mut deviations = gauges.filter(|(_, gauge)| gauge.is_deviation());
    deviations.find_map(|(at, gauge)| {
        let limit_mm = gauge.high?;
        let found = judged.iter().filter_map(|of| of.gauges.get(at));
        let read = found.filter_map(|found| {
            let value = found.value?.abs() + band(found, manifest.guard_k);
            Some((value, found.square))
        });
        let (deviation_mm, square) = read.max_by(|a, b| a.0.total_cmp(&b.0))?;
        (deviation_mm > limit_mm).then(|| Exceeded {
            gauge: gauge.name.clone(),
            limit_mm,
            deviation_mm,
            within_mm: manifest.placement_tolerance_mm,
            square,
        })
    })
}

impl Exceeded {
    /// What to say of it; `cause` says what is seen at the place.
    pub fn refusal(&self, cause: &str) -> TeachError {
        let Self {
            gauge,
            limit_mm,
            deviation_mm,
            within_mm,
            square,
        } = self;
        let place = square.map_or(String::new(), |at| {
            format!(" about column {}, row {}{cause}", at.column, at.row)
        });
        let words = format!(
            "good parts that lie within {within_mm} mm would not keep the limit of {gauge}, ±{limit_mm} mm: they deviate by \
             {deviation_mm:.3} mm{place}. Mark the part in the picture, cover or remove what is not of it, give a smaller placement tolerance, or choose \
             the limit: ±{} mm would be kept",
            rounded_up(WIDER * deviation_mm)
        );
        TeachError::Limit {
            words,
            place: *square,
        }
    }
}

/// What to say of noise that alone exceeds the limit.
pub(crate) fn too_noisy(asked_mm: f64, held_mm: f64) -> String {
    format!(
        "noise alone would exceed the limit of the deviation, ±{asked_mm} mm: give more light or more exposures, another pose, or \
         choose the limit: ±{held_mm} mm would be kept"
    )
}

impl GoldenPart<'_> {
    /// What is seen about a place where good parts deviate most. `heights` are golden's, mm.
    pub(crate) fn cause(&self, square: Option<Square>, heights: &[f32]) -> &'static str {
        let Some(square) = square else { return "" };
        let width = self.heights.width;
        let rows = heights.len() / width.max(1);
        let around = |at: u32, end: usize| {
            let at = at as usize;
            at.saturating_sub(BESIDE_PX)..(at + BESIDE_PX + 1).min(end)
        };
        let columns = around(square.column, width);
        let places =
            around(square.row, rows).flat_map(|v| columns.clone().map(move |u| v * width + u));
        let places: Vec<usize> = places.collect();
        let any = |trust| places.iter().any(|at| self.phases.trust[*at] == trust);
        let jump = |at: &usize| {
            let next = heights.get(at + 1).copied().unwrap_or(f32::NAN);
            (next - heights[*at]).abs() > STEP_MM
        };
        if any(Trust::Saturated) {
            ", beside a highlight"
        } else if places.iter().any(jump) {
            ", at a step between two surfaces, of which one may be what the part lies on"
        } else if places.iter().any(|at| heights[*at].is_nan()) {
            ", at an edge of the part"
        } else {
            ""
        }
    }
}
