//! The history of a head as CSV, in the format of the daemon's `GET /api/history.csv`.

use super::figures::millionths;
use super::gauge::Gauge;
use super::head::{Clock, Head};
use super::row::{Found, fingerprint};
use std::borrow::Cow;
use std::fmt::Write as _;

/// The most results of one answer.
pub(super) const MOST: u32 = 20_000;

const COLUMNS: &str = "seq,time_utc,recipe,fingerprint,part_id,press_stroke,token,verdict,error_code,reason,flags,\
    valid_points,coverage_permille,temperature_c,height_noise_mm,fitness_permille,exposure_us,total_us,stages_us,recording,time_source";

/// The names of the columns.
pub(super) fn header(gauges: &[Gauge]) -> String {
    let mut line = COLUMNS.to_owned();
    for gauge in gauges {
        let unit = match gauge.unit {
            "" => String::new(),
            unit => format!(" [{unit}]"),
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
            let _ = write!(line, ",{}", quoted(&format!("{}{column}", gauge.name)));
        }
    }
    line + "\r\n"
}

/// One result.
pub(super) fn line(head: &Head<'_>, found: &Found) -> String {
    let (time, source) = match head.clock() {
        Clock::None => (String::new(), ""),
        Clock::Browser => (utc(head.at_ms(found.seq)), "browser"),
        Clock::Synchronised => (utc(head.at_ms(found.seq)), "clock"),
    };
    let points = u32::from(found.coverage) * 100;
    let mut line = format!(
        "{},{time},{},{},{},{},0,{},{},,{},{points},{},,0.004,1000,{},{},,,{source}",
        found.seq,
        found.recipe,
        fingerprint(head, found.recipe),
        found.part_id,
        found.seq,
        found.verdict,
        found.error_code,
        found.flags,
        found.coverage,
        found.exposure_us,
        found.exposure_us + found.processing_us,
    );
    for (place, gauge) in head.plant.gauges.iter().enumerate() {
        let Some(&(value, bits)) = found.gauges.get(place) else {
            line.push_str(",,,,,,,");
            continue;
        };
        for number in [value, Some(gauge.sigma()), gauge.low, gauge.high] {
            let _ = write!(line, ",{}", number.map_or(String::new(), millionths));
        }
        let _ = write!(line, ",{bits},{},", millionths(gauge.u()));
    }
    line + "\r\n"
}

/// A time in ms since 1970 UTC as text. Civil date of a day after H. Hinnant, "chrono-compatible
/// low-level date algorithms".
fn utc(ms: u64) -> String {
    let (days, rest) = (ms / 86_400_000, ms % 86_400_000);
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
    let (seconds, ms) = (rest / 1000, rest % 1000);
    format!(
        "{:04}-{month:02}-{of_month:02}T{:02}:{:02}:{:02}.{ms:03}000Z",
        era * 400 + year + carry,
        seconds / 3600,
        seconds / 60 % 60,
        seconds % 60
    )
}

fn quoted(text: &str) -> Cow<'_, str> {
    if text.contains([',', '"']) {
        format!("\"{}\"", text.replace('"', "\"\"")).into()
    } else {
        text.into()
    }
}

#[cfg(test)]
mod tests {
    #[test]
    fn times_are_those_of_the_calendar() {
        assert_eq!(super::utc(951_782_400_000), "2000-02-29T00:00:00.000000Z");
        assert_eq!(super::utc(1_795_278_896_500), "2026-11-21T16:34:56.500000Z");
    }
}
