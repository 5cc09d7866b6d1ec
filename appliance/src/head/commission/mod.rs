//! Commissioning: the steps from a bare head to a complete calibration. Each measures what the
//! doctor judges or what a calibration needs, says what is wrong and what to do, and can be repeated
//! alone; its result is kept in `commissioning.json`.
//!
//! [`Step::run`] works on the head and on the [`Commissioning`] that is kept; the owner of both, and
//! who asks for steps, are decided elsewhere: the station carries out the step that the page asks
//! for, and `fringed calibrate` the steps [`TIMING`] and [`PLANE`] one after the other.

mod kept;
mod plane;
mod poses;
mod timing;

pub use kept::{Commissioning, FILE, KeptPose, PoseModels, pose_name};
pub use plane::{HeadModels, OF_SCENARIO};
pub use poses::{Laid, PoseAction, Solving};
pub use timing::{Characteristics, off_proportion, settled};

use crate::error::{Exit, Failure, Result};
use crate::head::calibrated::{EmptyStation, MeasureError};
use crate::head::calibration::file::CalibrationFile;
use crate::head::calibration::{Calibration, HeightsBy};
use crate::head::doctor::{Check, CheckVerdict, examine_for};
use crate::system::clock;
use hal::frame::Frame;
use hal::head::Head;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};
use std::path::Path;

/// A step: a row of [`STEPS`].
#[derive(Debug)]
pub struct Step {
    /// Its name.
    pub name: &'static str,
    /// Measures, judges, and stores in what is kept what later steps need. Without an outcome the
    /// step is to be done again.
    measure: fn(&mut Subject<'_>, &mut Commissioning) -> Result<Option<StepOutcome>>,
}

/// The step before which exposure and gain are set.
pub const EXPOSURE: &str = "exposure";
/// The step in which poses are taken, and models made of them.
pub const GEOMETRY: &str = "geometry";
/// The step that measures what does not depend on the geometry.
pub const TIMING: &str = "timing";
/// The step that stores the calibration.
pub const PLANE: &str = "plane";

/// The steps in their order.
pub static STEPS: [Step; 7] = [
    Step {
        name: "devices",
        measure: |subject, _| {
            doctor(
                subject,
                &["devices", "format", "mode", "cadence", "trigger"],
            )
        },
    },
    Step {
        name: "aim",
        measure: |subject, _| doctor(subject, &["light", "contrast"]),
    },
    Step {
        name: EXPOSURE,
        measure: |subject, _| doctor(subject, &["light", "exposure"]),
    },
    Step {
        name: TIMING,
        measure: |subject, kept| timing::measure(subject, &mut kept.measured),
    },
    Step {
        name: GEOMETRY,
        measure: poses::measure,
    },
    Step {
        name: PLANE,
        measure: plane::measure,
    },
    // May be left out, and be done again.
    Step {
        name: "empty",
        measure: |subject, _| empty(subject),
    },
];

/// The head that a step works on.
pub struct Subject<'a> {
    /// The devices.
    pub head: &'a mut Head,
    /// What is known of them; the response and the noise become those that are measured.
    pub calibration: &'a mut Calibration,
    /// Whether the calibration can be trusted.
    pub calibrated: bool,
    /// Whether the models of the calibration are exact although none is stored: those of a
    /// simulated head.
    pub exact: bool,
    /// The stored calibration of this head.
    pub before: Option<CalibrationFile>,
    /// Where the calibration is stored.
    pub place: &'a Path,
    /// What the step [`GEOMETRY`] does; without it, it makes the models.
    pub poses: Option<PoseAction>,
    /// What the user chose for the calibration that is stored.
    pub choices: Choices,
    /// Gets the share done and what is done next.
    pub progress: &'a (dyn Fn(f64, &str) + Sync),
    /// The white frame of the pose that was taken.
    pub white: Option<Frame>,
    /// The calibration that was stored.
    pub stored: Option<CalibrationFile>,
    /// Remarks of the steps for the user.
    pub notes: Vec<String>,
}

/// What the user may choose for a calibration.
#[derive(Clone, Debug, Default)]
pub struct Choices {
    /// Models that are used instead of all others.
    pub imported: Option<HeadModels>,
    /// What heights go by; otherwise as in the calibration before, else by the models.
    pub heights_by: Option<HeightsBy>,
    /// Temperature of the head.
    pub temperature_c: Option<f64>,
    /// No flat plate lies in the plane z = 0.
    pub no_plate: bool,
    /// What to do if the calibration cannot be stored, if not only to free space.
    pub if_full: Option<&'static str>,
}

impl Step {
    /// The step of this name.
    pub fn of(name: &str) -> Option<&'static Self> {
        STEPS.iter().find(|step| step.name == name)
    }

    /// Carries it out and keeps how it ended in `kept`, which is not written here.
    pub fn run(&self, subject: &mut Subject<'_>, kept: &mut Commissioning) {
        let ended = self.carry_out(subject, kept);
        match ended.unwrap_or_else(|failure| Some(failure.into())) {
            Some(outcome) => drop(kept.steps.insert(self.name.into(), outcome)),
            None => drop(kept.steps.remove(self.name)),
        }
    }

    /// Carries it out; without an outcome the step is to be done again.
    ///
    /// # Errors
    /// Why it could not be carried out, with the exit code of a command.
    pub fn carry_out(
        &self,
        subject: &mut Subject<'_>,
        kept: &mut Commissioning,
    ) -> Result<Option<StepOutcome>> {
        let outcome = (self.measure)(subject, kept)?;
        Ok(outcome.map(|mut outcome| {
            outcome.said.extend_from_slice(&subject.notes);
            outcome
        }))
    }
}

/// The result of a step, as it is kept.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StepOutcome {
    /// When it ended, s since 1970 UTC; 0 if the clock was not synchronised.
    pub at_unix_s: u64,
    /// Whether everything is as it must be.
    pub passed: bool,
    /// What was found, a sentence each.
    pub said: Vec<String>,
    /// What to do about it; none if it passed.
    pub remedy: Option<String>,
    /// The numbers by name.
    pub figures: Value,
}

impl StepOutcome {
    /// A step that passed.
    pub fn passed(said: impl IntoIterator<Item = String>, figures: Value) -> Self {
        Self {
            at_unix_s: clock::utc_us().unwrap_or(0) / 1_000_000,
            passed: true,
            said: said.into_iter().collect(),
            remedy: None,
            figures,
        }
    }

    /// A step that failed.
    pub fn failed(said: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self {
            passed: false,
            remedy: Some(remedy.into()),
            ..Self::passed([said.into()], json!({}))
        }
    }

    /// The doctor's checks as one result: passed if all of them are, with the remedy of the first
    /// that failed.
    pub fn of(checks: &[Check]) -> Self {
        let said = checks
            .iter()
            .map(|check| format!("{}: {}", check.name, check.found));
        let figures: Map<String, Value> = checks
            .iter()
            .map(|check| (check.name.to_owned(), check.measured.clone()))
            .collect();
        let failed = checks
            .iter()
            .find(|check| check.verdict == CheckVerdict::Fail);
        Self {
            passed: checks
                .iter()
                .all(|check| check.verdict == CheckVerdict::Pass),
            remedy: failed.map(|check| check.remedy.clone()),
            ..Self::passed(said, Value::Object(figures))
        }
    }
}

impl From<Failure> for StepOutcome {
    fn from(
        Failure {
            problem, remedy, ..
        }: Failure,
    ) -> Self {
        let remedy = match remedy.is_empty() {
            true => problem.clone(),
            false => remedy,
        };
        Self::failed(problem, remedy)
    }
}

/// The doctor's checks of these names.
fn doctor(subject: &mut Subject<'_>, names: &[&str]) -> Result<Option<StepOutcome>> {
    Ok(Some(StepOutcome::of(&examine_for(
        subject.head,
        subject.calibration,
        subject.calibrated,
        &|name| names.contains(&name),
        subject.progress,
    ))))
}

/// The step `empty`: what is seen without a part is recorded.
fn empty(subject: &mut Subject<'_>) -> Result<Option<StepOutcome>> {
    if !subject.calibrated {
        let words = ("the head is not calibrated", "do the steps before this one");
        return Ok(Some(StepOutcome::failed(words.0, words.1)));
    }
    let failed = |words: String| Failure::because(Exit::Content, "record the empty station", words);
    let progress = |share: f64| (subject.progress)(share, "measuring the empty station");
    let empty = EmptyStation::measure(subject.head, subject.calibration, &progress);
    let empty = empty.map_err(|error| match error {
        MeasureError::Device(error) => error.into(),
        MeasureError::Impossible(words) => failed(words),
    })?;
    let stored = empty.store(subject.place, subject.calibration);
    stored.map_err(|error| failed(error.to_string()))?;
    let seen = 100.0 * empty.seen();
    let said = format!(
        "{seen:.1} % of the frame shows something without a part: parts that are taught from now on are told from it"
    );
    Ok(Some(StepOutcome::passed(
        [said],
        json!({ "seen_percent": seen }),
    )))
}

#[cfg(test)]
mod tests {
    use super::*;
    use hal::error::Error;

    #[test]
    fn a_failed_step_says_what_was_attempted_and_what_to_do() {
        let both = |failure: Failure| {
            let outcome = StepOutcome::from(failure);
            assert!(!outcome.passed);
            (outcome.said.concat(), outcome.remedy.unwrap())
        };
        let device = Error::unsupported("opening a: b", "free it: end c");
        let (said, remedy) = both(device.into());
        assert_eq!(said, "opening a: b is not supported");
        assert_eq!(remedy, "free it: end c");
        let (said, remedy) = both(Failure::because(Exit::Content, "try a", "not b: do c"));
        assert_eq!((&*said, &*remedy), ("try a", "not b: do c"));
    }
}
