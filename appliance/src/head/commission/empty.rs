//! The step `empty`, which may be left out: what is seen without a part is recorded.

use super::Subject;
use super::file::Commissioning;
use super::outcome::Outcome;
use crate::error::{Exit, Failure, Result};
use crate::head::calibrated::MeasureError;
use crate::head::empty::EmptyStation;
use serde_json::json;

pub(super) fn measure(subject: &mut Subject<'_>, _: &mut Commissioning) -> Result<Option<Outcome>> {
    if !subject.calibrated {
        let words = ("the head is not calibrated", "do the steps before this one");
        return Ok(Some(Outcome::failed(words.0, words.1)));
    }
    let failed = |words: String| Failure::because(Exit::Content, "record the empty station", words);
    let progress = |share: f64| (subject.progress)(share, "measuring the empty station");
    let empty = EmptyStation::measure(subject.head, subject.calibration, &progress);
    let empty = empty.map_err(|error| match error {
        MeasureError::Device(error) => error.into(),
        MeasureError::Impossible(words) => failed(words),
    })?;
    let stored = empty.store(subject.place, subject.calibration);
    stored.map_err(failed)?;
    let seen = 100.0 * empty.seen();
    let said = format!(
        "{seen:.1} % of the picture shows something without a part: parts that are taught from now on are told from it"
    );
    Ok(Some(Outcome::passed(
        [said],
        json!({ "seen_percent": seen }),
    )))
}
