//! Teaching proves its recipe: cycles as production runs them, on the part as it lies and on golden
//! wherever else it may lie.
//!
//! Limits are predicted from noise; what noise does not explain is found here, where nothing is at
//! stake yet. Each cycle is that of a [`Plan`]: the same sequences, limits and guard band. A limit
//! that would refuse the recipe's own part is moved until it holds, and teaching says so; that of the
//! deviation is never moved (`limits`).

use super::TeachError;
use crate::head::calibration::Calibration;
use crate::recipe::file::TriedFile;
use crate::recipe::file::archive::Arrays;
use crate::recipe::plan::Plan;
use crate::recipe::plan::light::median;
use crate::recipe::{GaugeFile, Recipe, RecipeFile, Refusal};
use crate::station::snapshot::warning;
use crate::station::{COVERAGE_FACTOR, GaugeValue, Inspection, Unit, Verdict};
use crate::system::headway::Headway;
use algo::geometry::Vector;
use algo::inspect::{Basis, Largest, Motion};
use algo::units::Modulation;
use hal::head::Head;
use std::time::{Duration, Instant};

/// The coverage of a good part may be lower than expected by this share of the frame. Noise alone
/// causes less: of 200,000 pixels that are all just at the least trusted modulation, the number of
/// resolved ones has σ = √200,000 / 2, and 6 σ of the difference of two such numbers is 1,900, or
/// 0.7 % of a frame of only 512 × 512 pixels.
pub(crate) const COVERAGE_CHANGE: f64 = 0.01;
/// Cycles of the part as it lies.
const STILL: usize = 5;
/// Placements that are worked out, with all pixels: the scatter of the largest deviation is then
/// known to a quarter. What golden's interpolation adds is known for all placements at once
/// ([`algo::inspect::Missed`]), so these show what noise and the error of the motion make of it.
const PLACEMENTS: usize = 8;
/// Placements reach this share of the tolerance: what is worked out has the error of the motion,
/// too.
const REACH: f64 = 0.98;
/// At most this share of an opening is covered by good parts.
const MOST_COVERED: f64 = 0.5;
/// Limits are this many times as far from the expected value as the farthest of the cycles.
const FARTHER: f64 = 1.2;

/// A recipe that is tried before any part is judged by it.
pub(crate) struct Proof {
    plan: Plan,
    /// Golden's modulation by each of the plan's sequences.
    light: Vec<Vec<Modulation>>,
    places: Vec<Motion>,
}

impl Proof {
    /// # Errors
    /// In words, if the recipe cannot be planned.
    pub fn new(
        manifest: &RecipeFile,
        arrays: &Arrays,
        calibration: &Calibration,
        headway: Headway<'_>,
    ) -> Result<Self, Refusal> {
        let recipe = Recipe::check(manifest, arrays.clone())?;
        let sequences = 0..recipe.sequences.len();
        let light = sequences.map(|sequence| recipe.light(sequence)).collect();
        let plan = Plan::telling(recipe, calibration, false, headway)?;
        let places = placements(plan.corners(), REACH * manifest.placement_tolerance_mm);
        Ok(Self {
            plan,
            light,
            places,
        })
    }

    /// The part as taught, judged at places within the recipe's placement tolerance; none where
    /// parts are not aligned, or if cycles begin with two frames.
    pub fn displaced(&self, headway: Headway<'_>) -> Vec<Inspection> {
        let judged = (1..).zip(&self.places);
        let judged = judged.map_while(|(seed, motion)| {
            headway.done(seed as f64 / self.places.len() as f64);
            self.plan.inspect_rendered(motion, &self.light, seed)
        });
        judged.collect()
    }
}

/// Motions that take the farthest corner of a box by `reach` mm, in all six components: points of
/// an additive recurrence that fills their cube evenly, with powers of the root of x⁷ = x + 1 (M.
/// Roberts, *The unreasonable effectiveness of quasirandom sequences*, 2018).
fn placements(corners: &[Vector], reach: f64) -> Vec<Motion> {
    const ROOT: f64 = 1.112_775_684_278_706;
    if corners.is_empty() {
        return Vec::new();
    }
    let size = corners
        .iter()
        .map(|corner| corner.length())
        .fold(1.0, f64::max);
    let motion = |at: usize| {
        let share = |axis: i32| {
            let along = 0.5 + at as f64 * ROOT.powi(-axis);
            2.0 * along.fract() - 1.0
        };
        let scaled = |scale: f64| {
            let turn = Vector::new(share(4), share(5), share(6)) * (scale / size);
            let shift = Vector::new(share(1), share(2), share(3)) * scale;
            Motion::new(Vector::default(), shift, turn)
        };
        let whole = scaled(reach);
        let ways = corners
            .iter()
            .map(|corner| (whole.apply(*corner) - *corner).length());
        scaled(reach * reach / ways.fold(reach * 1e-3, f64::max))
    };
    (1..=PLACEMENTS).map(motion).collect()
}

/// The part in front of the head, judged as production does.
///
/// # Errors
/// If a device fails, the recipe cannot be run, or `headway` ended it.
pub(crate) fn as_it_lies(
    plan: &Plan,
    head: &mut Head,
    calibration: &Calibration,
    timeout: Duration,
    headway: Headway<'_>,
) -> Result<Vec<Inspection>, TeachError> {
    plan.load(head, calibration)?;
    let mut judged = Vec::new();
    while judged.len() < STILL {
        for sequence in 0..plan.sequence_count() {
            if !headway.tell(judged.len() as f64 / STILL as f64) {
                return Err(TeachError::Ended);
            }
            let mut frames = Vec::new();
            let indices = plan.indices(sequence);
            let mut keep = |_, frame| {
                frames.push(frame);
                let taken = frames.len() as f64 / (indices.len() + 1) as f64;
                // A sequence is not interrupted.
                headway.done((judged.len() as f64 + taken) / STILL as f64);
            };
            head.acquire(indices, timeout, &mut keep)?;
            let inspection = plan.inspect(sequence, &frames, Instant::now());
            if inspection.step_up.is_none() {
                judged.push(inspection);
                break;
            }
        }
    }
    Ok(judged)
}

/// Leaves out the openings that these cycles of good parts cover for the most part, such as a place
/// that is just too dark to be resolved; says which.
pub(crate) fn leave_out_covered(
    manifest: &mut RecipeFile,
    judged: &mut [Inspection],
) -> Vec<String> {
    let mut words = Vec::new();
    for at in (0..manifest.gauges.len()).rev() {
        let gauge = &manifest.gauges[at];
        let values = judged.iter().filter_map(|of| of.gauges.get(at)?.value);
        let most = values.fold(0.0, f64::max);
        let is_opening = gauge.measures.facts().basis == Basis::Pixels && gauge.low.is_none();
        if !is_opening || most <= MOST_COVERED {
            continue;
        }
        words.push(format!(
            "{} is left out: good parts cover up to {:.0} % of it, so it is no opening",
            gauge.name,
            most * 100.0
        ));
        let removed = manifest.gauges.remove(at);
        manifest
            .features
            .retain(|feature| !removed.of.contains(&feature.name));
        manifest.tried.retain(|tried| tried.gauge != removed.name);
        for inspection in &mut *judged {
            inspection.gauges.remove(at);
        }
    }
    words
}

/// Moves the limits that some of these cycles of good parts do not keep, but not those of the deviation, so
/// that all do; says which.
pub(crate) fn hold(manifest: &mut RecipeFile, judged: &[Inspection]) -> Vec<String> {
    let mut words = Vec::new();
    let guard_k = manifest.guard_k;
    let gauges = manifest.gauges.iter_mut().enumerate();
    for (at, gauge) in gauges.filter(|(_, gauge)| !gauge.is_deviation()) {
        let found = judged
            .iter()
            .filter_map(|inspection| inspection.gauges.get(at));
        let ranges = found.filter_map(|found| {
            let band = band(found, guard_k);
            found.value.map(|value| (value, band))
        });
        let ranges: Vec<(f64, f64)> = ranges.collect();
        let least = ranges.iter().map(|(value, band)| value - band);
        let most = ranges.iter().map(|(value, band)| value + band);
        let (least, most) = (
            least.fold(f64::INFINITY, f64::min),
            most.fold(f64::NEG_INFINITY, f64::max),
        );
        let is_share = gauge.measures.facts().unit == Unit::Share;
        let wider = |limit: f64, value: f64, sign: f64| match is_share {
            true => (value + sign * COVERAGE_CHANGE).clamp(0.0, 1.0),
            // A division by 100 prints as hundredths.
            false => sign * (value.abs().max(limit.abs()) * FARTHER * 100.0).ceil() / 100.0,
        };
        let before = (gauge.low, gauge.high);
        let room = if is_share { COVERAGE_CHANGE } else { 0.0 };
        if let Some(low) = gauge.low.filter(|low| least - room < *low) {
            gauge.low = Some(wider(low, least, -1.0));
        }
        if let Some(high) = gauge.high.filter(|high| most > *high) {
            gauge.high = Some(wider(high, most, 1.0));
        }
        if before != (gauge.low, gauge.high) {
            let limit = |limit: Option<f64>| limit.map_or("none".into(), |at| format!("{at:+.3}"));
            words.push(format!(
                "{}: its limits are {} to {} instead of {} to {}, so that good parts keep them wherever they lie",
                gauge.name,
                limit(gauge.low),
                limit(gauge.high),
                limit(before.0),
                limit(before.1)
            ));
        }
    }
    words
}

/// How many good parts each gauge would let pass, by these cycles of good parts.
pub(crate) fn tried(manifest: &RecipeFile, judged: &[Inspection]) -> Vec<TriedFile> {
    let passes = |(at, gauge): (usize, &GaugeFile)| {
        let found = judged
            .iter()
            .filter_map(|inspection| inspection.gauges.get(at));
        let bands = found.clone().map(|found| band(found, manifest.guard_k));
        let bands = bands.fold(0.0, f64::max);
        let values: Vec<f64> = found.filter_map(|found| found.value).collect();
        let basis = gauge.measures.facts().basis;
        let parts = match (basis, manifest.good_parts) {
            (Basis::Squares(_), Some(of)) => of.displaced(of.smoothing_px)?,
            _ => normal(&values)?,
        };
        let above = gauge
            .high
            .map_or(0.0, |high| 1.0 - parts.below(high - bands));
        let below = match basis {
            Basis::Squares(_) => 0.0,
            _ => gauge.low.map_or(0.0, |low| parts.below(low + bands)),
        };
        Some(TriedFile {
            gauge: gauge.name.clone(),
            passes: (1.0 - above - below).max(0.0),
        })
    };
    let gauges = manifest.gauges.iter().enumerate();
    gauges.filter_map(passes).collect()
}

/// The guard band of a value.
pub(crate) fn band(found: &GaugeValue, guard_k: f64) -> f64 {
    guard_k * found.uncertainty.unwrap_or(0.0) / COVERAGE_FACTOR
}

/// Mean and scatter of some values, for the next one; none of fewer than two.
fn normal(values: &[f64]) -> Option<Largest> {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let squares = values.iter().map(|value| (value - mean).powi(2));
    let variance = squares.sum::<f64>() / (count - 1.0);
    (values.len() > 1).then(|| Largest {
        mean,
        scatter: (variance * (1.0 + 1.0 / count)).sqrt(),
    })
}

/// Why most of these cycles of the part itself were not judged, if so: no limit of a gauge helps
/// there.
pub(crate) fn not_judged(judged: &[Inspection]) -> Option<String> {
    let invalid = judged.iter().filter(|inspection| {
        inspection.verdict() == Verdict::Invalid && inspection.guarded().next().is_none()
    });
    let reasons: Vec<_> = invalid.filter_map(|of| of.reason.clone()).collect();
    let first = reasons
        .first()
        .filter(|_| 2 * reasons.len() > judged.len())?;
    Some(format!(
        "{} of {} parts that lie as taught would be INVALID: {first}",
        reasons.len(),
        judged.len()
    ))
}

/// What is to be said if light changed while the part was measured: golden is a mean of several
/// captures, of which less is taken out than of a cycle.
pub(crate) fn unsteady(judged: &[Inspection]) -> Option<String> {
    let mut warnings = judged.iter().map(|inspection| inspection.warnings);
    warnings.any(|all| all & warning::UNSTEADY_LIGHT != 0).then(|| {
        "light changed while the part was taught, and its heights are off by some of that: teach it in steady light".into()
    })
}

/// What a gauge's values are in magnitude: middle and spread.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Magnitudes {
    /// Their median.
    pub middle: f64,
    /// Their standard deviation, by the median distance from the median: of placements that are
    /// worked out, single ones can be wrong where golden is seen at a grazing angle.
    pub spread: f64,
}

/// Median distance of normal numbers from their median, over their standard deviation.
const MEDIAN_DISTANCE: f64 = 0.674_5;
/// Values that are farther than this many spreads from the middle are taken to have been worked out
/// wrong.
const WRONG: f64 = 8.0;

impl Magnitudes {
    /// Middle and spread of a gauge's values; `None` if it has none.
    pub fn of(judged: &[Inspection], gauge: usize) -> Option<Self> {
        let values = judged
            .iter()
            .filter_map(|inspection| inspection.gauges.get(gauge)?.value);
        let values: Vec<f64> = values.map(f64::abs).collect();
        let middle = median(values.clone())?;
        let distances = values.iter().map(|value| (value - middle).abs()).collect();
        Some(Self {
            middle,
            spread: median(distances)? / MEDIAN_DISTANCE,
        })
    }

    /// Whether a value was worked out wrong.
    pub fn is_wrong(&self, value: f64) -> bool {
        value.abs() - self.middle > WRONG * self.spread.max(self.middle / WRONG)
    }
}
