//! How a step ended: what was found, and what to do if something is wrong.

use crate::error::Failure;
use crate::head::doctor::{Check, Verdict};
use crate::system::clock;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};

/// The result of a step, as it is kept.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Outcome {
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

impl Outcome {
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
        let failed = checks.iter().find(|check| check.verdict == Verdict::Fail);
        Self {
            passed: checks.iter().all(|check| check.verdict == Verdict::Pass),
            remedy: failed.map(|check| check.remedy.clone()),
            ..Self::passed(said, Value::Object(figures))
        }
    }
}

impl From<Failure> for Outcome {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Exit;
    use hal::error::Error;

    #[test]
    fn a_failed_step_says_what_was_attempted_and_what_to_do() {
        let both = |failure: Failure| {
            let outcome = Outcome::from(failure);
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
