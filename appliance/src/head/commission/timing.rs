//! The step `timing`: what does not depend on the geometry is measured.

use super::Subject;
use super::file::Commissioning;
use super::outcome::Outcome;
use crate::error::Result;
use crate::head::calibrate::{characterise, off_proportion};
use crate::head::examine::by_pitch;
use serde_json::json;

pub(super) fn measure(
    subject: &mut Subject<'_>,
    kept: &mut Commissioning,
) -> Result<Option<Outcome>> {
    let response = kept.measured.as_ref().map(|known| known.response.clone());
    let before = subject.before.as_ref();
    let mut notes = Vec::new();
    let measured = characterise(
        subject.head,
        subject.calibration,
        response.or_else(|| before?.response.clone()),
        &mut notes,
        subject.progress,
    )?;
    let figures = json!({
        "delay_ms": measured.timing.flip_to_light_ns as f64 * 1e-6, "stamp": measured.timing.stamp,
        "nonlinear_percent": off_proportion(&measured.response) / 2.55,
        "noise_counts": measured.noise.counts, "contrast": by_pitch(&measured.contrast),
    });
    let words = measured.words().into_iter();
    let said = words.map(|(name, found)| format!("{name}: {found}"));
    let outcome = Outcome::passed(said.chain(notes), figures);
    kept.measured = Some(measured);
    Ok(Some(outcome))
}
