//! Checks the chain of the record: each line has the hash of the line before, numbers ascend by one,
//! and the file `result-seq` says where the record ends. So a line that was changed, removed or put
//! elsewhere, an end that was cut off and a beginning that was dropped for room are told apart.
//!
//! Whoever may write the state folder can write the whole chain anew: it finds accidents and
//! alterations of single lines, and is no signature.

use super::record::{ChangeRecord, hash_of, is_torn, number_of};
use serde::{Deserialize, Serialize};
use std::io;

/// The most problems that are named.
const MOST_PROBLEMS: usize = 20;

/// What the check of a record found.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct ChainReport {
    /// Lines with a number.
    pub lines: u32,
    /// Lines before them, of a program that wrote no numbers.
    pub unnumbered: u32,
    /// The number of the first line that is kept; those before were dropped for room.
    pub first: Option<u32>,
    /// The number of the last.
    pub last: Option<u32>,
    /// What is wrong, the newest first; empty if nothing is.
    pub problems: Vec<String>,
}

impl ChainReport {
    /// What was checked, in words.
    pub fn words(&self) -> String {
        let dropped = match self.first {
            Some(first) if first > 1 => {
                format!(", those before line {first} were dropped for room")
            }
            _ => String::new(),
        };
        let unnumbered = match self.unnumbered {
            0 => String::new(),
            lines => format!(", {lines} of an older program are not numbered"),
        };
        let lines = self.lines;
        match self.problems.len() {
            0 => format!("{lines} lines hold together{dropped}{unnumbered}"),
            wrong => format!("{lines} lines, {wrong} problems{dropped}{unnumbered}"),
        }
    }
}

#[derive(Deserialize)]
struct Link {
    number: u32,
    previous: String,
    #[serde(default)]
    first: Option<u32>,
}

impl ChangeRecord {
    /// Checks the chain.
    ///
    /// # Errors
    /// Whatever the file system answers.
    pub fn check(&self) -> io::Result<ChainReport> {
        let _alone = self.lock()?;
        let mut report = ChainReport::default();
        let mut problems = Vec::new();
        let said = self.said_end();
        let (mut after, mut kept_from): (Option<Link>, Option<u32>) = (None, None);
        for line in self.backward()? {
            let line = line?;
            // If it was answered, result-seq says that it is missing.
            if after.is_none() && is_torn(&line) {
                continue;
            }
            let Some(number) = number_of(&line) else {
                // Of an older program, or damaged: then the line behind has another hash.
                if report.unnumbered == 0
                    && let Some(link) = &after
                    && link.previous != hash_of(&line)
                {
                    let words = format!("the line before {} was changed", link.number);
                    problems.push(words);
                }
                report.unnumbered += 1;
                continue;
            };
            let Ok(link) = serde_json::from_slice::<Link>(&line) else {
                problems.push(format!("line {number} has no hash of the line before"));
                continue;
            };
            if let Some(said) = &said
                && said.number == number
                && said.hash != hash_of(&line)
            {
                problems.push(format!(
                    "line {number}, the last as result-seq says, was changed"
                ));
            }
            match &after {
                None => {
                    report.last = Some(number);
                    problems.extend(end_problem(number, said.as_ref().map(|end| end.number)));
                }
                Some(next) => problems.extend(link_problem(number, &hash_of(&line), next)),
            }
            if report.unnumbered > 0 && after.is_some() {
                problems.push(format!("unnumbered lines stand behind line {number}"));
                report.unnumbered = 0;
            }
            report.lines += 1;
            // The newest file's word counts: it was written when lines were dropped last.
            kept_from = kept_from.or(link.first);
            report.first = Some(number);
            after = Some(link);
        }
        match (report.first, kept_from) {
            (Some(first), kept) if first > kept.unwrap_or(1) => problems.push(format!(
                "{} at the beginning",
                missing(kept.unwrap_or(1), first - 1)
            )),
            (None, _) if said.as_ref().is_some_and(|end| end.number > 0) => {
                problems.push("all lines are missing".into());
            }
            _ => {}
        }
        problems.truncate(MOST_PROBLEMS);
        report.problems = problems;
        Ok(report)
    }
}

fn end_problem(last: u32, said: Option<u32>) -> Option<String> {
    match said {
        // A loss of power in the first change of all leaves its line alone.
        None if last > 1 => Some("result-seq does not say where the record ends".into()),
        Some(said) if said > last => Some(format!("{} at the end", missing(last + 1, said))),
        _ => None,
    }
}

/// What is wrong between a line and the next one.
fn link_problem(number: u32, hash: &str, next: &Link) -> Option<String> {
    let behind = next.number;
    if number.checked_add(1) == Some(behind) {
        return (next.previous != hash).then(|| format!("line {number} was changed"));
    }
    Some(match behind > number {
        true => missing(number + 1, behind - 1),
        false => format!("line {behind} stands behind line {number}"),
    })
}

fn missing(first: u32, last: u32) -> String {
    match first == last {
        true => format!("line {first} is missing"),
        false => format!("lines {first} to {last} are missing"),
    }
}
