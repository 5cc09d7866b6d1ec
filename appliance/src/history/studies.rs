//! Guided studies: what each one asks for, and the values that were taken, in files of their own, as the history drops
//! results.
//!
//! A study takes one cycle after the other: trial by trial, in each trial appraiser by appraiser, of each all parts, so
//! that a part is placed anew between its trials. A trial can be taken again. The cycles are known by history and SEQ, also
//! those that were taken again, and are left out of the figures of the process.

use super::design::{StudyDesign, StudyTrial};
use super::entry::{Entry, GaugeEntry};
use super::export::number;
use crate::station::gauge::decision;
use crate::storage::folder::{read_whole, remove, write_whole};
use crate::storage::quoted;
use crate::study::{Repeatability, StudyLimits, table};
use serde::{Deserialize, Serialize};
use std::collections::HashSet;
use std::fmt::Write as _;
use std::fs;
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

/// The folder of studies in the state folder.
const FOLDER: &str = "studies";
/// The format's name and version.
const FORMAT: &str = "fringed.study";
const VERSION: u32 = 1;
/// The most bytes of a file: 1000 trials of 64 gauges have some 20 MB.
const MOST_BYTES: u64 = 64 << 20;
/// The most studies.
const MOST_STUDIES: usize = 1000;

/// A cycle that was taken.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TakenTrial {
    /// For what.
    pub of: StudyTrial,
    /// RESULT_SEQ.
    pub seq: u32,
    /// The values of the study's gauges.
    pub gauges: Vec<GaugeEntry>,
}

/// A result that belongs to a study.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct StudyCycle {
    history: String,
    seq: u32,
}

/// A study as its file has it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct GuidedStudy {
    format: String,
    version: u32,
    /// Its number.
    pub number: u32,
    /// What it asks for.
    pub asked: StudyDesign,
    /// What was taken.
    pub taken: Vec<TakenTrial>,
    /// All cycles that it took, also those that were taken again.
    cycles: Vec<StudyCycle>,
}

/// Why a study cannot be read, written or begun.
#[derive(Debug, thiserror::Error)]
pub enum StudyError {
    /// There is none with the number.
    #[error("there is no study {0}; the list of studies has those that are there")]
    Missing(u32),
    /// What is asked for is wrong, or not all of it was taken.
    #[error("{0}")]
    Unfit(String),
    /// The file could not be read or written.
    #[error("study {number}: {source}: {remedy}")]
    File {
        /// Of this study.
        number: u32,
        /// What the system says.
        source: io::Error,
        /// What to do.
        remedy: &'static str,
    },
}

/// The studies of a state folder.
#[derive(Clone, Debug)]
pub struct Studies(PathBuf);

impl GuidedStudy {
    /// The trial that is asked for next; none if all were taken.
    pub fn next(&self) -> Option<StudyTrial> {
        let taken: HashSet<StudyTrial> = self.taken.iter().map(|taken| taken.of).collect();
        self.asked.trials().find(|trial| !taken.contains(trial))
    }

    /// Whether the table has this trial.
    pub fn has(&self, trial: StudyTrial) -> bool {
        self.asked.trials().any(|other| other == trial)
    }

    /// How many trials it asks for.
    pub fn all(&self) -> usize {
        self.asked.trials().count()
    }

    /// Takes a result for a trial, in place of what was taken before.
    ///
    /// # Errors
    /// Why it has not the values of all gauges, in words.
    pub fn take(&mut self, of: StudyTrial, history: &str, entry: &Entry) -> Result<(), String> {
        let why = |own: Option<&String>| {
            let words = own.or(entry.reason.as_ref()).map(String::as_str);
            words.unwrap_or("it could not be measured").to_owned()
        };
        let find = |slot: &u16| {
            let gauge = entry.gauges.iter().find(|gauge| gauge.slot == *slot);
            let gauge = gauge.ok_or_else(|| format!("slot {slot} has no value: {}", why(None)))?;
            // A part too near to a limit to be judged is INVALID, and its values are wanted.
            let is_valid = gauge.value.is_some() && gauge.decision & decision::VALID != 0;
            let refused = || format!("{}: {}", gauge.name, why(gauge.reason.as_ref()));
            is_valid.then(|| gauge.clone()).ok_or_else(refused)
        };
        let gauges = self
            .asked
            .slots
            .iter()
            .map(find)
            .collect::<Result<Vec<_>, _>>()?;
        self.taken.retain(|taken| taken.of != of);
        self.taken.push(TakenTrial {
            of,
            seq: entry.seq,
            gauges,
        });
        self.cycles.push(StudyCycle {
            history: history.into(),
            seq: entry.seq,
        });
        Ok(())
    }

    /// The values as the CSV that `fringed study grr` reads.
    pub fn csv(&self) -> String {
        let mut lines =
            "characteristic,part,appraiser,trial,value,sigma,U,low,high,seq\r\n".to_owned();
        for trial in self.asked.trials() {
            let Some(taken) = self.taken.iter().find(|taken| taken.of == trial) else {
                continue;
            };
            let name = |names: &[String], at: u16| {
                quoted(names.get(usize::from(at)).map_or("", String::as_str)).into_owned()
            };
            for gauge in &taken.gauges {
                let unit = if gauge.unit.is_empty() {
                    String::new()
                } else {
                    format!(" [{}]", gauge.unit)
                };
                let numbers = [
                    gauge.value,
                    gauge.sigma,
                    gauge.uncertainty,
                    gauge.low,
                    gauge.high,
                ]
                .map(number);
                let _ = write!(
                    lines,
                    "{},{},{},{},{},{}\r\n",
                    quoted(&format!("{}{unit}", gauge.name)),
                    name(&self.asked.parts, trial.part),
                    name(&self.asked.appraisers, trial.appraiser),
                    trial.trial + 1,
                    numbers.join(","),
                    taken.seq
                );
            }
        }
        lines
    }

    /// The Gage R&R of each gauge, by way of [`Self::csv`].
    ///
    /// # Errors
    /// Not all trials were taken, or a gauge's limits changed meanwhile.
    pub fn report(&self) -> Result<Vec<Repeatability>, StudyError> {
        if let Some(next) = self.next() {
            let (taken, all) = (self.taken.len(), self.all());
            return Err(StudyError::Unfit(format!(
                "{taken} of {all} trials were taken: measure {}",
                self.asked.words(next)
            )));
        }
        let measured = table::read(self.csv().as_bytes(), "the values of the study");
        let all = measured.and_then(|all| {
            all.iter()
                .map(|one| Repeatability::of(one, &StudyLimits::USUAL))
                .collect()
        });
        all.map_err(|failure| StudyError::Unfit(failure.to_string()))
    }
}

impl Studies {
    /// Those of a state folder; nothing is opened yet.
    pub fn of(state: &Path) -> Self {
        Self(state.join(FOLDER))
    }

    fn path(&self, number: u32) -> PathBuf {
        self.0.join(format!("{number}.json"))
    }

    /// The numbers of all studies, ascending.
    pub fn numbers(&self) -> Vec<u32> {
        let names = fs::read_dir(&self.0).into_iter().flatten().flatten();
        let numbers = names.filter_map(|entry| {
            entry
                .file_name()
                .to_str()?
                .strip_suffix(".json")?
                .parse()
                .ok()
        });
        let mut numbers: Vec<u32> = numbers.collect();
        numbers.sort_unstable();
        numbers
    }

    /// One study.
    ///
    /// # Errors
    /// There is none, or its file is damaged or of another version.
    pub fn read(&self, number: u32) -> Result<GuidedStudy, StudyError> {
        let failed = |source, remedy| StudyError::File {
            number,
            source,
            remedy,
        };
        let bytes =
            read_whole(&self.path(number), MOST_BYTES).map_err(|error| match error.kind() {
                ErrorKind::NotFound => StudyError::Missing(number),
                _ => failed(error, "delete it, or bring it back from a backup"),
            })?;
        let read: GuidedStudy = serde_json::from_slice(&bytes).map_err(|error| {
            failed(
                error.into(),
                "it is damaged: delete it, or bring it back from a backup",
            )
        })?;
        let known = read.format == FORMAT
            && read.version == VERSION
            && read.number == number
            && read.asked.check().is_ok();
        known.then_some(read).ok_or_else(|| {
            failed(
                io::Error::other("it is not a study of this version"),
                "delete it",
            )
        })
    }

    /// Begins a study with the next number.
    ///
    /// # Errors
    /// What it asks for is wrong, there are too many, or it cannot be written.
    pub fn begin(&self, asked: StudyDesign) -> Result<GuidedStudy, StudyError> {
        asked.check().map_err(StudyError::Unfit)?;
        let numbers = self.numbers();
        if numbers.len() >= MOST_STUDIES {
            return Err(StudyError::Unfit(format!(
                "there are {MOST_STUDIES} studies: delete one"
            )));
        }
        let number = numbers.last().map_or(1, |last| last.saturating_add(1));
        let (format, taken, cycles) = (FORMAT.into(), Vec::new(), Vec::new());
        let begun = GuidedStudy {
            format,
            version: VERSION,
            number,
            asked,
            taken,
            cycles,
        };
        self.write(&begun)?;
        Ok(begun)
    }

    /// Writes a study, whole or not at all.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn write(&self, study: &GuidedStudy) -> Result<(), StudyError> {
        let written = serde_json::to_vec(study)
            .map_err(io::Error::from)
            .and_then(|bytes| {
                fs::create_dir_all(&self.0)?;
                write_whole(&self.path(study.number), &bytes)
            });
        written.map_err(|source| StudyError::File {
            number: study.number,
            source,
            remedy: "free space",
        })
    }

    /// Deletes a study; its cycles count for the process again.
    ///
    /// # Errors
    /// There is none, or it cannot be removed.
    pub fn delete(&self, number: u32) -> Result<(), StudyError> {
        match remove(&self.path(number)) {
            Ok(true) => Ok(()),
            Ok(false) => Err(StudyError::Missing(number)),
            Err(source) => Err(StudyError::File {
                number,
                source,
                remedy: "try again",
            }),
        }
    }

    /// The cycles of all studies that are in this history, by SEQ.
    pub fn seqs(&self, history: &str) -> HashSet<u32> {
        let studies = self
            .numbers()
            .into_iter()
            .filter_map(|number| self.read(number).ok());
        let cycles = studies.flat_map(|study| study.cycles);
        cycles
            .filter(|cycle| cycle.history == history)
            .map(|cycle| cycle.seq)
            .collect()
    }
}
