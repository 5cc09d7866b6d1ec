//! The history as CSV after RFC 4180: one line per result, the gauges in columns of their own; and
//! times as text in ISO 8601, UTC, and back.

use super::entry::{Entry, Filter};
use super::reader::{Reader, condition, rows};
use super::{HistoryError, HistoryResult};
use rusqlite::{Connection, params_from_iter};
use std::borrow::Cow;
use std::fmt::Write as _;
use std::io::Write;

/// A time in µs since 1970 UTC as text. Years after 9999 have a sign, as ISO 8601 asks for.
pub fn utc(us: u64) -> String {
    let (days, rest) = (us / 86_400_000_000, us % 86_400_000_000);
    let (year, month, day) = civil(days);
    let (seconds, us) = (rest / 1_000_000, rest % 1_000_000);
    let (hour, minute, second) = (seconds / 3600, seconds / 60 % 60, seconds % 60);
    let sign = if year > 9999 { "+" } else { "" };
    format!("{sign}{year:04}-{month:02}-{day:02}T{hour:02}:{minute:02}:{second:02}.{us:06}Z")
}

/// Year, month and day of a number of days since 1970-01-01 (H. Hinnant, "chrono-compatible
/// low-level date algorithms", `civil_from_days`, for days that are not negative).
fn civil(days: u64) -> (u64, u64, u64) {
    let shifted = days + 719_468;
    let (era, day) = (shifted / 146_097, shifted % 146_097);
    let year = (day - day / 1460 + day / 36_524 - day / 146_096) / 365;
    let day = day - (365 * year + year / 4 - year / 100);
    let month = (5 * day + 2) / 153;
    let of_month = day - (153 * month + 2) / 5 + 1;
    let (month, carry) = if month < 10 {
        (month + 3, 0)
    } else {
        (month - 9, 1)
    };
    (era * 400 + year + carry, month, of_month)
}

/// The µs since 1970 UTC of a date (`2026-11-21`) or a time (`2026-11-21T16:30`,
/// `2026-11-21T16:30:00+01:00`; without a zone it is UTC), as SQLite reads it.
///
/// # Errors
/// In words, if the text is not a date or time.
pub fn utc_us(text: &str) -> Result<u64, String> {
    let calendar = || {
        let query = "SELECT CAST(round(unixepoch(?1, 'subsec') * 1e6) AS INTEGER)";
        let connection = Connection::open_in_memory()?;
        connection.query_row(query, [text], |row| row.get::<_, Option<u64>>(0))
    };
    // A bare number would be taken for a Julian day.
    let dated = text.contains('-').then(calendar);
    match dated {
        Some(Ok(Some(us))) => Ok(us),
        _ => Err("write a date or time since 1970 as 2026-11-21 or 2026-11-21T16:30:00Z".into()),
    }
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
            one(&mut line, &entry, &gauges);
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

fn one(line: &mut String, entry: &Entry, gauges: &[(String, String)]) {
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

fn number(number: Option<f64>) -> String {
    number.map_or_else(String::new, |number| number.to_string())
}

/// A text, quoted where it must be; what a spreadsheet would take for a formula gets an apostrophe
/// in front.
fn quoted(text: &str) -> Cow<'_, str> {
    let formula = text.starts_with(['=', '+', '-', '@', '\t', '\r']);
    let guard = if formula { "'" } else { "" };
    if formula || text.contains([',', '"', '\r', '\n']) {
        format!("\"{guard}{}\"", text.replace('"', "\"\"")).into()
    } else {
        text.into()
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

    #[test]
    fn a_text_is_quoted_where_it_must_be_and_is_no_formula() {
        assert_eq!(quoted("plain"), "plain");
        assert_eq!(quoted("a,\"b\""), "\"a,\"\"b\"\"\"");
        assert_eq!(quoted("=1+1"), "\"'=1+1\"");
    }
}
