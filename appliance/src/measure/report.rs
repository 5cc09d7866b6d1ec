//! The summary of a measurement, as JSON and as a table, with its errors against the truth of the
//! recording.

use crate::head::channel::NoHeights;
use crate::head::direction::{self, Sensitivity};
use crate::output::cloud::Surface;
use crate::station::COVERAGE_FACTOR;
use algo::phase::Trust;
use algo::pipeline::{HeightMap, PhaseMap};
use hal::replay::Recording;
use hal::replay::recording::RecipeReference;
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt::Write as _;

/// |e| above this is a gross error (a wrong fringe order, not noise), in mm.
pub const GROSS_MM: f64 = 1.0;
/// Truth class of a pixel that is wholly lit and holds no depth edge.
const WHOLE_PIXEL: u8 = 2;

/// How the levels were unwrapped.
#[derive(Clone, Debug, Serialize)]
pub struct Manner {
    /// Geometric, dense, single, heterodyne, gray code, gray code alone, or wrapped where nothing
    /// is known.
    pub kind: &'static str,
    /// The levels' ratios from coarse to fine.
    pub ratios: Vec<f64>,
    /// Ratios of the levels and beats (in brackets) by which they were unwrapped, from coarse to
    /// fine, if by a chain.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub chain: Option<Vec<String>>,
    /// The map that they were unwrapped about: reference, golden, preliminary or given; `None` if
    /// they are absolute by themselves.
    pub map: Option<&'static str>,
    /// The recipe that was given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub recipe: Option<RecipeReference>,
}

/// The summary of a measurement. Everything but the times is the same with any number of threads.
#[derive(Clone, Debug, Serialize)]
pub struct MeasurementReport {
    /// Pixels whose coarsest level is modulated, and those that truth calls wholly lit.
    pub lit: usize,
    /// Lit pixels whose phase and, where there is geometry, height are valid.
    pub resolved: usize,
    /// Lit pixels that are not resolved, by their first failing reason.
    pub unresolved: BTreeMap<&'static str, usize>,
    /// Pixels that were not decoded, because the expected map is unknown there.
    pub skipped: usize,
    /// How the levels were unwrapped.
    #[serde(flatten)]
    pub manner: Manner,
    /// Wall time per stage in µs.
    pub stage_us: BTreeMap<&'static str, u64>,
    /// σ of one sample in counts: the recording's, else the recipe's, else from the frames'
    /// redundancy (N ≥ 4).
    pub noise_counts: Option<f64>,
    /// Why there is only the wrapped phase of the finest level, if there is no absolute phase.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub no_phase: Option<String>,
    /// The fringes that heights are by, of several: vertical, horizontal or file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub heights_by: Option<&'static str>,
    /// Why heights scatter much, if these fringes hardly depend on them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub poor_heights: Option<String>,
    /// Why there is no height, if there is none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub no_height: Option<String>,
    /// Why there is no σ, if there is none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub no_sigma: Option<&'static str>,
    /// Lowest and highest height in mm.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub height_mm: Option<[f64; 2]>,
    /// RMS of the predicted σ_z over resolved pixels, mm.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sigma_mm: Option<f64>,
    /// U = 2 √(`sigma_mm`² + σ²), σ that of a height by the uncertainty of the calibration that was
    /// named, mm.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub uncertainty_mm: Option<f64>,
    /// What could be done about pixels that are not resolved.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub advice: Option<String>,
    /// What looked wrong when the recording was imported.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub notes: Vec<String>,
    /// What is ambiguous about the heights, if anything is.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ambiguous: Option<String>,
    /// Errors against the recording's truth.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub score: Option<Score>,
}

impl MeasurementReport {
    pub(super) fn new(
        phases: &PhaseMap,
        heights: &Result<Surface, NoHeights>,
        manner: Manner,
        noise_counts: Option<f64>,
        truth: &Truth<'_>,
        stage_us: BTreeMap<&'static str, u64>,
    ) -> Self {
        // A dark pixel that truth calls wholly lit counts as lit and unresolved.
        let dark_but_lit = (0..phases.trust.len())
            .filter(|&at| phases.trust[at] == Trust::Dark && truth.whole(at))
            .count();
        let resolved = phases.count(Trust::Resolved);
        let unresolved: BTreeMap<_, _> = Trust::REASONS
            .into_iter()
            // Edges of light are refused where a recipe says so.
            .filter(|reason| !matches!(reason, Trust::Unexpected | Trust::LightEdge))
            .map(|reason| match reason {
                Trust::Dark => (reason.word(), dark_but_lit),
                _ => (reason.word(), phases.count(reason)),
            })
            .collect();
        let map = heights.as_ref().ok().map(|surface| &surface.map);
        let sigma_mm = map.and_then(|map| {
            let known = || map.sigma.iter().filter(|sigma| !sigma.is_nan());
            let squares: f64 = known().map(|&sigma| f64::from(sigma).powi(2)).sum();
            (squares > 0.0).then(|| (squares / known().count() as f64).sqrt())
        });
        let height_mm = map.and_then(|map| {
            let known = || map.height.iter().filter(|height| height.is_known());
            Some([known().min()?.mm(), known().max()?.mm()])
        });
        let lit = resolved + unresolved.values().sum::<usize>();
        let beyond = phases.count(Trust::OutOfRange);
        Self {
            advice: advice(phases.trust.len(), lit, beyond, heights, noise_counts),
            lit,
            resolved,
            unresolved,
            skipped: phases.count(Trust::Unexpected),
            manner,
            stage_us,
            noise_counts,
            no_phase: None,
            heights_by: None,
            poor_heights: None,
            no_height: heights.as_ref().err().map(NoHeights::to_string),
            no_sigma: noise_counts.is_none().then_some(
                "the recording has no camera.noise_counts and no resolved pixels under 4 or more shifts to estimate it from",
            ),
            height_mm,
            sigma_mm,
            uncertainty_mm: None,
            notes: Vec::new(),
            ambiguous: None,
            score: map.and_then(|map| truth.score(phases, map)),
        }
    }

    /// With the fringes that heights are by, of several, and what these tell of them.
    pub(super) fn by(
        self,
        recording: &Recording,
        primary: usize,
        sensitivity: Option<Sensitivity>,
    ) -> Self {
        let several = self.no_height.is_none() && recording.patterns.len() > 1;
        Self {
            heights_by: several.then(|| direction::word(&recording.patterns[primary])),
            poor_heights: sensitivity
                .and_then(|sensitivity| sensitivity.poor())
                .map(|poor| format!("{poor}: project fringes of the other direction")),
            ..self
        }
    }

    /// Adds the uncertainty of the models that were measured with: σ of a height in mm, if it is
    /// known.
    pub fn add_models(&mut self, sigma_mm: Option<f64>) {
        let both = self.sigma_mm.zip(sigma_mm);
        self.uncertainty_mm = both.map(|(noise, models)| COVERAGE_FACTOR * noise.hypot(models));
    }

    /// The report as lines of a name and a value.
    pub fn table(&self) -> String {
        let mut table = String::new();
        // Writing to a string cannot fail.
        let mut line = |name: &str, value: String| {
            let _ = writeln!(table, "{name:<30}{value}");
        };
        let Manner {
            kind,
            ratios,
            chain,
            map,
            recipe,
        } = &self.manner;
        let ratios: Vec<String> = ratios.iter().map(|ratio| format!("{ratio:.6}")).collect();
        match ratios.is_empty() {
            true => line("levels", (*kind).into()),
            false => line("levels", format!("{kind}, ratios {}", ratios.join(" "))),
        }
        if let Some(chain) = chain {
            line("unwrapped by", chain.join(", "));
        }
        if let Some(map) = map {
            line("unwrapped about", format!("the {map} map"));
        }
        if let Some(RecipeReference {
            number,
            fingerprint,
        }) = recipe
        {
            line("recipe", format!("{number}, fingerprint {fingerprint}"));
        }
        line("lit", format!("{} px", self.lit));
        line("resolved", format!("{} px", self.resolved));
        for (reason, count) in self.unresolved.iter().filter(|(_, count)| **count > 0) {
            line(&format!("  unresolved: {reason}"), format!("{count} px"));
        }
        if let Some(advice) = &self.advice {
            line("  to resolve more", advice.clone());
        }
        if let Some(reason) = &self.no_phase {
            line("absolute phase", format!("none: {reason}"));
        }
        if let Some([low, high]) = self.height_mm {
            line("height", format!("{low:.3} to {high:.3} mm"));
        }
        if let Some(fringes) = self.heights_by {
            line("  by fringes", fringes.into());
        }
        if let Some(words) = &self.poor_heights {
            line("  poor", words.clone());
        }
        if let Some(reason) = &self.no_height {
            line("height", format!("none: {reason}"));
        }
        if let Some(words) = &self.ambiguous {
            line("ambiguous", words.clone());
        }
        match (self.noise_counts, self.no_sigma) {
            (Some(noise), _) => line("noise of a sample", format!("{noise:.2} counts")),
            (None, Some(reason)) => line("noise of a sample", format!("not known: {reason}")),
            (None, None) => {}
        }
        if let Some(sigma) = self.sigma_mm {
            line("height noise (1 σ)", format!("{sigma:.4} mm RMS"));
        }
        if let Some(uncertainty) = self.uncertainty_mm {
            line("uncertainty (k = 2)", format!("{uncertainty:.4} mm"));
        }
        if let Some(score) = &self.score {
            line(
                "error against truth",
                format!("{:.4} mm RMS over {} px", score.rms_mm, score.scored),
            );
            line("  bias", format!("{:+.4} mm", score.bias_mm));
            line(
                "  median, 99 %",
                format!("{:.4} mm, {:.4} mm", score.median_mm, score.p99_mm),
            );
            line("  gross (over 1 mm)", format!("{} px", score.gross));
        }
        if !self.notes.is_empty() {
            line("looks wrong", self.notes.join("; "));
        }
        for (stage, us) in &self.stage_us {
            line(
                &format!("time: {stage}"),
                format!("{:.1} ms", *us as f64 / 1000.0),
            );
        }
        table
    }
}

/// What could be done about `beyond` of the lit pixels that are out of range, or where next to none
/// is lit.
fn advice(
    pixels: usize,
    lit: usize,
    beyond: usize,
    heights: &Result<Surface, NoHeights>,
    noise_counts: Option<f64>,
) -> Option<String> {
    if let Ok(surface) = heights
        && 2 * beyond > lit
    {
        let range = surface.triangulator.range();
        return Some(format!(
            "{:.0} % of the lit pixels lie beyond the working range of {:.0} to {:.0} mm: state another one with fringed-lab import --range, or \
             range_mm in recording.json",
            100.0 * beyond as f64 / lit as f64,
            range.low,
            range.high
        ));
    }
    (100 * lit < pixels && noise_counts.is_none()).then(|| {
        "next to no pixel has the 16 of 255 counts of modulation that a camera of unknown noise needs: if the pictures are only dim, \
         state its noise with fringed-lab import --noise, or camera.noise_counts in recording.json"
            .into()
    })
}

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
