//! Teaching: from a good part in front of the head to a recipe.

pub use super::failure::TeachError;
pub use super::golden::{Naming, TaughtRecipe};

use super::PatternFile;
use super::adaptive::{AdaptivePattern, Preliminary};
use super::candidates::candidates;
use super::captures::{CAPTURES, Captured};
use super::comparison::ComparisonFile;
use super::golden::GoldenPart;
use super::plan::Plan;
use super::proof;
use crate::head::calibrated::CalibratedHead;
use crate::head::calibration::Calibration;
use crate::head::rasters::Illumination;
use crate::system::computing::Computing;
use algo::pattern::{Sequence, Shot};
use algo::phase::Trust;
use algo::pipeline::PhaseMap;
use hal::head::Head;
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
/// `progress` gets the share done and the current stage in words.
///
/// # Errors
/// If a device fails or the scene cannot be taught.
pub fn teach(
    head: &mut Head,
    calibration: &Calibration,
    naming: &Naming,
    timeout: Duration,
    progress: &dyn Fn(f64, &str),
) -> Result<TaughtRecipe, TeachError> {
    let all = |share: f64, words: &str| {
        progress(share, words);
        true
    };
    let computing = Computing::default();
    teach_while(head, calibration, naming, timeout, &computing, &all)
}

/// As [`teach`], but it ends before the next stage or capture when `progress` returns `false`.
/// `computing` marks the stages that use no device.
///
/// # Errors
/// As [`teach`]; [`TeachError::Ended`] if `progress` ended it.
pub fn teach_while(
    head: &mut Head,
    calibration: &Calibration,
    naming: &Naming,
    timeout: Duration,
    computing: &Computing,
    progress: &dyn Fn(f64, &str) -> bool,
) -> Result<TaughtRecipe, TeachError> {
    let stage = |share: f64, words: &str| match progress(share, words) {
        true => Ok(()),
        false => Err(TeachError::Ended),
    };
    stage(0.0, "measuring the part")?;
    let mut head = CalibratedHead {
        head,
        calibration,
        timeout,
    };
    let raster = &calibration.projector;
    let preliminary = Preliminary::new((raster.width(), raster.height()))?;
    // Checked before the next stage: a sequence is not interrupted.
    let measuring = |share: f64| {
        progress(0.3 * share, "measuring the part");
    };
    let Preliminary { function, shots } = &preliminary;
    let mut first = head.measure(function, shots, None, &measuring)?;
    let mut illumination = Illumination::default();
    if naming.exposures > 1 {
        stage(0.3, "measuring the part with longer exposures")?;
        illumination = computing.on(|| preliminary.illumination(&first, calibration, naming));
        first = head.measure_lit(&illumination, function, shots, None, &|_| ())?;
    }
    refuse_empty(&first.phases)?;
    stage(0.35, "making the part's own pattern")?;
    let AdaptivePattern { function, expected } =
        computing.on(|| preliminary.adapt(&first, calibration))?;
    let full = Sequence::dense(DENSE_N, SHIFTS);
    let candidates = candidates(calibration.waveforms(), &full);
    let sequences: Vec<&[Shot]> = candidates.iter().map(|(_, frames)| &frames[..]).collect();
    let golden = Captured::take(
        &mut head,
        &illumination,
        &function,
        &sequences,
        &expected,
        &|share| {
            progress(
                0.4 + 0.35 * share,
                "measuring the part with its own pattern",
            )
        },
    )?;
    refuse_empty(&golden.phases)?;
    stage(0.75, "working out the expansion and the safe mask")?;
    let adaptive = (full.len(), &golden.phases, &golden.heights);
    let fixed = (preliminary.shots.len(), &first.phases, &first.heights);
    let comparison = ComparisonFile::of(fixed, adaptive);
    // Their memory is free before the recipe's arrays are made.
    drop((first, expected));
    let part = GoldenPart {
        calibration,
        pattern: PatternFile::File,
        illumination,
        full: &full,
        decoder: &golden.decoder,
        triangulator: &golden.triangulator,
        phases: &golden.phases,
        heights: &golden.heights,
        offsets: &golden.offsets,
        signal: &golden.signal,
        noise: golden.noise,
        offset_counts: golden.offset_counts,
        captures: CAPTURES,
        comparison: Some(comparison),
    };
    let taught = computing.on(|| part.recipe(naming));
    let mut taught = taught.map_err(TeachError::Rig)?;
    taught.choice.reasons.extend(part.illumination.words());
    drop(golden);
    stage(0.9, "trying the recipe on the part")?;
    let plan = computing.on(|| Plan::new(taught.recipe.clone(), calibration, false));
    let plan = plan.map_err(TeachError::rig)?;
    let trying = |share: f64| progress(0.9 + 0.1 * share, "trying the recipe on the part");
    let mut judged = proof::as_it_lies(&plan, head.head, calibration, timeout, &trying)?;
    drop(plan);
    if let Some(words) = proof::not_judged(&judged) {
        return Err(TeachError::Scene(words));
    }
    let mut words = proof::leave_out_covered(&mut taught.manifest, &mut judged);
    words.extend(proof::hold(&mut taught.manifest, &judged));
    if !words.is_empty() {
        let reasons = taught.choice.reasons;
        let again = computing.on(|| TaughtRecipe::of(taught.manifest, taught.recipe.arrays));
        taught = again.map_err(TeachError::Rig)?;
        taught.choice.reasons = reasons.into_iter().chain(words).collect();
    }
    stage(1.0, "taught")?;
    Ok(taught)
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
