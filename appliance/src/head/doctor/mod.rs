//! Examines a head step by step: what is well, what is not, and what to do about it.
//!
//! A step is judged only where what it needs is well, so a fault is named once and its consequences are not. Pictures are taken
//! long after each flip, so nothing but the step about the flip-to-light delay depends on that delay.

mod light;
mod time;

use crate::head::calibration::Calibration;
use crate::head::examine::{Lit, SETTLE};
use hal::error::Error;
use hal::head::DynHead;
use serde_json::{Value, json};

/// How a step went.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// It is well.
    Pass,
    /// It is not.
    Fail,
    /// It cannot be judged before another step passes.
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

/// A step with its verdict.
#[derive(Clone, Debug)]
pub struct Step {
    /// Its name.
    pub name: &'static str,
    /// How it went.
    pub verdict: Verdict,
    /// What was found, in a sentence with its numbers.
    pub found: String,
    /// What to do about it; empty unless it failed.
    pub remedy: String,
    /// The numbers by name.
    pub measured: Value,
}

/// What a step found, before it has a name.
struct Finding {
    found: String,
    remedy: Option<String>,
    measured: Value,
}

impl Finding {
    fn pass(found: impl Into<String>, measured: Value) -> Self {
        Self {
            found: found.into(),
            remedy: None,
            measured,
        }
    }

    fn fail(found: impl Into<String>, remedy: impl Into<String>, measured: Value) -> Self {
        Self {
            found: found.into(),
            remedy: Some(remedy.into()),
            measured,
        }
    }
}

/// The steps in their order, each with the steps that must have passed before it can be judged.
const STEPS: [(&str, &[&str]); 10] = [
    ("devices", &[]),
    ("format", &["devices"]),
    ("mode", &["devices"]),
    ("cadence", &["devices"]),
    ("trigger", &["devices"]),
    ("light", &["devices", "trigger"]),
    ("exposure", &["devices", "trigger", "light"]),
    ("delay", &["devices", "trigger", "light", "exposure"]),
    ("contrast", &["devices", "trigger", "light", "exposure"]),
    ("response", &["devices", "trigger", "light", "exposure"]),
];

/// Examines a head in front of any part, best a flat bright one. `progress` is told the share done. What the stamps of a head that is not
/// `calibrated` mark is measured first, and told to the head.
pub fn examine(
    head: &mut DynHead,
    calibration: &Calibration,
    calibrated: bool,
    progress: &dyn Fn(f64, &str),
) -> Vec<Step> {
    let mut steps: Vec<Step> = Vec::with_capacity(STEPS.len());
    let mut lit: Option<Result<Lit, Error>> = None;
    for (at, (name, needs)) in STEPS.into_iter().enumerate() {
        progress(at as f64 / STEPS.len() as f64, name);
        let missing = needs.iter().find(|need| {
            steps
                .iter()
                .any(|step| step.name == **need && step.verdict != Verdict::Pass)
        });
        if let Some(missing) = missing {
            steps.push(Step {
                name,
                verdict: Verdict::Skipped,
                found: format!("cannot be judged before the step {missing} passes"),
                remedy: String::new(),
                measured: json!({}),
            });
            continue;
        }
        let finding = match name {
            "devices" => time::devices(head),
            "format" => Ok(time::format(head)),
            "mode" => Ok(time::mode(head)),
            "cadence" => time::cadence(head),
            "trigger" => time::trigger(head, calibrated),
            _ => {
                let lit = lit.get_or_insert_with(|| Lit::take(head, SETTLE));
                match (name, lit) {
                    (_, Err(error)) => Err(error.clone()),
                    ("light", Ok(lit)) => Ok(light::light(lit)),
                    ("exposure", Ok(lit)) => Ok(light::exposure(lit)),
                    ("delay", Ok(lit)) => time::delay(head, lit),
                    ("contrast", Ok(lit)) => light::contrast(head, calibration, lit),
                    (_, Ok(lit)) => light::response(head, calibration, lit),
                }
            }
        };
        let finding = finding.unwrap_or_else(|error| {
            let text = error.to_string();
            let (found, remedy) = text.rsplit_once(": ").unwrap_or((&text, ""));
            Finding::fail(found, remedy, json!({}))
        });
        steps.push(Step {
            name,
            verdict: match finding.remedy {
                Some(_) => Verdict::Fail,
                None => Verdict::Pass,
            },
            found: finding.found,
            remedy: finding.remedy.unwrap_or_default(),
            measured: finding.measured,
        });
    }
    progress(1.0, "examined");
    steps
}
