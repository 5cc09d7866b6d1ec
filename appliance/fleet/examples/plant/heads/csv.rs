//! The history of a head as CSV, in the format of the daemon's `GET /api/history.csv`.

use super::Head;
use super::results::row;
use fringed_fleet::answer::{Gauge, Row};
use std::fmt::Write as _;

/// The most results of one answer.
pub const MOST: u32 = 20_000;

const COLUMNS: &str = "seq,time_utc,recipe,fingerprint,part_id,press_stroke,token,verdict,error_code,reason,flags,\
    valid_points,coverage_permille,temperature_c,height_noise_mm,fitness_permille,exposure_us,total_us,stages_us,recording,time_source";

/// The newest results before SEQ `before`.
pub fn history(head: &Head, before: u32, limit: u32) -> String {
    let shapes = head.plant.gauges.iter().map(|gauge| &gauge.shape);
    let titles: String = shapes.map(titles).collect();
    let found = head.newest().filter(|&seq| seq < before);
    let found = found.take(limit.min(MOST) as usize);
    let lines = found.map(|seq| line(&row(head, seq), head.plant.gauges.len()));
    format!("{COLUMNS}{titles}\r\n{}", lines.collect::<String>())
}

/// The names of the columns of a gauge.
fn titles(gauge: &Gauge) -> String {
    let unit = match &*gauge.unit {
        "" => String::new(),
        unit => format!(" [{unit}]"),
    };
    let columns = [
        &*unit,
        " sigma",
        " low",
        " high",
        " decision",
        " U",
        " expected",
    ];
    let quoted = |column| {
        let title = format!("{}{column}", gauge.name);
        match title.contains([',', '"']) {
            true => format!(",\"{}\"", title.replace('"', "\"\"")),
            false => format!(",{title}"),
        }
    };
    columns.map(quoted).concat()
}

/// One result, with columns for this many gauges.
fn line(row: &Row, gauges: usize) -> String {
    let time = row.at_unix_ms.map_or(String::new(), utc);
    let source = match &*row.clock {
        "synchronised" => "clock",
        "none" => "",
        other => other,
    };
    let permille = (row.coverage * 1e3).round();
    let mut line = format!(
        "{},{time},{},{},{},{},0,{},{},,{},{},{permille},,0.004,1000,{},{},,,{source}",
        row.seq,
        row.recipe,
        row.fingerprint,
        row.part_id,
        row.press_stroke,
        row.verdict,
        row.error_code,
        row.flags,
        permille * 100.0,
        row.exposure_us,
        row.exposure_us + row.processing_us,
    );
    let number = |number: Option<f64>| number.map_or(String::new(), |number| number.to_string());
    for gauge in &row.gauges {
        let [value, sigma, low, high] =
            [gauge.value, gauge.sigma, gauge.low, gauge.high].map(number);
        // Writing to a string cannot fail.
        let _ = write!(
            line,
            ",{value},{sigma},{low},{high},{},{},",
            gauge.decision,
            number(gauge.u)
        );
    }
    line + &",".repeat(7 * (gauges - row.gauges.len())) + "\r\n"
}

/// A time in ms since 1970 UTC as text. Civil date of a day after H. Hinnant, "chrono-compatible
/// low-level date algorithms".
fn utc(ms: u64) -> String {
    let (days, rest) = (ms / 86_400_000, ms % 86_400_000);
    let shifted = days + 719_468;
    let (era, day) = (shifted / 146_097, shifted % 146_097);
    let year = (day - day / 1460 + day / 36_524 - day / 146_096) / 365;
    let day = day - (365 * year + year / 4 - year / 100);
    let march = (5 * day + 2) / 153;
    let of_month = day - (153 * march + 2) / 5 + 1;
    let (month, year) = ((march + 2) % 12 + 1, era * 400 + year + march / 10);
    let (seconds, ms) = (rest / 1000, rest % 1000);
    let (hour, minute, second) = (seconds / 3600, seconds / 60 % 60, seconds % 60);
    format!("{year:04}-{month:02}-{of_month:02}T{hour:02}:{minute:02}:{second:02}.{ms:03}000Z")
}

#[cfg(test)]
mod tests {
    #[test]
    fn times_are_those_of_the_calendar() {
        assert_eq!(super::utc(951_782_400_000), "2000-02-29T00:00:00.000000Z");
        assert_eq!(super::utc(1_795_278_896_500), "2026-11-21T16:34:56.500000Z");
    }
}
