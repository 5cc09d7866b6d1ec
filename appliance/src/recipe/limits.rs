//! Sets the squares and the limits of the gauges that teaching proposes, by what good parts are predicted to read and by what golden reads at
//! other places.

use super::archive::Arrays;
use super::golden::GoldenPart;
use super::good_parts::{DEVIATION_MM, GoodPartsFile, Noise, ROOM, SIDES};
use super::proof::{self, COVERAGE_CHANGE, Magnitudes};
use super::{GaugeFile, GaugeKind, RecipeFile, SequenceFile};
use crate::station::{Inspection, MAX_GAUGES};
use algo::pipeline::KnownSurface;

/// The deviation of a good part is taken to lie at most this many scatters above its mean: of placements that are worked out.
const FARTHEST: f64 = 4.0;

impl GoldenPart<'_> {
    /// Sets the squares and the limits of the gauges by what good parts are predicted to read, wherever they lie within the placement tolerance;
    /// overwrites `arrays.valid` (0 or 1) with the weights of the pixels. Returns what to say of it.
    pub(super) fn set_limits(
        &self,
        surface: KnownSurface,
        manifest: &mut RecipeFile,
        arrays: &mut Arrays,
    ) -> Result<Vec<String>, String> {
        let (sequences, production) = (&manifest.sequences, manifest.production);
        let expected = sequences[production..].iter();
        let expected = expected.filter_map(|of| self.expected_coverage(of, &arrays.phase_reach));
        let coverage = expected.fold(f64::INFINITY, f64::min) - COVERAGE_CHANGE;
        let noise = self.noise(surface, arrays, sequences, production);
        let compared = arrays.valid.clone();
        let mut good_parts = noise.weigh_smallest(&mut arrays.valid, DEVIATION_MM, &SIDES);
        for gauge in &mut manifest.gauges {
            match gauge.measures {
                GaugeKind::Deviation { .. } => set_deviation(gauge, &good_parts),
                // Of the whole frame; openings have an upper limit.
                GaugeKind::Coverage => gauge.low = gauge.low.map(|_| coverage.max(0.0)),
                _ => {}
            }
        }
        // The same deviation in squares of all sides that may be taken.
        let sides = SIDES
            .into_iter()
            .filter(|side| *side >= good_parts.smoothing_px);
        let sides: Vec<usize> = sides.collect();
        let mut tried = manifest.clone();
        let room = MAX_GAUGES.saturating_sub(tried.gauges.len());
        for side in sides.iter().skip(1).take(room) {
            let mut gauge = tried.gauges[0].clone();
            gauge.name = format!("{} in {side}", gauge.name);
            gauge.measures = GaugeKind::Deviation {
                smoothing_px: *side,
            };
            tried.gauges.push(gauge);
        }
        let judged = proof::displaced(&tried, arrays, self.calibration)?;
        let others = manifest.gauges.len() - 1;
        let gauge_of = |at: usize| if at == 0 { 0 } else { at + others };
        let found = |at: usize| Magnitudes::of(&judged, gauge_of(at));
        let fits = |of: Magnitudes| of.middle + FARTHEST * of.spread < ROOM * good_parts.limit_mm;
        let at = (0..sides.len()).find(|at| found(*at).is_none_or(fits));
        let at = at.unwrap_or(sides.len() - 1);
        if at > 0 {
            arrays.valid = compared;
            good_parts = noise.weigh_smallest(&mut arrays.valid, DEVIATION_MM, &sides[at..=at]);
            set_deviation(&mut manifest.gauges[0], &good_parts);
        }
        let taken = found(at);
        if let Some(Magnitudes { middle, spread }) = taken {
            (good_parts.displaced_mm, good_parts.displaced_scatter_mm) = (middle, spread);
        }
        let mut words = good_parts.words();
        manifest.good_parts = Some(good_parts);
        // Values by the squares that were taken, in the order of the recipe's gauges.
        let judged = judged.into_iter().filter_map(|mut inspection| {
            let deviation = inspection.gauges.get(gauge_of(at)).cloned()?;
            let wrong = taken.zip(deviation.value);
            if wrong.is_some_and(|(of, value)| of.is_wrong(value)) {
                return None;
            }
            inspection.gauges[0] = deviation;
            inspection.gauges.truncate(others + 1);
            Some(inspection)
        });
        let judged: Vec<Inspection> = judged.collect();
        words.extend(proof::hold(manifest, &judged));
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
            triangulator: self.triangulator,
            surface,
            production,
            golden: golden / self.captures as f64,
        }
    }
}

/// Gives a deviation the squares and the limit of a prediction.
fn set_deviation(gauge: &mut GaugeFile, good_parts: &GoodPartsFile) {
    let limit = good_parts.limit_mm;
    (gauge.low, gauge.high) = (Some(-limit), Some(limit));
    gauge.measures = GaugeKind::Deviation {
        smoothing_px: good_parts.smoothing_px,
    };
}
