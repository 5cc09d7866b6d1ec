//! From findings to a verdict, or to the reason why a longer sequence should be tried.
//!
//! FAIL is a measured part outside its limits, or one that lacks what a gauge measures. INVALID is a
//! part that cannot be judged (`not_judged` has the reasons), a value in a guard band, and a gauge
//! that has no value and is not absent.

use super::light::{Cause, Light};
use crate::recipe::file::demands::GaugeDemands;
use crate::recipe::shown::{MIN_SHARE, why_lost};
use crate::recipe::{Demands, SequenceKind};
use crate::station::error_code::{BLURRED, GUARD_BAND, NOT_MEASURED, NOT_THE_PART, OUT_OF_PLACE};
use crate::station::result::flag::{FULL_SEQUENCE, SINGLE_LEVEL, TWO_LEVELS};
use crate::station::{
    COVERAGE_FACTOR, GaugeLimits, GaugeValue, Inspection, Measured, Placement, Unit, Verdict,
};
use algo::inspect::{Findings, FoundFeature, MAX_PLACES, Missing, Placed, State};
use hal::bounds::clipped;
use std::sync::Arc;

/// Largest share of lit pixels whose levels contradict each other; silhouettes cause about 1 %.
const CONTRADICTING: f64 = 0.03;
/// Least fitness (taught noise over measured noise of the height); below it the noise has grown by
/// half.
const UNFIT: f64 = 0.67;
/// Largest share of points off the taught surface: a defect covers less, wrong fringe orders more.
const OUTLIERS: f64 = 0.2;
/// A part is out of place if it lies beyond the tolerance by this many σ of its way and by this
/// share of the tolerance: a defect pulls the place that is found by so much.
const SURE: f64 = 2.0;
const PULLED: f64 = 0.02;
/// A part that fails with less fitness than this is INVALID: it is measured with four times the
/// noise that its limits were set for.
const LEAST_FITNESS: f64 = 0.25;
/// What lies farther from its place than so many times the tolerance is another part.
const FAR: f64 = 10.0;
/// Turns below this are not told, degrees.
const LEAST_TURN: f64 = 0.05;
/// Least share of the picture's variance along golden's edges that golden explains where two frames
/// are used.
pub(super) const ALIKE: f64 = 0.8;

/// Features at most that a reason names.
const NAMED: usize = 8;

/// Why a gauge has no value.
const NOTHING: &str = "found nothing to measure";
/// What to do where a gauge has no value on a part.
const UNCOVER: &str =
    "clear what covers or darkens it, light it as when it was taught, and measure again";
/// What to do where another part lies, or none.
const PUT: &str = "put the part that was taught in place, or load the recipe of this one";

impl Demands {
    /// What is known of a gauge without a value.
    fn without_value(
        &self,
        limits: &GaugeDemands,
        missing: Option<Missing>,
        of: &Findings,
    ) -> Measured {
        let found = |at: usize| of.features.iter().find(|found| found.feature == at);
        let (absent, reason) = match missing {
            Some(Missing::Feature(at)) => match found(at) {
                Some(found) => self.lost(found),
                None => (false, NOTHING.into()),
            },
            Some(Missing::Cells(shares)) => (false, limits.unseen(shares)),
            Some(Missing::Open) => (
                false,
                "the part's shape does not determine how it lies there: give the gauge a datum"
                    .into(),
            ),
            Some(Missing::Nothing) | None => (false, NOTHING.into()),
        };
        Measured {
            absent,
            reason: Some(reason.into()),
            ..Measured::default()
        }
    }

    /// Whether a feature that was not found is absent, and why it was not found.
    fn lost(&self, found: &FoundFeature) -> (bool, String) {
        let name = self.features.get(found.feature);
        let name = clipped(name.map_or("", |feature| &feature.name));
        let (reason, _) = why_lost(found);
        let absent = found.state == State::Absent;
        (absent, format!("feature {name:?}: {reason}"))
    }
}

impl GaugeDemands {
    /// Why there is no value, where these shares of its features were measured.
    fn unseen(&self, shares: [f64; MAX_PLACES]) -> String {
        let mut features = self.of.iter().zip(shares);
        let few = |(_, share): &(&String, f64)| *share < MIN_SHARE;
        match features.find(few) {
            Some((name, share)) => format!(
                "feature {:?}: {:.0} % of it was measured",
                clipped(name),
                share * 100.0
            ),
            None => format!(
                "{}: too few cells were measured, or they lie on a line",
                self.of.join(", ")
            ),
        }
    }
}

/// Why a part cannot be judged.
struct Reason {
    /// ERROR_CODE.
    code: u16,
    /// The reason in words, with the remedy.
    words: String,
}

impl Demands {
    /// Judges the findings.
    pub(super) fn judge(&self, findings: &Findings, inspection: &mut Inspection) {
        let readings = findings.readings.iter().zip(&findings.missing);
        for (limits, (reading, missing)) in self.limits.iter().zip(readings) {
            let without = || self.without_value(limits, *missing, findings);
            let measured = reading.map_or_else(without, |reading| {
                let (value, systematic) = match limits.master {
                    None => (reading.value, reading.systematic),
                    Some(master) => master.of(&reading),
                };
                Measured {
                    value: Some(value),
                    sigma: reading.sigma,
                    systematic,
                    expected: reading.expected,
                    square: reading.square.map(Into::into),
                    ..Measured::default()
                }
            });
            let judged = GaugeValue::judged(
                limits.slot,
                Arc::clone(&limits.name),
                limits.unit,
                measured,
                GaugeLimits {
                    low: limits.low,
                    high: limits.high,
                    guard_k: self.guard_k,
                },
            );
            // Cannot be full: the recipe was checked for MAX_GAUGES.
            let _ = inspection.gauges.push(judged);
        }
        let coverage = findings.coverage;
        inspection.valid_points = findings.resolved as u32;
        inspection.coverage_permille = (coverage * 1000.0).round() as u16;
        inspection.height_noise_mm = findings.height_noise_mm;
        let fitness = findings.taught_noise_mm / findings.height_noise_mm.max(f64::MIN_POSITIVE);
        inspection.fitness_permille = (fitness.min(1.0) * 1000.0).round() as u16;
        inspection.skipped = findings.skipped;
        inspection.placement = findings.placed.as_ref().map(placement);
        inspection.features.clone_from(&findings.features);
        if let Some(Reason { code, words }) = self.not_judged(inspection, findings) {
            let unseen = match code {
                // Its words have a feature for each gauge.
                NOT_MEASURED => String::new(),
                _ => self.unseen(findings),
            };
            inspection.reason = Some((words + &unseen).into());
            inspection.error_code = code;
        }
        inspection.judged = match &inspection.reason {
            Some(_) => Verdict::Invalid,
            None if inspection.gauges.iter().all(|gauge| gauge.decision.pass) => Verdict::Pass,
            None => Verdict::Fail,
        };
    }

    /// Why the part cannot be judged; `None` if it can. The inspection lacks only its verdict.
    fn not_judged(&self, inspection: &Inspection, findings: &Findings) -> Option<Reason> {
        if findings.coverage < self.min_coverage {
            let words = self.unresolved(findings.coverage);
            return Some(Reason {
                code: NOT_THE_PART,
                words: format!("{words}, in the light that it was taught in: {PUT}"),
            });
        }
        let placed = findings.placed.as_ref();
        if let Some(placed) = placed.filter(|placed| self.is_off(placed)) {
            return Some(self.off(placed));
        }
        if self.aligned && placed.is_none() {
            return Some(Reason {
                code: NOT_THE_PART,
                words: format!(
                    "too little of the part lies where it was taught to be aligned: {PUT}"
                ),
            });
        }
        let undecided = |words| Reason {
            code: GUARD_BAND,
            words,
        };
        self.unmeasured(inspection, findings)
            .or_else(|| self.undecided(inspection).map(undecided))
    }

    /// Which gauges have no value although nothing is absent, and what to do about the first one;
    /// `None` if there is none.
    fn unmeasured(&self, inspection: &Inspection, findings: &Findings) -> Option<Reason> {
        let limits = self.limits.iter().zip(&findings.missing);
        let gauges = limits.zip(&inspection.gauges);
        let unseen = gauges.filter(|(_, gauge)| gauge.decision.unseen());
        let ((limits, why), _) = unseen.clone().next()?;
        let named = unseen.map(|(_, gauge)| match gauge.reason.as_deref() {
            None | Some(NOTHING) => gauge.name.to_string(),
            Some(reason) => format!("{} ({reason})", gauge.name),
        });
        let named = named.collect::<Vec<_>>().join(", ");
        let open = inspection.placement.as_ref().map(Placement::undetermined);
        let open = open.unwrap_or_default().join(", ");
        let left_out = match open.is_empty() {
            true => String::new(),
            false => format!("; the part's shape does not determine {open}"),
        };
        let remedy = match why {
            // Its reason says what to do.
            Some(Missing::Open) => String::new(),
            _ if limits.of.is_empty() && !open.is_empty() => ": leave the gauge out".into(),
            _ => format!(": {UNCOVER}"),
        };
        Some(Reason {
            code: NOT_MEASURED,
            words: format!("gauge {named} {NOTHING}{left_out}{remedy}"),
        })
    }

    /// The names of features that were not seen, as the end of a reason; empty if all were seen.
    fn unseen(&self, findings: &Findings) -> String {
        let unseen = findings.features.iter();
        let names: Vec<String> = unseen
            .filter(|found| found.state == State::Unseen)
            .filter_map(|found| self.features.get(found.feature))
            .map(|feature| clipped(&feature.name))
            .collect();
        match names.len() {
            0 => String::new(),
            1..=NAMED => format!("; not seen: {}", names.join(", ")),
            count => format!(
                "; not seen: {} and {} more",
                names[..NAMED].join(", "),
                count - NAMED
            ),
        }
    }

    /// How large the coverage is, and how large it must be.
    fn unresolved(&self, coverage: f64) -> String {
        format!(
            "the coverage is only {:.1} %, {:.1} % are needed",
            coverage * 100.0,
            self.min_coverage * 100.0
        )
    }

    /// Why a part that lies off its place cannot be judged: so far off, it is another part; else it
    /// must be put in place.
    fn off(&self, placed: &Placed) -> Reason {
        let [x, y, z, turns @ ..] = placed.motion.values();
        let degrees = turns
            .iter()
            .map(|turn| turn * turn)
            .sum::<f64>()
            .sqrt()
            .to_degrees();
        let turned = match degrees < LEAST_TURN {
            true => String::new(),
            false => format!(", turned by {degrees:.1}°"),
        };
        let lies = format!(
            "lies up to {:.2} mm off its place ({x:+.2}, {y:+.2}, {z:+.2} mm{turned})",
            placed.reach
        );
        let allowed = self.tolerance_mm;
        match placed.reach > FAR * allowed || placed.outliers > OUTLIERS {
            true => Reason {
                code: NOT_THE_PART,
                words: format!(
                    "this does not look like the part that was taught, which {lies} if it is there: {PUT}"
                ),
            },
            false => Reason {
                code: OUT_OF_PLACE,
                words: format!("the part {lies}, {allowed:.2} mm are allowed: put it in place"),
            },
        }
    }

    /// Whether the light may be why a part was measured badly: hardly anything of it is seen, or it
    /// is much noisier than as taught.
    pub(super) fn doubts_the_light(inspection: &Inspection) -> bool {
        inspection.error_code == NOT_THE_PART || fitness(inspection) < UNFIT
    }

    /// Names in the reason what is wrong with the light, where a part was measured badly because of
    /// it; a part that fails with less than [`LEAST_FITNESS`] becomes INVALID.
    pub(super) fn explain(&self, light: Option<Light>, inspection: &mut Inspection) {
        let cause = light.and_then(Light::cause);
        inspection.warnings |= cause.map_or(0, Cause::warning);
        let coverage = f64::from(inspection.coverage_permille) / 1000.0;
        let found = match (inspection.error_code, inspection.judged) {
            (NOT_THE_PART, _) if cause.is_some() && coverage < self.min_coverage => {
                self.unresolved(coverage)
            }
            (0, Verdict::Fail) if fitness(inspection) < LEAST_FITNESS => {
                let noisier = 1.0 / fitness(inspection).max(1e-3);
                format!("its heights are {noisier:.1} times as noisy as when it was taught")
            }
            _ => return,
        };
        let words = cause.map_or_else(
            || "check light, focus and exposure of the head".into(),
            Cause::words,
        );
        inspection.reason = Some(format!("{found}: {words}").into());
        inspection.error_code = cause.map_or(BLURRED, Cause::code);
        inspection.judged = Verdict::Invalid;
    }

    /// Which values lie too close to a limit, and what to do; `None` if no value does, or if
    /// another value lies outside its limits.
    fn undecided(&self, inspection: &Inspection) -> Option<String> {
        let close = |gauge: &GaugeValue| {
            let value = gauge.value?;
            let limits = [gauge.low, gauge.high].into_iter().flatten();
            let nearest = limits.min_by(|a, b| (a - value).abs().total_cmp(&(b - value).abs()))?;
            let band = self.guard_k * gauge.uncertainty? / COVERAGE_FACTOR;
            let symbol = gauge.unit.symbol();
            Some(format!(
                "{} is {value:+.4} {symbol}, within {band:.4} {symbol} of its limit {nearest:+.4} {symbol}",
                gauge.name
            ))
        };
        let close: Vec<String> = inspection.guarded().filter_map(close).collect();
        (!close.is_empty()).then(|| {
            format!(
                "too close to a limit to prove PASS or FAIL: {}; measure the part by other means, or lower the noise \
                 (more light, a longer sequence)",
                close.join("; ").replace("  ", " ")
            )
        })
    }

    /// Whether a part surely lies farther from its place than is allowed: a part that lies just at
    /// the tolerance does not.
    fn is_off(&self, placed: &Placed) -> bool {
        placed.reach - SURE * placed.reach_sigma > (1.0 + PULLED) * self.tolerance_mm
    }

    /// Why a longer sequence should be tried; `None` if this one is good enough.
    pub(super) fn step_up(
        &self,
        findings: &Findings,
        inspection: &Inspection,
    ) -> Option<&'static str> {
        let placed = findings.placed.as_ref();
        let fitness = findings.taught_noise_mm / findings.height_noise_mm.max(f64::MIN_POSITIVE);
        if findings.contradicting > CONTRADICTING {
            Some("the levels contradict each other")
        } else if findings.coverage < self.min_coverage {
            Some("the coverage is too small")
        } else if fitness < UNFIT {
            Some("the pattern has lost its contrast")
        } else if placed.is_some_and(|placed| self.is_off(placed)) {
            Some("the part lies outside of what the sequence is safe for")
        } else if placed.is_some_and(|placed| placed.outliers > OUTLIERS) {
            Some("many points lie off golden")
        } else if inspection.guarded().next().is_some() {
            Some("a value lies too close to a limit")
        } else if findings.skipped.unexpected > 0 && inspection.gauges.iter().any(is_low_share) {
            Some("a share is below its limit, and the sequence leaves places of the part out")
        } else {
            None
        }
    }
}

/// Taught noise over measured noise of the height.
fn fitness(inspection: &Inspection) -> f64 {
    f64::from(inspection.fitness_permille) / 1000.0
}

/// Whether the value is a share below its lower limit.
fn is_low_share(gauge: &GaugeValue) -> bool {
    gauge.unit == Unit::Share && gauge.decision.low
}

/// The placement that is shown with the result.
fn placement(placed: &Placed) -> Placement {
    let [x, y, z, turns @ ..] = placed.motion.values();
    let [a, b, c] = turns.map(f64::to_degrees);
    let mut values = [x, y, z, a, b, c].map(Some);
    for (value, left_out) in values.iter_mut().zip(placed.left_out) {
        value.take_if(|_| left_out);
    }
    Placement {
        values,
        reach_mm: placed.reach,
        outliers: placed.outliers,
    }
}

/// The flag of a result that says which kind of sequence was used.
pub(super) fn sequence_flag(kind: SequenceKind) -> u16 {
    match kind {
        SequenceKind::TwoFrames | SequenceKind::SingleLevel => SINGLE_LEVEL,
        SequenceKind::TwoLevels => TWO_LEVELS,
        SequenceKind::Full => FULL_SEQUENCE,
    }
}
