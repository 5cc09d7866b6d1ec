//! Measured heights against the truth of a recording.

use algo::phase::Trust;
use algo::pipeline::{HeightMap, PhaseMap};
use hal::replay::Recording;
use serde::Serialize;

/// |e| above this is a gross error (a wrong fringe order, not noise), in mm.
pub const GROSS_MM: f64 = 1.0;
/// Truth class of a pixel that is wholly lit and holds no depth edge.
const WHOLE_PIXEL: u8 = 2;

/// The true heights of a recording or of a simulated scene, as far as they are known.
#[derive(Debug, Default)]
pub struct Truth<'a> {
    /// z in mm on each pixel's central ray, NaN = unseen.
    pub height: Option<&'a [f32]>,
    /// 0 unseen, 1 centre lit, 2 whole pixel lit and no depth edge inside.
    pub class: Option<&'a [u8]>,
}

/// Errors of the height over the resolved pixels that truth calls wholly lit; e = z − truth.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Score {
    /// Resolved pixels with a truth of class 2 (of any finite truth where there are no classes).
    pub scored: usize,
    /// RMS of e without gross errors, mm.
    pub rms_mm: f64,
    /// Mean of e without gross errors, mm.
    pub bias_mm: f64,
    /// Median of |e|, mm.
    pub median_mm: f64,
    /// 99 % of |e| lie below this, mm.
    pub p99_mm: f64,
    /// Number of |e| > 1 mm.
    pub gross: usize,
}

impl<'a> From<&'a sim::Truth> for Truth<'a> {
    fn from(truth: &'a sim::Truth) -> Self {
        Self {
            height: Some(&truth.height),
            class: Some(&truth.class),
        }
    }
}

impl<'a> Truth<'a> {
    /// The truth beside a recording's frames.
    pub fn of(recording: &'a Recording) -> Self {
        Self {
            height: recording.truth_height.as_deref(),
            class: recording.truth_class.as_deref(),
        }
    }

    /// Whether truth says that pixel `at` is wholly lit and holds no depth edge.
    pub fn whole(&self, at: usize) -> bool {
        self.class.is_some_and(|class| class[at] == WHOLE_PIXEL)
    }

    /// The pixels that truth calls wholly lit without a depth edge, in order.
    pub fn whole_pixels(&self) -> impl Iterator<Item = usize> {
        (0..self.class.map_or(0, <[u8]>::len)).filter(|&at| self.whole(at))
    }

    /// Scores measured heights; `None` without a truth or without a pixel to score.
    pub fn score(&self, phases: &PhaseMap, heights: &HeightMap) -> Option<Score> {
        let truth = self.height?;
        let mut errors: Vec<f64> = (0..truth.len())
            .filter(|&at| phases.trust[at] == Trust::Resolved)
            .filter(|&at| self.class.is_none() || self.whole(at))
            .map(|at| heights.height[at].mm() - f64::from(truth[at]))
            .filter(|error| error.is_finite())
            .collect();
        if errors.is_empty() {
            return None;
        }
        let fine = || errors.iter().filter(|error| error.abs() <= GROSS_MM);
        let count = fine().count().max(1) as f64;
        let (sum, squares) = fine().fold((0.0, 0.0), |(s, q), e| (s + e, q + e * e));
        let gross = errors.len() - fine().count();
        errors.iter_mut().for_each(|error| *error = error.abs());
        errors.sort_by(f64::total_cmp);
        let quantile = |share: f64| errors[((errors.len() - 1) as f64 * share).round() as usize];
        Some(Score {
            scored: errors.len(),
            rms_mm: (squares / count).sqrt(),
            bias_mm: sum / count,
            median_mm: quantile(0.5),
            p99_mm: quantile(0.99),
            gross,
        })
    }
}
