//! Why teaching makes no recipe with the limit of the deviation that is asked for.
//!
//! A limit that good parts would not keep is never widened: whoever opens it has to say so.

use super::RecipeFile;
use super::failure::TeachError;
use super::golden::GoldenPart;
use super::good_parts::rounded_up;
use super::proof::band;
use crate::station::{Inspection, Square};
use algo::phase::Trust;

/// A limit that is proposed is so many times as wide as the largest deviation.
const WIDER: f64 = 1.2;
/// A place is beside an edge or a highlight within so many pixels.
const BESIDE_PX: usize = 6;
/// Neighbouring heights that differ by more than this are two surfaces, mm.
const STEP_MM: f32 = 1.5;

/// A limit that good parts do not keep.
#[derive(Debug)]
pub(super) struct Exceeded {
    gauge: String,
    limit_mm: f64,
    deviation_mm: f64,
    within_mm: f64,
    /// Where they deviate most, if that is known.
    pub square: Option<Square>,
}

/// The deviation whose limit some of these cycles of good parts do not keep.
pub(super) fn exceeded(manifest: &RecipeFile, judged: &[Inspection]) -> Option<Exceeded> {
    let gauges = manifest.gauges.iter().enumerate();
    let mut deviations = gauges.filter(|(_, gauge)| gauge.is_deviation());
    deviations.find_map(|(at, gauge)| {
        let limit_mm = gauge.high?;
        let found = judged.iter().filter_map(|of| of.gauges.get(at));
        let read = found.filter_map(|found| {
            let value = found.value?.abs() + band(found, manifest.guard_k);
            Some((value, found.square))
        });
        let (deviation_mm, square) = read.max_by(|a, b| a.0.total_cmp(&b.0))?;
        (deviation_mm > limit_mm).then(|| Exceeded {
            gauge: gauge.name.clone(),
            limit_mm,
            deviation_mm,
            within_mm: manifest.placement_tolerance_mm,
            square,
        })
    })
}

impl Exceeded {
    /// What to say of it; `cause` says what is seen at the place.
    pub fn refusal(&self, cause: &str) -> TeachError {
        let Self {
            gauge,
            limit_mm,
            deviation_mm,
            within_mm,
            square,
        } = self;
        let place = square.map_or(String::new(), |at| {
            format!(" about column {}, row {}{cause}", at.column, at.row)
        });
        let words = format!(
            "good parts that lie within {within_mm} mm would not keep the limit of {gauge}, ±{limit_mm} mm: they deviate by \
             {deviation_mm:.3} mm{place}. Mark the part in the picture, cover or remove what is not of it, give a smaller placement tolerance, or choose \
             the limit: ±{} mm would be kept",
            rounded_up(WIDER * deviation_mm)
        );
        TeachError::Limit {
            words,
            place: *square,
        }
    }
}

/// What to say of noise that alone exceeds the limit.
pub(super) fn too_noisy(asked_mm: f64, held_mm: f64) -> String {
    format!(
        "noise alone would exceed the limit of the deviation, ±{asked_mm} mm: give more light or more exposures, another pose, or \
         choose the limit: ±{held_mm} mm would be kept"
    )
}

impl GoldenPart<'_> {
    /// What is seen about a place where good parts deviate most. `heights` are golden's, mm.
    pub(super) fn cause(&self, square: Option<Square>, heights: &[f32]) -> &'static str {
        let Some(square) = square else { return "" };
        let width = self.heights.width;
        let rows = heights.len() / width.max(1);
        let around = |at: u32, end: usize| {
            let at = at as usize;
            at.saturating_sub(BESIDE_PX)..(at + BESIDE_PX + 1).min(end)
        };
        let columns = around(square.column, width);
        let places =
            around(square.row, rows).flat_map(|v| columns.clone().map(move |u| v * width + u));
        let places: Vec<usize> = places.collect();
        let any = |trust| places.iter().any(|at| self.phases.trust[*at] == trust);
        let jump = |at: &usize| {
            let next = heights.get(at + 1).copied().unwrap_or(f32::NAN);
            (next - heights[*at]).abs() > STEP_MM
        };
        if any(Trust::Saturated) {
            ", beside a highlight"
        } else if places.iter().any(jump) {
            ", at a step between two surfaces, of which one may be what the part lies on"
        } else if places.iter().any(|at| heights[*at].is_nan()) {
            ", at an edge of the part"
        } else {
            ""
        }
    }
}
