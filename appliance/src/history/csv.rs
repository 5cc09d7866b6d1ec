//! The history as CSV after RFC 4180: one line per result, the gauges in columns of their own.

use super::entry::{Entry, Filter};
use super::reader::{Reader, condition, rows};
use super::time::utc;
use super::{HistoryError, HistoryResult};
use rusqlite::params_from_iter;
use std::borrow::Cow;
use std::fmt::Write as _;
use std::io::Write;

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
    fn a_text_is_quoted_where_it_must_be_and_is_no_formula() {
        assert_eq!(quoted("plain"), "plain");
        assert_eq!(quoted("a,\"b\""), "\"a,\"\"b\"\"\"");
        assert_eq!(quoted("=1+1"), "\"'=1+1\"");
    }
}
