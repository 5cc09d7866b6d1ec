//! What a guided study asks for: parts, appraisers and trials, and in which order.

use crate::error::shortened;
use serde::{Deserialize, Serialize};
use std::collections::HashSet;

/// The most trials of a study in all.
const MOST_TRIALS: usize = 1000;
/// The longest name, in characters.
const MOST_OF_NAME: usize = 48;

/// What a study asks for.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StudyDesign {
    /// Its name.
    pub name: String,
    /// The recipe whose cycles are taken.
    pub recipe: u16,
    /// The gauges that are studied.
    pub slots: Vec<u16>,
    /// Names of the parts, 2 or more.
    pub parts: Vec<String>,
    /// Names of the appraisers; one without a name where nobody places the parts.
    pub appraisers: Vec<String>,
    /// How often each part is measured by each appraiser, 2 or more.
    pub trials: u16,
}

/// One cell of a study's table, each counted from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StudyTrial {
    /// Which part.
    pub part: u16,
    /// Which appraiser.
    pub appraiser: u16,
    /// Which trial.
    pub trial: u16,
}

impl StudyDesign {
    /// Whether it can be measured and analysed.
    ///
    /// # Errors
    /// With what is wrong, and the remedy.
    pub fn check(&self) -> Result<(), String> {
        let wrong = |words: String| Err(words);
        let cells = self.parts.len() * self.appraisers.len() * usize::from(self.trials);
        if self.parts.len() < 2 || self.appraisers.is_empty() || self.trials < 2 {
            return wrong("a study needs two parts, one appraiser and two trials or more".into());
        }
        if cells > MOST_TRIALS {
            return wrong(format!(
                "{cells} trials are too many: ask for {MOST_TRIALS} or fewer"
            ));
        }
        if self.slots.is_empty() {
            return wrong("choose one gauge or more".into());
        }
        for names in [&self.parts, &self.appraisers] {
            let mut known = HashSet::new();
            if let Some(twice) = names.iter().find(|name| !known.insert(name.trim())) {
                return wrong(format!(
                    "\"{}\" is there twice: give each another name",
                    shortened(twice)
                ));
            }
        }
        let names = self
            .parts
            .iter()
            .chain(&self.appraisers)
            .chain([&self.name]);
        let unfit = |name: &&String| {
            name.chars().count() > MOST_OF_NAME
                || name.chars().any(char::is_control)
                || name.trim() != **name
        };
        if let Some(name) = names.clone().find(unfit) {
            return wrong(format!(
                "\"{}\": a name has up to {MOST_OF_NAME} characters and no space around them",
                shortened(name)
            ));
        }
        match self.parts.iter().chain([&self.name]).any(String::is_empty) {
            true => wrong("parts and study need names".into()),
            false => Ok(()),
        }
    }

    /// All trials in the order in which they are asked for.
    pub fn trials(&self) -> impl Iterator<Item = StudyTrial> {
        let [parts, appraisers] = [self.parts.len() as u16, self.appraisers.len() as u16];
        let of = move |trial| {
            (0..appraisers).flat_map(move |appraiser| {
                (0..parts).map(move |part| StudyTrial {
                    part,
                    appraiser,
                    trial,
                })
            })
        };
        (0..self.trials).flat_map(of)
    }

    /// A trial in words.
    pub fn words(&self, of: StudyTrial) -> String {
        let name =
            |names: &[String], at: u16| names.get(usize::from(at)).cloned().unwrap_or_default();
        let appraiser = name(&self.appraisers, of.appraiser);
        let by = if appraiser.is_empty() {
            String::new()
        } else {
            format!(", appraiser {appraiser}")
        };
        format!(
            "part {}{by}, trial {}",
            name(&self.parts, of.part),
            of.trial + 1
        )
    }
}
