//! Times of results as text in ISO 8601, UTC, and back.

use rusqlite::Connection;

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
