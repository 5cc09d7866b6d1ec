//! From what was found to a verdict.

use crate::recipe::{GaugeKind, RecipeFile};
use crate::station::{GaugeValue, Inspection, Skipped, Unit, Verdict};
use algo::inspect::Findings;
use std::sync::Arc;

/// Judges the findings by the recipe's limits.
pub(super) fn judge(file: &RecipeFile, findings: &Findings, inspection: &mut Inspection) {
    for (gauge, reading) in file.gauges.iter().zip(&findings.readings) {
        let unit = match gauge.measures {
            GaugeKind::Deviation { .. } => Unit::Length,
            GaugeKind::Coverage => Unit::Share,
        };
        let judged = GaugeValue::judged(
            &gauge.name,
            unit,
            reading.map(|reading| reading.value),
            reading.and_then(|reading| reading.sigma),
            (gauge.low, gauge.high),
        );
        // The recipe was checked for at most as many gauges as fit.
        let _ = inspection.gauges.push(judged);
    }
    let coverage = findings.coverage;
    inspection.valid_points = findings.resolved as u32;
    inspection.coverage_permille = (coverage * 1000.0).round() as u16;
    inspection.height_noise_mm = findings.height_noise_mm;
    let fitness = findings.taught_noise_mm / findings.height_noise_mm.max(f64::MIN_POSITIVE);
    inspection.fitness_permille = (fitness.min(1.0) * 1000.0).round() as u16;
    let skipped = &findings.skipped;
    inspection.skipped = Skipped {
        outside: skipped.outside as u32,
        unexpected: skipped.unexpected as u32,
        dark: skipped.dark as u32,
        exact: skipped.exact as u32,
    };
    let missing: Vec<&str> = inspection
        .gauges
        .iter()
        .filter(|gauge| !gauge.decision.valid)
        .map(|gauge| &*gauge.name)
        .collect();
    let least = file.min_coverage;
    let reason = if coverage < least {
        Some(format!(
            "only {:.1} % of the taught surface is resolved, {:.1} % are needed: is the part in place \
             and the light on?",
            coverage * 100.0,
            least * 100.0
        ))
    } else if !missing.is_empty() {
        Some(format!(
            "gauge {} found nothing to measure",
            missing.join(", ")
        ))
    } else {
        None
    };
    inspection.judged = match &reason {
        Some(_) => Verdict::Invalid,
        None if inspection.gauges.iter().all(|gauge| gauge.decision.pass) => Verdict::Pass,
        None => Verdict::Fail,
    };
    inspection.reason = reason.map(Arc::from);
}
