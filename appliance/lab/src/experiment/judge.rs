//! Judges a run: errors against truth, coverage, and the fit of a cylinder.

use super::cylinder;
use super::scenes::Judged;
use super::table::Values;
use algo::phase::Trust;
use appliance::head::calibrated::MeasuredPart;
use appliance::measure::{GROSS_MM, Score, Truth};

/// Compares a measurement of a simulated part with the truth. All figures are over the pixels that
/// truth calls wholly lit, as in the study; the ratio to the paper's run is not known yet.
pub fn judge(truth: &sim::Truth, measured: &MeasuredPart, judged: Judged) -> Values {
    let known = Truth::from(truth);
    let (phases, heights) = (&measured.phases, &measured.heights);
    let whole: Vec<usize> = known.whole_pixels().collect();
    let resolved: Vec<usize> = whole
        .iter()
        .copied()
        .filter(|&at| phases.trust[at] == Trust::Resolved)
        .collect();
    let (mut squares, mut count) = (0.0, 0.0);
    for &at in &resolved {
        let sigma = f64::from(heights.sigma[at]);
        let error = heights.height[at].mm() - f64::from(truth.height[at]);
        if error.abs() <= GROSS_MM && sigma > 0.0 {
            squares += (error / sigma).powi(2);
            count += 1.0;
        }
    }
    let cylinder = (judged == Judged::CylinderFit)
        .then(|| {
            let width = heights.width;
            let point = |&at: &usize| {
                let found = measured
                    .triangulator
                    .point(at % width, at / width, heights.height[at]);
                found.map(|point| [point.x, point.y, point.z])
            };
            cylinder::fit(&resolved.iter().filter_map(point).collect::<Vec<_>>())
        })
        .flatten();
    let score = known.score(phases, heights);
    let scored = |value: fn(&Score) -> f64| score.as_ref().map(value);
    Values {
        scored_px: scored(|score| score.scored as f64).unwrap_or(0.0),
        lit_px: whole.len() as f64,
        unresolved_px: (whole.len() - resolved.len()) as f64,
        gross_px: scored(|score| score.gross as f64).unwrap_or(0.0),
        rms_mm: scored(|score| score.rms_mm).unwrap_or(f64::NAN),
        bias_mm: scored(|score| score.bias_mm).unwrap_or(f64::NAN),
        median_mm: scored(|score| score.median_mm).unwrap_or(f64::NAN),
        p99_mm: scored(|score| score.p99_mm).unwrap_or(f64::NAN),
        error_over_sigma: (squares / f64::max(count, 1.0)).sqrt(),
        ratio_to_paper: f64::NAN,
        coverage: resolved.len() as f64 / whole.len().max(1) as f64,
        fit_residual_mm: cylinder.map_or(f64::NAN, |fit| fit.residual_mm),
        fit_radius_mm: cylinder.map_or(f64::NAN, |fit| fit.radius_mm),
    }
}
