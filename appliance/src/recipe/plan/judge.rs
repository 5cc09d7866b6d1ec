//! From what was found to a verdict.

use crate::recipe::{AlignmentKind, RecipeFile};
use crate::station::{GaugeValue, Inspection, Placement, Skipped, Verdict};
use algo::inspect::Findings;
use algo::inspect::align::Placed;
use std::sync::Arc;

/// Judges the findings by the recipe's limits; `names` are those of its gauges.
pub(super) fn judge(
    file: &RecipeFile,
    names: &[Arc<str>],
    findings: &Findings,
    inspection: &mut Inspection,
) {
    for ((gauge, name), reading) in file.gauges.iter().zip(names).zip(&findings.readings) {
        let judged = GaugeValue::judged(
            Arc::clone(name),
            gauge.measures.unit(),
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
    inspection.placement = findings.placed.as_ref().map(placement);
    let outside = inspection
        .placement
        .filter(|placement| placement.reach_mm > file.placement_tolerance_mm);
    let reason = if coverage < least {
        Some(format!(
            "only {:.1} % of the taught surface is resolved, {:.1} % are needed: is the part in place \
             and the light on?",
            coverage * 100.0,
            least * 100.0
        ))
    } else if let Some(placement) = outside {
        let [x, y, z] = placement.shift_mm;
        Some(format!(
            "the part lies up to {:.2} mm off its place ({x:+.2}, {y:+.2}, {z:+.2} mm and turned), {:.2} mm are \
             allowed: put it in place",
            placement.reach_mm, file.placement_tolerance_mm
        ))
    } else if file.alignment == AlignmentKind::Rigid && findings.placed.is_none() {
        Some(
            "too little of the part lies where it was taught to be aligned: is it in place?".into(),
        )
    } else if !missing.is_empty() {
        let left_out = inspection.placement.map_or(String::new(), |placement| {
            match &placement.undetermined()[..] {
                [] => String::new(),
                names => format!("; the part's shape does not determine {}", names.join(", ")),
            }
        });
        Some(format!(
            "gauge {} found nothing to measure{left_out}",
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

/// How the part lies, for those who look.
fn placement(placed: &Placed) -> Placement {
    let values = placed.motion.values();
    Placement {
        shift_mm: [values[0], values[1], values[2]],
        turn_deg: [values[3], values[4], values[5]].map(f64::to_degrees),
        left_out: placed.left_out,
        reach_mm: placed.reach,
        outliers: placed.outliers,
    }
}

/// More than this share of the pixels that are lit contradict themselves: 1 % is what silhouettes give.
const CONTRADICTING: f64 = 0.03;
/// The pattern has lost this much of its contrast: a level's noise has grown by half.
const UNFIT: f64 = 0.67;
/// More than this share of the points lie off the taught surface: a defect is smaller, a wrong fringe order is not.
const OUTLIERS: f64 = 0.2;

/// Why a longer sequence should be tried; none if this one will do.
pub(super) fn step_up(file: &RecipeFile, findings: &Findings) -> Option<&'static str> {
    let placed = findings.placed.as_ref();
    let fitness = findings.taught_noise_mm / findings.height_noise_mm.max(f64::MIN_POSITIVE);
    if findings.contradicting > CONTRADICTING {
        Some("the levels contradict each other")
    } else if findings.coverage < file.min_coverage {
        Some("too little of the surface is resolved")
    } else if fitness < UNFIT {
        Some("the pattern has lost its contrast")
    } else if placed.is_some_and(|placed| placed.reach > file.placement_tolerance_mm) {
        Some("the part lies outside of what the sequence is safe for")
    } else if placed.is_some_and(|placed| placed.outliers > OUTLIERS) {
        Some("many points lie off the taught surface")
    } else {
        None
    }
}
