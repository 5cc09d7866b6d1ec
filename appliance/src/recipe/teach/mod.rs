//! Teaching: from a good part in front of the head to a recipe.

pub mod adaptive;
pub mod captures;
pub mod golden;
pub mod good_parts;
mod illumination;
mod limits;
pub mod part;
pub mod planner;
mod proof;
pub mod replace;
mod rounds;
mod sequences;
mod sides;

pub use golden::{Naming, TaughtRecipe, UnsealedRecipe};

use crate::error::code_of;
use crate::head::calibrated::{CalibratedHead, MeasureError};
use crate::head::calibration::Calibration;
use crate::head::rasters::Illumination;
use crate::recipe::file::ComparisonFile;
use crate::recipe::plan::Plan;
use crate::recipe::{PatternFile, Recipe, Refusal};
use crate::station::{Square, error_code};
use crate::system::computing;
use crate::system::computing::Computing;
use crate::system::headway::Headway;
use adaptive::{AdaptivePattern, Preliminary};
use algo::adaptive::AdaptError;
use algo::pattern::{Sequence, Shot};
use algo::phase::Trust;
use algo::pipeline::PhaseMap;
use captures::{CAPTURES, Captured};
use golden::GoldenPart;
use hal::head::Head;
use part::{LastSeen, PartSeen};
use sequences::candidates;
use std::fmt::Display;
use std::time::Duration;

/// Shifts per level of the part's own pattern.
const SHIFTS: usize = 4;
/// n of the dense levels about the expected map: they unwrap ± (n²/2 − n) = ± 4 turns.
const DENSE_N: f64 = 4.0;
/// A scene cannot be taught if less than this share of the frame is resolved.
const LEAST_RESOLVED: f64 = 0.005;

/// Measures the part in front of the head with a fixed pattern, makes its adaptive pattern,
/// measures it several times with that pattern by every sequence that production may use, makes the
/// recipe, and tries it on the part; nothing is stored here. The part must not move meanwhile.
/// It ends before the next stage or capture where `headway` says so.
///
/// # Errors
/// If a device fails or the scene cannot be taught; [`TeachError::Ended`] if `headway` ended it.
pub fn teach(
    head: &mut Head,
    calibration: &Calibration,
    naming: &Naming,
    timeout: Duration,
    headway: Headway<'_>,
) -> Result<UnsealedRecipe, TeachError> {
    let seen = (Computing::default(), LastSeen::default());
    teach_showing(
        head,
        calibration,
        naming,
        timeout,
        (&seen.0, &seen.1),
        headway,
    )
}

/// As [`teach`]; `computing` marks the stages that use no device, and `seen` shows what is taken for the part.
///
/// # Errors
/// As [`teach`].
pub fn teach_showing(
    head: &mut Head,
    calibration: &Calibration,
    naming: &Naming,
    timeout: Duration,
    (computing, seen): (&Computing, &LastSeen),
    headway: Headway<'_>,
) -> Result<UnsealedRecipe, TeachError> {
    let stage = |from: f64, to: f64, words| {
        let stage = headway.part(from, to).called(words);
        match stage.tell(0.0) {
            true => Ok(stage),
            false => Err(TeachError::Ended),
        }
    };
    let measuring = stage(0.0, 0.15, "measuring the part")?;
    // Every stage asks for the rays of all pixels.
    let calibration = &calibration.clone().with_rays();
    let mut head = CalibratedHead::new(head, calibration, timeout);
    let raster = &calibration.projector;
    let preliminary = Preliminary::new((raster.width(), raster.height()))?;
    let Preliminary { function, shots } = &preliminary;
    // Checked before the next stage: a sequence is not interrupted.
    let measured = |share| measuring.done(share);
    let mut first = head.measure(function, shots, None, &measured)?;
    let (wanted, shines) = computing.on(|| {
        let wanted = illumination::wanted(&first, naming);
        (wanted, illumination::shines(&first))
    });
    let exposures = illumination::possible(wanted, naming, &mut head)?;
    let mut illumination = Illumination::default();
    if exposures > 1 || shines {
        let again = stage(0.15, 0.2, "measuring the part in the light that suits it")?;
        head.least = calibration.least_modulation_of_dark();
        let dimmed = if shines {
            Some(preliminary.dimmed(&mut head)?)
        } else {
            None
        };
        let asked = (exposures, naming);
        illumination = computing.on(|| {
            preliminary.illumination(&first, dimmed.as_ref(), asked, calibration.noise_counts)
        });
        let measured = |share| again.done(share);
        first = head.measure_lit(&illumination, function, shots, None, &measured)?;
    }
    refuse_empty(&first.phases)?;
    let found = computing.on(|| part::of(&first.heights, &first.triangulator, naming.told()));
    let full_scale = first.decoder.full_scale();
    let measured = (&first.phases, full_scale);
    let shown = |part| seen.show(PartSeen::of(measured, part, &naming.marking));
    let found = found.inspect_err(|_| shown(None))?;
    shown(found.as_ref().map(|found| &found.part[..]));
    if let Some(found) = &found {
        part::leave_out(found, &mut first.phases, &mut first.heights);
    }
    let adapting = stage(0.2, 0.3, "making the part's own pattern")?;
    let adapted = |share| adapting.done(share);
    let AdaptivePattern { function, expected } =
        computing.on(|| preliminary.adapt(&first, calibration, &adapted))?;
    let clipped = part::clipped(&first.frames);
    // Their memory is free for the captures.
    first.frames = Vec::new();
    let full = Sequence::dense(DENSE_N, SHIFTS);
    let candidates = candidates(calibration.waveforms(), &full);
    let sequences: Vec<&[Shot]> = candidates.iter().map(|(_, frames)| &frames[..]).collect();
    let mut golden = Captured::take(
        &mut head,
        &illumination,
        &function,
        &sequences,
        &expected,
        stage(0.3, 0.55, "measuring the part with its own pattern")?,
    )?;
    if let Some(found) = &found {
        part::leave_out(found, &mut golden.phases, &mut golden.heights);
    }
    part::name_highlights(&clipped, &mut golden.phases);
    let light_edges = computing.on(|| golden.refuse_light_edges(shines));
    refuse_empty(&golden.phases)?;
    let adaptive = (full.len(), &golden.phases, &golden.heights);
    let fixed = (preliminary.shots.len(), &first.phases, &first.heights);
    let comparison = ComparisonFile::of(fixed, adaptive);
    // Their memory is free before the recipe's arrays are made.
    drop((first, expected));
    let part = GoldenPart {
        calibration,
        pattern: PatternFile::File,
        illumination,
        light_edges,
        full: &full,
        decoder: golden.decoder,
        triangulator: golden.triangulator,
        phases: golden.phases,
        heights: golden.heights,
        offsets: golden.offsets,
        signal: golden.signal,
        noise: golden.noise,
        offset_counts: golden.offset_counts,
        surroundings: found,
        captures: CAPTURES,
        comparison: Some(comparison),
    };
    let words = part.illumination.words();
    let words = words.map(|words| words + &illumination::unseen(&part.phases));
    computing::trim_memory();
    let making = stage(0.55, 0.9, "working out what good parts may read")?;
    let made = computing.on(|| part.recipe(naming, making));
    let UnsealedRecipe {
        mut manifest,
        arrays,
        mut choice,
    } = made?;
    choice.reasons.extend(words);
    computing::trim_memory();
    let trying = stage(0.9, 1.0, "trying the recipe on the part")?;
    let recipe = Recipe::check(&manifest, arrays.clone())?;
    let plan = computing.on(|| Plan::telling(recipe, calibration, false, trying.part(0.0, 0.4)));
    let plan = plan.map_err(TeachError::rig)?;
    let trying = trying.part(0.4, 1.0);
    let lying = trying.part(0.0, 0.8);
    let mut judged = proof::as_it_lies(&plan, head.head, calibration, timeout, lying)?;
    trying.done(0.8);
    drop(plan);
    if let Some(words) = proof::not_judged(&judged) {
        return Err(TeachError::Scene(words));
    }
    let asked = naming.limit_mm.is_some();
    if asked && let Some(exceeded) = limits::exceeded(&manifest, &judged) {
        return Err(exceeded.refusal(""));
    }
    choice.reasons.extend(proof::unsteady(&judged));
    let mut words = proof::leave_out_covered(&mut manifest, &mut judged);
    words.extend(proof::hold(&mut manifest, &judged));
    let moved = !words.is_empty();
    choice.reasons.extend(words);
    if !moved {
        return Ok(UnsealedRecipe {
            manifest,
            arrays,
            choice,
        });
    }
    // Other limits may ask for another sequence.
    let settling = trying.part(0.8, 1.0);
    let settled = computing.on(|| UnsealedRecipe::of(manifest, arrays, settling));
    let mut settled = settled?;
    settled.choice.reasons = choice.reasons;
    Ok(settled)
}

/// Refuses a scene that shows too little to be taught.
///
/// # Errors
/// If less than half a per cent of the frame is resolved: the most frequent reason, with the
/// remedy.
pub fn refuse_empty(phases: &PhaseMap) -> Result<(), TeachError> {
    let pixels = phases.trust.len() as f64;
    if phases.count(Trust::Resolved) as f64 >= LEAST_RESOLVED * pixels {
        return Ok(());
    }
    let share = |trust| phases.count(trust) as f64 / pixels * 100.0;
    let reason = [
        (
            Trust::Saturated,
            "is saturated: shorten the exposure or close the aperture",
        ),
        (
            Trust::OutOfRange,
            "lies outside the working range: move the part or widen range_mm",
        ),
        (
            Trust::LowModulation,
            "shows the coarse pattern only: focus camera and projector",
        ),
        (
            Trust::Residual,
            "gives contradicting phases: does the part or the light move?",
        ),
    ]
    .into_iter()
    .filter(|(trust, _)| share(*trust) > 100.0 * LEAST_RESOLVED)
    .max_by(|(a, _), (b, _)| share(*a).total_cmp(&share(*b)));
    Err(TeachError::Scene(match reason {
        Some((trust, words)) => format!("{:.1} % of the frame {words}", share(trust)),
        None => format!(
            "{:.1} % of the frame is dark: is the part in place and the projector on?",
            share(Trust::Dark)
        ),
    }))
}

/// A part that could not be taught.
#[derive(Debug, thiserror::Error)]
pub enum TeachError {
    /// A device failed.
    #[error("teach: {0}")]
    Device(hal::error::Error),
    /// No recipe can be made of this scene.
    #[error("teach: {0}")]
    Scene(String),
    /// Good parts would not keep the limit of the deviation.
    #[error("teach: {words}")]
    Limit {
        /// In words, with the remedy.
        words: String,
        /// Where they deviate most, if that is known.
        place: Option<Square>,
    },
    /// The geometry or the pattern is impossible.
    #[error("teach: {0}")]
    Rig(String),
    /// The head's calibration cannot be used.
    #[error("teach: {0}")]
    NotCalibrated(String),
    /// The progress callback asked for the end.
    #[error("teach: it was ended early")]
    Ended,
}

impl TeachError {
    /// [`Self::Rig`] of an error.
    pub(crate) fn rig(error: impl Display) -> Self {
        Self::Rig(error.to_string())
    }

    /// The value of register ERROR_CODE.
    pub fn code(&self) -> u16 {
        match self {
            Self::Device(error) => code_of(error),
            Self::Scene(_) | Self::Limit { .. } => error_code::NOTHING_TO_TEACH,
            Self::Rig(_) => error_code::RIG,
            Self::NotCalibrated(_) => error_code::NOT_CALIBRATED,
            Self::Ended => error_code::ABORTED,
        }
    }
}

impl From<hal::error::Error> for TeachError {
    fn from(error: hal::error::Error) -> Self {
        Self::Device(error)
    }
}

impl From<MeasureError> for TeachError {
    fn from(error: MeasureError) -> Self {
        match error {
            MeasureError::Device(error) => Self::Device(error),
            MeasureError::Impossible(error) => Self::Rig(error),
        }
    }
}

impl From<Refusal> for TeachError {
    fn from(refusal: Refusal) -> Self {
        Self::rig(refusal)
    }
}

impl From<AdaptError> for TeachError {
    fn from(error: AdaptError) -> Self {
        Self::Scene(error.to_string())
    }
}
