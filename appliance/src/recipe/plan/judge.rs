//! From findings to a verdict, or to the reason why a longer sequence should be tried.

use crate::recipe::Demands;
use crate::station::{
    COVERAGE_FACTOR, GaugeLimits, GaugeValue, Inspection, Measured, Placement, Unit, Verdict,
};
use algo::inspect::{Findings, Placed};
use std::sync::Arc;

/// Largest share of lit pixels whose levels contradict each other; silhouettes cause about 1 %.
const CONTRADICTING: f64 = 0.03;
/// Least fitness (taught noise over measured noise of the height); below it the noise has grown by half.
const UNFIT: f64 = 0.67;
/// Largest share of points off the taught surface: a defect covers less, wrong fringe orders more.
const OUTLIERS: f64 = 0.2;
/// A part lies out of place where it does so by this many errors of its way, and by this share of what is allowed: a defect pulls the part's
/// place by that.
const SURE: f64 = 2.0;
const PULLED: f64 = 0.02;
/// Least share of the picture's variance along golden's edges that golden explains where two frames are used.
pub(super) const ALIKE: f64 = 0.8;

impl Demands {
    /// Judges the findings.
    pub(super) fn judge(&self, findings: &Findings, inspection: &mut Inspection) {
        for (limits, reading) in self.limits.iter().zip(&findings.readings) {
            let judged = GaugeValue::judged(
                Arc::clone(&limits.name),
                limits.unit,
                reading.map_or_else(Measured::default, |reading| Measured {
                    value: Some(reading.value),
                    sigma: reading.sigma,
                    systematic: reading.systematic,
                    expected: reading.expected,
                    square: reading.square.map(Into::into),
                }),
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
        inspection.reason = self.not_judged(inspection, findings).map(Arc::from);
        inspection.judged = match &inspection.reason {
            Some(_) => Verdict::Invalid,
            None if inspection.gauges.iter().all(|gauge| gauge.decision.pass) => Verdict::Pass,
            None => Verdict::Fail,
        };
    }

    /// Why the part cannot be judged; `None` if it can. The inspection lacks only its verdict.
    fn not_judged(&self, inspection: &Inspection, findings: &Findings) -> Option<String> {
        let coverage = findings.coverage;
        if coverage < self.min_coverage {
            return Some(format!(
                "only {:.1} % of the taught surface is resolved, {:.1} % are needed: is the part in place \
                 and the light on?",
                coverage * 100.0,
                self.min_coverage * 100.0
            ));
        }
        let lies = inspection.placement.as_ref();
        let off = findings
            .placed
            .as_ref()
            .is_some_and(|placed| self.is_off(placed));
        if let Some(placement) = lies.filter(|_| off) {
            let [x, y, z, ..] = placement.values.map(Option::unwrap_or_default);
            return Some(format!(
                "the part lies up to {:.2} mm off its place ({x:+.2}, {y:+.2}, {z:+.2} mm and turned), {:.2} mm are \
                 allowed: put it in place",
                placement.reach_mm, self.tolerance_mm
            ));
        }
        if self.aligned && lies.is_none() {
            let words =
                "too little of the part lies where it was taught to be aligned: is it in place?";
            return Some(words.into());
        }
        let gauges = inspection.gauges.iter();
        let missing: Vec<&str> = gauges
            .filter(|gauge| !gauge.decision.valid)
            .map(|gauge| &*gauge.name)
            .collect();
        if missing.is_empty() {
            return self.undecided(inspection);
        }
        let left_out = match lies.map(Placement::undetermined).as_deref() {
            None | Some([]) => String::new(),
            Some(names) => format!("; the part's shape does not determine {}", names.join(", ")),
        };
        let missing = missing.join(", ");
        Some(format!(
            "gauge {missing} found nothing to measure{left_out}"
        ))
    }

    /// Which values lie too close to a limit, and what to do; `None` if none does, or if another one lies outside its limits.
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

    /// Whether a part surely lies farther from its place than is allowed: one that lies at the tolerance does not.
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
            Some("too little of the surface is resolved")
        } else if fitness < UNFIT {
            Some("the pattern has lost its contrast")
        } else if placed.is_some_and(|placed| self.is_off(placed)) {
            Some("the part lies outside of what the sequence is safe for")
        } else if placed.is_some_and(|placed| placed.outliers > OUTLIERS) {
            Some("many points lie off the taught surface")
        } else if inspection.guarded().next().is_some() {
            Some("a value lies too close to a limit")
        } else if findings.skipped.unexpected > 0 && inspection.gauges.iter().any(is_low_share) {
            Some("a share is below its limit, and the sequence leaves places of the part out")
        } else {
            None
        }
    }
}

/// Whether it is a share below its limit.
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
