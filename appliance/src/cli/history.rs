//! `fringed history`: stored results as a table, JSON or CSV. Works while the station runs.

use super::numbers::number;
use super::options::{Files, Json};
use crate::config::MAX_RESULTS;
use crate::error::{Exit, Failure, Result};
use crate::history::{Entry, Filter, HistoryError, Reader, export};
use crate::station::Verdict;
use crate::station::control::MAX_RECIPE;
use crate::station::gauge::decision;
use crate::system::clock;
use crate::system::journal::{self, Severity};
use std::io::{self, BufWriter, StdoutLock, Write};

/// Show or export stored results, newest first.
#[derive(Debug, clap::Args)]
pub struct HistoryOptions {
    /// As CSV: a line per result, all gauges in columns.
    #[arg(long, conflicts_with = "json")]
    csv: bool,
    /// Only of this recipe.
    #[arg(long, value_name = "NUMBER", value_parser = number(1, MAX_RECIPE))]
    recipe: Option<u16>,
    /// Only with this verdict.
    #[arg(long, value_parser = verdict, value_name = "pass|fail|invalid")]
    verdict: Option<Verdict>,
    /// Only of this PART_ID.
    #[arg(long, value_name = "PART_ID", value_parser = number(0, u32::MAX))]
    part: Option<u32>,
    /// Only triggered at or after this time (UTC).
    #[arg(long, value_parser = export::utc_us, value_name = "TIME")]
    since: Option<u64>,
    /// Only triggered before this time (UTC).
    #[arg(long, value_parser = export::utc_us, value_name = "TIME")]
    until: Option<u64>,
    /// At most this many, the newest; as CSV all, unless given.
    #[arg(long, value_name = "N", value_parser = number(1, MAX_RESULTS))]
    limit: Option<u32>,
    #[command(flatten)]
    files: Files,
    #[command(flatten)]
    json: Json,
}

/// Rows of a table for a screen.
const SCREEN: u32 = 20;

fn verdict(word: &str) -> Result<Verdict, String> {
    Verdict::of_word(&word.to_ascii_uppercase()).ok_or_else(|| "write pass, fail or invalid".into())
}

impl HistoryOptions {
    /// Prints the results.
    ///
    /// # Errors
    /// If there is no history (66), or it is damaged or of another version (65).
    pub fn run(&self) -> Result<()> {
        let state = self.files.state_folder()?;
        let reader = Reader::of(&state);
        let usual = if self.csv { MAX_RESULTS } else { SCREEN };
        let filter = Filter {
            recipe: self.recipe,
            verdict: self.verdict,
            part_id: self.part,
            since_us: self.since,
            until_us: self.until,
            before_seq: None,
            limit: self.limit.unwrap_or(usual) as usize,
            ..Filter::default()
        };
        let undated = warn_of_undated(&reader, &filter)?;
        if self.csv {
            return self.csv(&reader, &filter);
        }
        let results = reader.results(&filter)?;
        if self.json.json {
            say!(
                "{:#}",
                serde_json::json!({ "results": results, "undated": undated })
            );
            return Ok(());
        }
        say!(
            "       seq  time (UTC)            recipe        part  verdict  coverage    result  remarks"
        );
        for entry in &results {
            say!("{}", row(entry));
        }
        if results.iter().any(|entry| entry.browser_utc_us.is_some()) {
            say!(
                "≈ the time is from the browser of a signed-in user: the clock was not synchronised"
            );
        }
        let counts = reader.counts(&filter)?;
        say!(
            "{} PASS, {} FAIL, {} INVALID in all",
            counts.pass,
            counts.fail,
            counts.invalid
        );
        Ok(())
    }

    fn csv(&self, reader: &Reader, filter: &Filter) -> Result<()> {
        let mut pipe = Pipe {
            out: io::stdout().lock(),
            failure: None,
        };
        let mut out = BufWriter::new(&mut pipe);
        let read = reader.csv(filter, &mut out);
        // The pipe notes its failure.
        let _ = out.flush();
        drop(out);
        match pipe.failure {
            // The reader of a pipe that is closed wants no more.
            Some((io::ErrorKind::BrokenPipe, _)) => Ok(()),
            Some((_, error)) => {
                let failed = Exit::CannotCreate.advising("write the history as CSV", "free space");
                Err(failed(error))
            }
            None => read.map_err(Failure::from),
        }
    }
}

/// Says how many results a filter by time leaves out because it is not known when they were, and answers with it.
///
/// # Errors
/// As [`Reader::undated`].
pub(super) fn warn_of_undated(reader: &Reader, filter: &Filter) -> Result<u64> {
    let undated = reader.undated(filter)?;
    if undated > 0 {
        let words = format!(
            "{undated} results are left out, of which it is not known when they were: the clock was not synchronised; \
             leave out --since and --until to see them"
        );
        journal::write(Severity::Warning, &words);
    }
    Ok(undated)
}

/// Standard output, and why it first failed.
struct Pipe<'a> {
    out: StdoutLock<'a>,
    failure: Option<(io::ErrorKind, String)>,
}

impl Pipe<'_> {
    fn note<T>(&mut self, done: io::Result<T>) -> io::Result<T> {
        if let Err(error) = &done {
            let failure = (error.kind(), error.to_string());
            self.failure.get_or_insert(failure);
        }
        done
    }
}

impl Write for Pipe<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let done = self.out.write(bytes);
        self.note(done)
    }

    fn flush(&mut self) -> io::Result<()> {
        let done = self.out.flush();
        self.note(done)
    }
}

impl From<HistoryError> for Failure {
    fn from(error: HistoryError) -> Self {
        let exit = match (error.path.exists(), error.aside.is_some()) {
            (false, _) => Exit::Missing,
            (true, true) => Exit::Content,
            (true, false) => Exit::Unavailable,
        };
        Self::new(exit, error)
    }
}

/// The time of a result, to the second: by the clock, else by a browser's clock, else since the
/// start of the daemon.
fn moment(entry: &Entry) -> String {
    let second = |us| format!("{:.19}", clock::utc(us));
    match (entry.time_utc_us, entry.browser_utc_us) {
        (Some(us), _) => second(us),
        (None, Some(us)) => format!("≈{}", second(us)),
        (None, None) => {
            let s = entry.uptime_s;
            format!("{}:{:02}:{:02} after start", s / 3600, s / 60 % 60, s % 60)
        }
    }
}

fn row(entry: &Entry) -> String {
    let outside = entry.gauges.iter().filter(|gauge| gauge.decision & 1 == 0);
    let mut remarks: Vec<String> = outside
        .map(|gauge| match gauge.value {
            Some(value) => format!("{} {value:+.3} {}", gauge.name, gauge.unit)
                .trim_end()
                .to_owned(),
            None if gauge.decision & decision::ABSENT != 0 => format!("{} absent", gauge.name),
            None => format!("{} not measured", gauge.name),
        })
        .collect();
    remarks.extend(entry.reason.clone());
    remarks.extend(entry.recording.iter().map(|name| format!("[{name}]")));
    format!(
        "{:>10}  {:<20}  {:>6}  {:>10}  {:<7}  {:>6.1} %  {:>5} ms  {}",
        entry.seq,
        moment(entry),
        entry.recipe,
        entry.part_id,
        entry.verdict.word(),
        f64::from(entry.coverage_permille) / 10.0,
        entry.total_us / 1000,
        remarks.join("; ")
    )
}
