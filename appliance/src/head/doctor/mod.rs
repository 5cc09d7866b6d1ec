//! The doctor: checks a head item by item, and says what is wrong and what to do about it.
//!
//! A check runs only if the checks that it depends on have passed, so a fault is reported once and
//! its consequences are not. Pictures are taken long after each flip, so only the check of the
//! flip-to-light delay depends on that delay.

mod calibration;
pub mod computer;
pub mod light;
mod time;

use crate::head::calibration::Calibration;
use crate::head::examine::{Lit, SETTLE, first_light};
use hal::error::Error;
use hal::head::Head;
use serde::Serialize;
use serde_json::{Value, json};
use std::time::Duration;

/// The verdict of a check.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum CheckVerdict {
    /// What was checked is as it must be.
    Pass,
    /// What was checked is not as it must be.
    Fail,
    /// A check that this one depends on has not passed.
    Skipped,
}

impl CheckVerdict {
    /// The word for the verdict.
    pub fn word(self) -> &'static str {
        match self {
            Self::Pass => "pass",
            Self::Fail => "fail",
            Self::Skipped => "skipped",
        }
    }
}

/// One check with its verdict. The names of its JSON are a format: docs/doctor.md.
#[derive(Clone, Debug, Serialize)]
pub struct Check {
    /// Its name.
    #[serde(rename = "step")]
    pub name: &'static str,
    /// Its verdict.
    pub verdict: CheckVerdict,
    /// What was found, in a sentence with its numbers.
    pub found: String,
    /// What to do about it; empty unless it failed.
    pub remedy: String,
    /// The numbers by name.
    pub measured: Value,
}

impl Check {
    /// A check that passes if it needs no remedy; [`examine`] gives it its name.
    fn new(found: impl Into<String>, remedy: Option<&str>, measured: Value) -> Self {
        Self {
            name: "",
            verdict: match remedy {
                Some(_) => CheckVerdict::Fail,
                None => CheckVerdict::Pass,
            },
            found: found.into(),
            remedy: remedy.unwrap_or_default().to_owned(),
            measured,
        }
    }

    /// A check that was not made, and why.
    fn skipped(why: impl Into<String>) -> Self {
        Self {
            verdict: CheckVerdict::Skipped,
            ..Self::new(why, None, json!({}))
        }
    }
}

impl From<Error> for Check {
    fn from(error: Error) -> Self {
        Self::new(error.problem(), Some(error.remedy()), json!({}))
    }
}

/// A check with its name.
fn named(name: &'static str, check: Check) -> Check {
    Check { name, ..check }
}

/// What the checks of a head share.
struct Examination<'a> {
    head: &'a mut Head,
    calibration: &'a Calibration,
    calibrated: bool,
    /// When light first came after the head was opened, where that may take seconds.
    first_light: Option<Option<Duration>>,
    /// Black and white, since a check needed them.
    lit: Option<Result<Lit, Error>>,
}

impl Examination<'_> {
    /// The head, and its pictures of black and white.
    fn lit(&mut self) -> Result<(&mut Head, &Lit), Error> {
        let head = &mut *self.head;
        let lit = self.lit.get_or_insert_with(|| Lit::take(head, SETTLE));
        Ok((head, lit.as_ref().map_err(Error::clone)?))
    }
}

/// How a check ended, or the error of the device that ended it.
type CheckResult = Result<Check, Error>;

/// A row of [`CHECKS`]: its name, the checks that must have passed before it, and how it measures
/// and judges.
type Row = (
    &'static str,
    &'static [&'static str],
    fn(&mut Examination<'_>) -> CheckResult,
);

/// What the checks of light need.
const LIT: &[&str] = &["devices", "trigger", "light", "exposure"];

/// The checks in their order.
const CHECKS: [Row; 16] = [
    ("devices", &[], time::devices),
    ("format", &["devices"], time::format),
    ("mode", &["devices"], time::mode),
    ("start", &["devices"], time::start),
    ("cadence", &["devices"], time::cadence),
    ("trigger", &["devices"], time::trigger),
    ("delivery", &["devices", "trigger"], time::delivery),
    ("light", &["devices", "trigger"], light::light),
    (
        "exposure",
        &["devices", "trigger", "light"],
        light::exposure,
    ),
    ("flicker", LIT, light::flicker),
    ("delay", LIT, time::delay),
    ("contrast", LIT, light::contrast),
    ("content", LIT, light::content),
    (
        "response",
        &[
            "devices", "trigger", "light", "exposure", "content", "flicker",
        ],
        light::response,
    ),
    (
        "geometry",
        &[
            "devices", "format", "mode", "cadence", "trigger", "light", "exposure", "delay",
        ],
        calibration::geometry,
    ),
    ("heights", &[], calibration::heights),
];

/// Checks a head in front of any part, best a flat bright one. `progress` gets the share done and
/// the name of the next check. For a head that is not `calibrated`, what the camera's time stamps
/// mark is measured first, and the head is set accordingly.
pub fn examine(
    head: &mut Head,
    calibration: &Calibration,
    calibrated: bool,
    progress: &dyn Fn(f64, &str),
) -> Vec<Check> {
    examine_for(head, calibration, calibrated, &|_| true, progress)
}

/// As [`examine`], but makes only the checks whose names are `wanted`; of those that a check needs,
/// only wanted ones count.
pub fn examine_for(
    head: &mut Head,
    calibration: &Calibration,
    calibrated: bool,
    wanted: &dyn Fn(&str) -> bool,
    progress: &dyn Fn(f64, &str),
) -> Vec<Check> {
    let dark = head.starts_dark();
    let mut examination = Examination {
        first_light: dark.then(|| first_light(head).unwrap_or_default()),
        head,
        calibration,
        calibrated,
        lit: None,
    };
    let rows: Vec<Row> = CHECKS.into_iter().filter(|row| wanted(row.0)).collect();
    let mut checks: Vec<Check> = Vec::with_capacity(rows.len());
    for (at, &(name, needs, check)) in rows.iter().enumerate() {
        progress(at as f64 / rows.len() as f64, name);
        let unmet = checks
            .iter()
            .filter(|check| check.verdict != CheckVerdict::Pass);
        let missing = needs
            .iter()
            .find(|need| unmet.clone().any(|check| check.name == **need));
        let checked = match missing {
            Some(missing) => Check::skipped(format!(
                "cannot be judged before the check {missing} passes"
            )),
            None => check(&mut examination).unwrap_or_else(Check::from),
        };
        checks.push(named(name, checked));
    }
    progress(1.0, "examined");
    checks
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_check_needs_only_checks_that_stand_before_it() {
        for (at, (name, needs, _)) in CHECKS.iter().enumerate() {
            let before: Vec<&str> = CHECKS[..at].iter().map(|row| row.0).collect();
            let missing = needs.iter().find(|need| !before.contains(need));
            assert_eq!(missing, None, "{name}");
            assert!(!before.contains(name), "{name} twice");
        }
    }

    #[test]
    fn an_error_of_a_device_is_found_whole_and_keeps_its_whole_remedy() {
        let check = Check::from(Error::unsupported("opening a: b", "free it: end c"));
        assert_eq!(check.found, "opening a: b is not supported");
        assert_eq!(check.remedy, "free it: end c");
        assert_eq!(check.verdict, CheckVerdict::Fail);
    }
}
