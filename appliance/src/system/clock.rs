//! The system clock, and whether it is synchronised.

use std::sync::{Mutex, PoisonError};
use std::time::{Instant, SystemTime, UNIX_EPOCH};

/// The beginning of the year 10000, µs since 1970 UTC: dates in HTTP (RFC 9110), SQLite and most
/// programs that read CSV have four digits for the year. Linux itself sets no clock past 2232.
const YEAR_10000_US: u64 = 253_402_300_800_000_000;
/// The beginning of 2026, ms since 1970 UTC: this program was not there before.
const YEAR_2026_MS: u64 = 1_767_225_600_000;
/// The beginning of 2100.
const YEAR_2100_MS: u64 = 4_102_444_800_000;

/// The time in µs since 1970 UTC. `None` while no time service has synchronised the clock, or from
/// the year 10000 on: a wrong time is worse than none.
pub fn utc_us() -> Option<u64> {
    in_calendars(system_us()).filter(|_| synchronised())
}

/// What a browser's clock said, and when.
static TOLD: Mutex<Option<(Instant, u64)>> = Mutex::new(None);

/// Takes over the time of a signed-in user's browser, µs since 1970 UTC.
pub fn tell(utc_us: u64) {
    *TOLD.lock().unwrap_or_else(PoisonError::into_inner) = Some((Instant::now(), utc_us));
}

/// The time in s since 1970 UTC by a synchronised clock, else by what a browser said last.
pub fn utc_or_told_s() -> Option<u64> {
    let told = || {
        let (when, us) = (*TOLD.lock().unwrap_or_else(PoisonError::into_inner))?;
        Some(us + when.elapsed().as_micros() as u64)
    };
    Some(utc_us().or_else(told)? / 1_000_000)
}

/// Whether the system clock shows a time for which there is no date in HTTP: before 1970, or from
/// the year 10000 on.
pub fn is_past_calendars() -> bool {
    in_calendars(system_us()).is_none()
}

/// The system clock, µs since 1970 UTC; none before 1970.
fn system_us() -> Option<u64> {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).ok()?;
    u64::try_from(since.as_micros()).ok()
}

fn in_calendars(utc_us: Option<u64>) -> Option<u64> {
    utc_us.filter(|&us| us < YEAR_10000_US)
}

/// The time of a browser's clock in µs since 1970 UTC, given in ms; `None` before 2026 and from
/// 2100 on, where that clock is certainly wrong.
pub fn of_browser(ms: u64) -> Option<u64> {
    (YEAR_2026_MS..YEAR_2100_MS)
        .contains(&ms)
        .then(|| ms * 1000)
}

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

/// Whether the kernel says that the clock is disciplined by a time service.
#[cfg(target_os = "linux")]
#[expect(
    unsafe_code,
    reason = "adjtimex has no safe wrapper that is maintained"
)]
fn synchronised() -> bool {
    let mut state = std::mem::MaybeUninit::<libc::timex>::zeroed();
    // SAFETY: `timex` is plain integers, for which zero is a value; with modes = 0 the call only
    // reads the clock's state and writes it into the struct that it is given.
    let answer = unsafe { libc::adjtimex(state.as_mut_ptr()) };
    answer >= 0 && answer != libc::TIME_ERROR
}

/// Elsewhere this is not known.
#[cfg(not(target_os = "linux"))]
fn synchronised() -> bool {
    false
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_of_believable_times_are_those_of_the_calendar() {
        assert_eq!(utc(YEAR_10000_US), "+10000-01-01T00:00:00.000000Z");
        let last = Some(YEAR_10000_US - 1);
        assert_eq!(in_calendars(last), last);
        assert_eq!(in_calendars(Some(YEAR_10000_US)), None);
        assert!(!is_past_calendars(), "of this computer");
        for (ms, words) in [
            (YEAR_2026_MS, "2026-01-01T00:00:00.000000Z"),
            (YEAR_2100_MS - 1, "2099-12-31T23:59:59.999000Z"),
        ] {
            assert_eq!(of_browser(ms).map(utc).as_deref(), Some(words));
        }
        for wrong in [0, YEAR_2026_MS - 1, YEAR_2100_MS, u64::MAX] {
            assert_eq!(of_browser(wrong), None);
        }
    }
}
