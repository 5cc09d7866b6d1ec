//! `fringed changes`: the record of changes as a table, JSON or CSV, and the check of its chain. Works
//! while the station runs.

use super::numbers::number;
use super::options::{Files, Json};
use crate::access::record::{CSV_COLUMNS, RecordFilter, author, csv_line};
use crate::error::{Exit, Result};
use crate::history::export::utc_us;
use crate::station::control::MAX_RECIPE;
use crate::system::clock::utc;
use serde_json::{Value, json};

/// Show or check the record of changes, newest first.
#[derive(Debug, clap::Args)]
pub struct Changes {
    /// Check that no line was changed, removed or put elsewhere.
    #[arg(long, conflicts_with_all = ["csv", "user", "recipe", "since", "until", "limit"])]
    check: bool,
    /// As CSV.
    #[arg(long, conflicts_with = "json")]
    csv: bool,
    /// Only of this user.
    #[arg(long, value_name = "NAME")]
    user: Option<String>,
    /// Only about this recipe.
    #[arg(long, value_name = "NUMBER", value_parser = number(1, MAX_RECIPE))]
    recipe: Option<u16>,
    /// Only at or after this time (UTC).
    #[arg(long, value_parser = utc_us, value_name = "TIME")]
    since: Option<u64>,
    /// Only before this time (UTC).
    #[arg(long, value_parser = utc_us, value_name = "TIME")]
    until: Option<u64>,
    /// At most this many, the newest; as CSV all, unless given.
    #[arg(long, value_name = "N", value_parser = number(1, MOST))]
    limit: Option<u32>,
    #[command(flatten)]
    files: Files,
    #[command(flatten)]
    json: Json,
}

/// The most lines, and those of a table for a screen.
const MOST: u32 = 10_000_000;
const SCREEN: u32 = 20;

impl Changes {
    /// Prints the lines, or what is wrong with them.
    ///
    /// # Errors
    /// If the record cannot be read (66), or its chain is broken (65).
    pub fn run(&self) -> Result<()> {
        let record = self.files.record()?;
        let failed = Exit::Missing.because("read the record of changes");
        if self.check {
            let report = record.check().map_err(failed)?;
            match self.json.json {
                true => say!("{:#}", json!(report)),
                false => {
                    for problem in &report.problems {
                        say!("{problem}");
                    }
                    say!("{}", report.words());
                }
            }
            return match report.problems.is_empty() {
                true => Ok(()),
                false => Exit::Content.fail("the record of changes is not as it was written"),
            };
        }
        let usual = if self.csv { MOST } else { SCREEN };
        let filter = RecordFilter {
            user: self.user.clone(),
            recipe: self.recipe,
            since_us: self.since,
            until_us: self.until,
            before: None,
            limit: Some(self.limit.unwrap_or(usual) as usize),
        };
        if self.csv {
            say!("{}", CSV_COLUMNS.trim_end());
            let print = |line: Value| {
                say!("{}", csv_line(&line).trim_end());
                true
            };
            return record.each(&filter, print).map_err(failed);
        }
        let lines = record.list(&filter).map_err(failed)?;
        if self.json.json {
            say!("{:#}", json!({ "changes": lines }));
            return Ok(());
        }
        say!("number  time (UTC)           who                       what");
        for line in &lines {
            say!("{}", row(line));
        }
        Ok(())
    }
}

fn row(line: &Value) -> String {
    let word = |key: &str| line[key].as_str().unwrap_or_default();
    let number = line["number"]
        .as_u64()
        .map_or_else(String::new, |n| n.to_string());
    let at = line["utc_us"]
        .as_u64()
        .map_or_else(String::new, |us| format!("{:.19}", utc(us)));
    let changed = line["changed"]
        .as_str()
        .map_or_else(String::new, |words| format!(": {words}"));
    format!(
        "{number:>6}  {at:<19}  {:<24}  {} ({}): {}{changed}",
        author(line),
        word("action"),
        word("subject"),
        word("outcome"),
    )
}
