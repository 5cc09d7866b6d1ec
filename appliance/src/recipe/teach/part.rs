//! What is taken for the part: without what it lies on and what lies beside it, and as the page
//! shows it before anything is judged by it.

use super::TeachError;
use crate::head::calibrated::EmptyStation;
use crate::recipe::plan::taught;
use crate::station::Square;
use algo::geometry::Triangulator;
use algo::inspect;
use algo::inspect::{Marking, Surroundings};
use algo::phase::Trust;
use algo::pipeline::{HeightMap, PhaseMap};
use algo::units::{AbsolutePhase, Height, Modulation};
use hal::frame::Frame;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// What is known of a part's surroundings before it is measured.
#[derive(Clone, Copy, Debug)]
pub struct SceneFacts<'a> {
    /// Whether all that is seen is the part.
    pub everything: bool,
    /// What a person has marked.
    pub marking: &'a Marking,
    /// What is seen without a part, if it was recorded.
    pub empty: Option<&'a EmptyStation>,
    /// How far parts may be displaced, mm.
    pub tolerance_mm: f64,
}

/// The surroundings of a measured part; `None` if nothing but the part is seen.
///
/// # Errors
/// If nothing stands out where a person has touched the part.
pub fn of(
    heights: &HeightMap,
    triangulator: &Triangulator,
    told: SceneFacts<'_>,
) -> Result<Option<Surroundings>, TeachError> {
    if told.everything {
        return Ok(None);
    }
    let (width, pixels) = (heights.width, heights.height.len());
    let mut sigmas: Vec<f32> = heights
        .sigma
        .iter()
        .copied()
        .filter(|sigma| sigma.is_finite())
        .collect();
    if sigmas.is_empty() {
        return Ok(None);
    }
    let middle = sigmas.len() / 2;
    let sigma = f64::from(*sigmas.select_nth_unstable_by(middle, f32::total_cmp).1);
    let point = |at: usize| triangulator.point(at % width, at / width, heights.height[at]);
    let empty = told.empty.map(|empty| &empty.heights[..]);
    let found = inspect::surroundings((pixels, width), sigma, (told.marking, empty), point);
    let found = found.map_err(|missed| TeachError::Scene(missed.to_string()))?;
    let away = taught::pixels(triangulator, told.tolerance_mm);
    Ok(found.map(|found| found.clear_of_others(width, away)))
}

/// Makes pixels that are not of the part those of nothing.
pub fn leave_out(surroundings: &Surroundings, phases: &mut PhaseMap, heights: &mut HeightMap) {
    let others = surroundings.part.iter().enumerate();
    for (at, _) in others.filter(|(_, part)| !**part) {
        if phases.trust[at] == Trust::Resolved {
            phases.trust[at] = Trust::OutOfRange;
        }
        (phases.phase[at], phases.modulation[at]) = (AbsolutePhase::UNKNOWN, Modulation::default());
        (heights.height[at], heights.sigma[at]) = (Height::UNKNOWN, f32::NAN);
    }
}

/// Which pixels have a sample at full scale in any of the frames.
pub fn clipped(frames: &[Frame]) -> Vec<bool> {
    let mut clipped = Vec::new();
    for frame in frames {
        let (full_scale, counts) = (f32::from(frame.format().full_scale()), frame.counts());
        clipped.resize(counts.len(), false);
        for (clipped, sample) in clipped.iter_mut().zip(counts) {
            *clipped |= sample >= full_scale;
        }
    }
    clipped
}

/// Calls unresolved pixels saturated that are clipped where the pattern was measured by which the part's
/// own one was made: there was no phase of them, which that one needs.
pub fn name_highlights(clipped: &[bool], phases: &mut PhaseMap) {
    for (trust, _) in phases
        .trust
        .iter_mut()
        .zip(clipped)
        .filter(|(_, clipped)| **clipped)
    {
        if !matches!(trust, Trust::Resolved | Trust::OutOfRange) {
            *trust = Trust::Saturated;
        }
    }
}

/// What is said of them.
pub fn words(surroundings: &Surroundings) -> String {
    let Surroundings {
        part,
        step_mm,
        others,
        ..
    } = surroundings;
    let share = |of: &[bool]| of.iter().filter(|is| **is).count() as f64 / of.len().max(1) as f64;
    let others = match share(others) * 100.0 {
        percent if percent < 0.05 => String::new(),
        percent => format!("; other things on {percent:.1} % of the frame are left out"),
    };
    let percent = share(part) * 100.0;
    match step_mm {
        Some(step) => format!(
            "the part is {percent:.1} % of the frame and stands out from what it lies on by {step:.2} mm or more{others}"
        ),
        None => {
            format!("the part is {percent:.1} % of the frame, as it was marked or recorded{others}")
        }
    }
}

/// The picture of a part that was taught, or was to be.
#[derive(Clone, Debug, Default)]
pub struct PartSeen {
    /// Columns.
    pub width: usize,
    /// Modulation of each pixel, counts.
    pub modulation: Vec<f32>,
    /// 1 where it was taken for the part, else 0.
    pub part: Vec<f32>,
    /// What was marked in it.
    pub marking: Marking,
    /// Where good parts would not keep their limit, if that is why it was refused.
    pub place: Option<Square>,
}

impl PartSeen {
    /// Of what was measured. `part` has the pixels of the part; without it all that has a phase is.
    pub(crate) fn of(
        (phases, full_scale): (&PhaseMap, u16),
        part: Option<&[bool]>,
        marking: &Marking,
    ) -> Self {
        let counts = |of: &Modulation| of.counts(full_scale) as f32;
        let resolved = phases.trust.iter().enumerate();
        let resolved = resolved.map(|(at, trust)| {
            *trust == Trust::Resolved && part.is_none_or(|part| part.get(at) == Some(&true))
        });
        Self {
            width: phases.width,
            modulation: phases.modulation.iter().map(counts).collect(),
            part: resolved.map(|is| f32::from(u8::from(is))).collect(),
            marking: marking.clone(),
            place: None,
        }
    }
}

/// What was seen last. Cheap to clone.
#[derive(Clone, Debug, Default)]
pub struct LastSeen(Arc<Mutex<Option<Arc<PartSeen>>>>);

impl LastSeen {
    /// The picture of the part that was taught last, `None` before the first.
    pub fn get(&self) -> Option<Arc<PartSeen>> {
        self.locked().clone()
    }

    /// Shows another one.
    pub fn show(&self, seen: PartSeen) {
        *self.locked() = Some(Arc::new(seen));
    }

    /// Marks the place for which it was refused.
    pub fn refuse(&self, place: Option<Square>) {
        if let Some(seen) = &mut *self.locked() {
            Arc::make_mut(seen).place = place;
        }
    }

    fn locked(&self) -> MutexGuard<'_, Option<Arc<PartSeen>>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
