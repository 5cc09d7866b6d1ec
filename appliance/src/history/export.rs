//! The history read from end to end, for other programs: page by page in the order of SEQ for those
//! that collect results, and as CSV after RFC 4180, one line per result, the gauges in columns of their
//! own. With it times as text in ISO 8601, UTC, and back.

use super::carry::{self, EarlierHistory};
use super::entry::{Entry, Filter};
use super::reader::{Reader, condition, read, rows};
use super::{HistoryError, HistoryResult};
use crate::storage::quoted;
use crate::system::clock::utc;
use rusqlite::{Connection, Transaction, params_from_iter};
use std::fmt::Write as _;
use std::io::Write;
use std::path::PathBuf;

/// Results of a page: what is in memory of an answer, whatever its length.
const PAGE: usize = 64;
/// Memory of a connection for the database's pages, KiB: several readers at a time must not cost
/// what SQLite takes otherwise, 2 MiB each.
const CACHE: i64 = 256;

/// A walk through the results behind a SEQ. Between two pages nothing of the database is held, so
/// that its log does not grow while a client is slow.
pub struct After {
    connection: Connection,
    path: PathBuf,
    id: String,
    earlier: Vec<EarlierHistory>,
    /// The last SEQ that is behind the reader.
    seq: u32,
    /// Results that may still be read.
    left: usize,
    /// The newest SEQ when the walk began, at which it ends; none before its first page.
    last: Option<u32>,
}

/// Some results, oldest first.
pub struct Page {
    /// The oldest SEQ that is kept; none in an empty history.
    pub first: Option<u32>,
    /// The newest.
    pub last: Option<u32>,
    /// The results; empty at the end.
    pub results: Vec<Entry>,
}

impl Reader {
    /// Begins behind `seq`; at most `limit` results follow.
    ///
    /// # Errors
    /// As [`Self::results`].
    pub fn after(&self, seq: u32, limit: usize) -> HistoryResult<After> {
        let connection = self.open()?;
        let failed = |error: rusqlite::Error| HistoryError::of(self.path(), &error);
        let sized = connection.pragma_update(None, "cache_size", -CACHE);
        sized.map_err(failed)?;
        let id = connection.query_row("SELECT id FROM history", (), |row| row.get(0));
        Ok(After {
            id: id.map_err(failed)?,
            // A history that no program has opened for writing since has no such table.
            earlier: carry::earlier(&connection).unwrap_or_default(),
            connection,
            path: self.path().to_path_buf(),
            seq,
            left: limit,
            last: None,
        })
    }
}

impl After {
    /// Which history it is: [`Reader::id`].
    pub fn id(&self) -> &str {
        &self.id
    }

    /// The ids that it had before, the newest first.
    pub fn earlier(&self) -> &[EarlierHistory] {
        &self.earlier
    }

    /// The next page; the first says where the walk ends. Where results that are next were deleted
    /// meanwhile, the walk ends early, so that the first page of another one shows what is missing.
    ///
    /// # Errors
    /// As [`Reader::results`].
    pub fn page(&mut self) -> HistoryResult<Page> {
        // A transaction, so that limits and results are of one state of the history.
        let transaction = self.connection.unchecked_transaction();
        let most = self.left.min(PAGE);
        let page = transaction.and_then(|transaction| {
            let mut page = bounds(&transaction)?;
            let gone = page
                .first
                .is_some_and(|first| first > self.seq.saturating_add(1));
            if self.last.is_none() || !gone {
                let last = self.last.or(page.last).unwrap_or(0);
                page.results = behind(&transaction, self.seq, last, most)?;
            }
            Ok(page)
        });
        let page = page.map_err(|error| HistoryError::of(&self.path, &error))?;
        self.last = self.last.or(page.last);
        self.left -= page.results.len();
        self.seq = page.results.last().map_or(self.seq, |entry| entry.seq);
        Ok(page)
    }
}

fn bounds(transaction: &Transaction<'_>) -> rusqlite::Result<Page> {
    let query = "SELECT (SELECT min(seq) FROM result), (SELECT max(seq) FROM result)";
    transaction.query_row(query, (), |row| {
        Ok(Page {
            first: row.get(0)?,
            last: row.get(1)?,
            results: Vec::new(),
        })
    })
}

fn behind(
    connection: &Connection,
    seq: u32,
    last: u32,
    most: usize,
) -> rusqlite::Result<Vec<Entry>> {
    let query = "SELECT * FROM dated WHERE seq > ?1 AND seq <= ?2 ORDER BY seq LIMIT ?3";
    let bounds = (seq, last, most);
    rows(connection, query, bounds, |row| read(connection, row))
}

/// The columns before the gauges'.
const COLUMNS: &str = "seq,time_utc,recipe,fingerprint,part_id,press_stroke,token,verdict,error_code,reason,flags,\
    valid_points,coverage_permille,temperature_c,height_noise_mm,fitness_permille,exposure_us,total_us,stages_us,recording,time_source";

impl Reader {
    /// Writes the results that pass the filter, newest first, with the names of all their gauges in
    /// the header line. A gauge has seven columns: value with its unit, σ, two limits, decision
    /// bits, U and the magnitude that is expected on a good part.
    ///
    /// # Errors
    /// [`HistoryError`], also where `out` takes no more.
    pub fn csv(&self, filter: &Filter, out: &mut dyn Write) -> HistoryResult<()> {
        let gauges = self.gauges(filter)?;
        let mut head = COLUMNS.to_owned();
        for (name, unit) in &gauges {
            let unit = if unit.is_empty() {
                String::new()
            } else {
                format!(" [{unit}]")
            };
            for column in [
                &unit,
                " sigma",
                " low",
                " high",
                " decision",
                " U",
                " expected",
            ] {
                head.push(',');
                head.push_str(&quoted(&format!("{name}{column}")));
            }
        }
        let write = |out: &mut dyn Write, line: &str| {
            out.write_all(line.as_bytes())
                .and_then(|()| out.write_all(b"\r\n"))
                .map_err(|error| HistoryError {
                    path: self.path().to_path_buf(),
                    reason: format!("write as CSV: {error}"),
                    aside: None,
                })
        };
        write(out, &head)?;
        let mut line = String::new();
        self.each(filter, |entry| {
            line.clear();
            put(&mut line, &entry, &gauges);
            write(out, &line)
        })
    }

    /// Name and unit of every gauge of the results that pass the filter.
    fn gauges(&self, filter: &Filter) -> HistoryResult<Vec<(String, String)>> {
        let (condition, mut values) = condition(filter);
        values.push(i64::try_from(filter.limit).unwrap_or(i64::MAX).into());
        let query = format!(
            "SELECT DISTINCT name, unit FROM gauge WHERE result IN
                (SELECT id FROM dated WHERE {condition} ORDER BY id DESC LIMIT ?) ORDER BY place, name"
        );
        let values = params_from_iter(values);
        self.read(|connection| {
            rows(connection, &query, values, |row| {
                Ok((row.get(0)?, row.get(1)?))
            })
        })
    }
}

/// Appends a result to a line.
fn put(line: &mut String, entry: &Entry, gauges: &[(String, String)]) {
    // Writing to a string cannot fail.
    let (time, source) = match (entry.time_utc_us, entry.browser_utc_us) {
        (Some(us), _) => (utc(us), "clock"),
        (None, Some(us)) => (utc(us), "browser"),
        (None, None) => (String::new(), ""),
    };
    let stages: Vec<_> = entry
        .stages
        .iter()
        .map(|time| format!("{} {}", time.stage.name(), time.us))
        .collect();
    let words = [&entry.reason, &entry.recording];
    let [reason, recording] = words.map(|text| quoted(text.as_deref().unwrap_or_default()));
    let _ = write!(
        line,
        "{},{time},{},{},{},{},{},{},{},{reason},{},{},{},{},{},{},{},{},{},{recording},{source}",
        entry.seq,
        entry.recipe,
        entry.fingerprint,
        entry.part_id,
        entry.press_stroke,
        entry.token,
        entry.verdict.word(),
        entry.error_code,
        entry.flags,
        entry.valid_points,
        entry.coverage_permille,
        number(entry.temperature_c),
        number(entry.height_noise_mm),
        entry.fitness_permille,
        entry.exposure_us,
        entry.total_us,
        quoted(&stages.join("; ")),
    );
    for (name, unit) in gauges {
        match entry
            .gauges
            .iter()
            .find(|gauge| gauge.name == *name && gauge.unit == *unit)
        {
            Some(gauge) => {
                for value in [gauge.value, gauge.sigma, gauge.low, gauge.high] {
                    let _ = write!(line, ",{}", number(value));
                }
                let (u, expected) = (number(gauge.uncertainty), number(gauge.expected));
                let _ = write!(line, ",{},{u},{expected}", gauge.decision);
            }
            None => line.push_str(",,,,,,,"),
        }
    }
}

pub(super) fn number(number: Option<f64>) -> String {
    number.map_or_else(String::new, |number| number.to_string())
}

/// A text that is not a date or time.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("write a date or time since 1970 as 2026-11-21 or 2026-11-21T16:30:00Z")]
pub struct NoTime;

/// The µs since 1970 UTC of a date (`2026-11-21`) or a time (`2026-11-21T16:30`,
/// `2026-11-21T16:30:00+01:00`; without a zone it is UTC), as SQLite reads it.
///
/// # Errors
/// If the text is not a date or time.
pub fn utc_us(text: &str) -> Result<u64, NoTime> {
    let calendar = || {
        let query = "SELECT CAST(round(unixepoch(?1, 'subsec') * 1e6) AS INTEGER)";
        let connection = Connection::open_in_memory()?;
        connection.query_row(query, [text], |row| row.get::<_, Option<u64>>(0))
    };
    // A bare number would be taken for a Julian day.
    let dated = text.contains('-').then(calendar);
    match dated {
        Some(Ok(Some(us))) => Ok(us),
        _ => Err(NoTime),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_those_of_the_calendar_and_back() {
        for (us, words) in [
            (0, "1970-01-01T00:00:00.000000Z"),
            (951_782_400_000_000, "2000-02-29T00:00:00.000000Z"),
            (1_795_278_896_500_000, "2026-11-21T16:34:56.500000Z"),
            (4_107_542_399_000_000, "2100-02-28T23:59:59.000000Z"),
            (4_107_542_400_000_000, "2100-03-01T00:00:00.000000Z"),
        ] {
            assert_eq!((utc(us).as_str(), utc_us(words)), (words, Ok(us)));
        }
        assert_eq!(
            utc_us("2026-11-21T16:34+02:00"),
            utc_us("2026-11-21T14:34:00Z")
        );
        assert_eq!(utc_us("1970-01-02"), Ok(86_400_000_000));
        assert_eq!(
            utc(253_402_300_800_000_000),
            "+10000-01-01T00:00:00.000000Z"
        );
        assert!(utc(u64::MAX).starts_with('+'));
        for wrong in ["", "yesterday", "12", "2026-13-01", "1969-12-31"] {
            assert!(utc_us(wrong).is_err(), "{wrong}");
        }
    }
}
