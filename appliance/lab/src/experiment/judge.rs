//! Judges a run: errors against truth, coverage, and the fit of a cylinder.

use super::cylinder::{self, Cylinder};
use super::scenes::Judged;
use algo::phase::Trust;
use appliance::head::calibrated::Measured;
use appliance::measure::{GROSS_MM, Score, Truth};

/// The quality of one measurement of a part.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// Errors against truth; `None` where nothing was resolved.
    pub score: Option<Score>,
    /// Pixels that truth calls wholly lit. All figures are over these pixels, as in the study.
    pub lit: usize,
    /// Those that are not resolved.
    pub unresolved: usize,
    /// RMS of error / predicted σ_z over scored pixels without gross errors.
    pub error_over_sigma: f64,
    /// The cylinder fitted to the resolved points, of a part that is judged by it.
    pub cylinder: Option<Cylinder>,
}

impl Outcome {
    /// Share of the lit pixels that are resolved.
    pub fn coverage(&self) -> f64 {
        (self.lit - self.unresolved) as f64 / self.lit.max(1) as f64
    }
}

/// Compares a measurement of a simulated part with the truth.
pub fn judge(truth: &sim::Truth, measured: &Measured, judged: Judged) -> Outcome {
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
    Outcome {
        score: known.score(phases, heights),
        lit: whole.len(),
        unresolved: whole.len() - resolved.len(),
        error_over_sigma: (squares / f64::max(count, 1.0)).sqrt(),
        cylinder,
    }
}
