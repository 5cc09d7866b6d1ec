//! The doctor: checks a head item by item, and says what is wrong and what to do about it.
//!
//! A check runs only if the checks that it depends on have passed, so a fault is reported once and its consequences are not. Pictures are
//! taken long after each flip, so only the check of the flip-to-light delay depends on that delay.

pub mod computer;
pub mod controller;
mod delivery;
mod geometry;
mod heights;
mod light;
mod time;

use crate::head::calibration::Calibration;
use crate::head::examine::{Lit, SETTLE, first_light};
use hal::error::Error;
use hal::head::Head;
use serde::Serialize;
use serde_json::{Value, json};

/// The verdict of a check.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// What was checked is as it must be.
    Pass,
    /// It is not.
    Fail,
    /// A check that this one depends on has not passed.
    Skipped,
}

impl Verdict {
    /// The word for it.
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
    pub verdict: Verdict,
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
                Some(_) => Verdict::Fail,
                None => Verdict::Pass,
            },
            found: found.into(),
            remedy: remedy.unwrap_or_default().to_owned(),
            measured,
        }
    }
}

/// A check with its name.
fn named(name: &'static str, check: Check) -> Check {
    Check { name, ..check }
}

/// The checks in their order, each with the checks that must have passed before it.
const CHECKS: [(&str, &[&str]); 15] = [
    ("devices", &[]),
    ("format", &["devices"]),
    ("mode", &["devices"]),
    ("start", &["devices"]),
    ("cadence", &["devices"]),
    ("trigger", &["devices"]),
    ("delivery", &["devices", "trigger"]),
    ("light", &["devices", "trigger"]),
    ("exposure", &["devices", "trigger", "light"]),
    ("delay", &["devices", "trigger", "light", "exposure"]),
    ("contrast", &["devices", "trigger", "light", "exposure"]),
    ("content", &["devices", "trigger", "light", "exposure"]),
    (
        "response",
        &["devices", "trigger", "light", "exposure", "content"],
    ),
    (
        "geometry",
        &[
            "devices", "format", "mode", "cadence", "trigger", "light", "exposure", "delay",
        ],
    ),
    ("heights", &[]),
];

/// Checks a head in front of any part, best a flat bright one. `progress` gets the share done and the name of the next check. For a head
/// that is not `calibrated`, what the camera's time stamps mark is measured first, and the head is set accordingly.
pub fn examine(
    head: &mut Head,
    calibration: &Calibration,
    calibrated: bool,
    progress: &dyn Fn(f64, &str),
) -> Vec<Check> {
    examine_for(head, calibration, calibrated, &|_| true, progress)
}

/// As [`examine`], but makes only the checks whose names are `wanted`; of those that a check needs, only wanted ones count.
pub fn examine_for(
    head: &mut Head,
    calibration: &Calibration,
    calibrated: bool,
    wanted: &dyn Fn(&str) -> bool,
    progress: &dyn Fn(f64, &str),
) -> Vec<Check> {
    let all: Vec<_> = CHECKS
        .into_iter()
        .filter(|(name, _)| wanted(name))
        .collect();
    let mut checks: Vec<Check> = Vec::with_capacity(all.len());
    let mut lit: Option<Result<Lit, Error>> = None;
    let dark = head.starts_dark();
    let first = dark.then(|| first_light(head).unwrap_or_default());
    for (at, (name, needs)) in all.iter().copied().enumerate() {
        progress(at as f64 / all.len() as f64, name);
        let missing = needs.iter().find(|need| {
            checks
                .iter()
                .any(|check| check.name == **need && check.verdict != Verdict::Pass)
        });
        if let Some(missing) = missing {
            let words = format!("cannot be judged before the check {missing} passes");
            checks.push(Check {
                name,
                verdict: Verdict::Skipped,
                ..Check::new(words, None, json!({}))
            });
            continue;
        }
        let checked = match name {
            "devices" => time::devices(head),
            "format" => Ok(time::format(head)),
            "mode" => Ok(time::mode(head)),
            "start" => time::start(head),
            "cadence" => time::cadence(head),
            "trigger" => time::trigger(head, calibrated),
            "delivery" => delivery::delivery(head),
            "geometry" => geometry::geometry(head, calibration, calibrated),
            "heights" => Ok(heights::heights(calibration)),
            _ => {
                let lit = lit.get_or_insert_with(|| Lit::take(head, SETTLE));
                match (name, lit) {
                    (_, Err(error)) => Err(error.clone()),
                    ("light", Ok(lit)) => Ok(light::light(lit, first)),
                    ("exposure", Ok(lit)) => Ok(light::exposure(lit)),
                    ("delay", Ok(lit)) => time::delay(head, lit),
                    ("contrast", Ok(lit)) => light::contrast(head, calibration, lit),
                    ("content", Ok(lit)) => light::content(head, lit),
                    (_, Ok(lit)) => light::response(head, calibration, lit),
                }
            }
        };
        let checked = checked.unwrap_or_else(|error| {
            let text = error.to_string();
            let (found, remedy) = text.rsplit_once(": ").unwrap_or((&text, ""));
            Check::new(found, Some(remedy), json!({}))
        });
        checks.push(named(name, checked));
    }
    progress(1.0, "examined");
    checks
}
