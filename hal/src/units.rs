//! Units of the device side: points in time on one documented clock.

use std::fmt;
use std::ops::{Add, Sub};
use std::time::Duration;

/// A point in time, in nanoseconds of the head's clock.
///
/// The clock is `CLOCK_MONOTONIC` for real devices (back-ends convert theirs to it) and a virtual
/// clock that starts at zero for the simulated and the replay head. Timestamps of one head may be
/// compared and subtracted; those of different heads may not.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Timestamp(pub u64);

impl Timestamp {
    /// Time from `earlier` to `self`; zero if `earlier` is later than `self`.
    #[must_use]
    pub fn since(self, earlier: Self) -> Duration {
        Duration::from_nanos(self.0.saturating_sub(earlier.0))
    }

    /// Time between `self` and `other`, whichever is earlier.
    #[must_use]
    pub fn off(self, other: Self) -> Duration {
        Duration::from_nanos(self.0.abs_diff(other.0))
    }
}

/// Saturates at the end of the clock (584 years).
impl Add<Duration> for Timestamp {
    type Output = Self;

    fn add(self, duration: Duration) -> Self {
        Self(self.0.saturating_add(nanoseconds(duration)))
    }
}

/// Saturates at the start of the clock.
impl Sub<Duration> for Timestamp {
    type Output = Self;

    fn sub(self, duration: Duration) -> Self {
        Self(self.0.saturating_sub(nanoseconds(duration)))
    }
}

impl fmt::Display for Timestamp {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} ns", self.0)
    }
}

fn nanoseconds(duration: Duration) -> u64 {
    u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn adding_and_subtracting_a_duration_saturates_at_the_ends_of_the_clock() {
        assert_eq!(Timestamp(5) + Duration::from_nanos(7), Timestamp(12));
        assert_eq!(Timestamp(5) - Duration::from_nanos(7), Timestamp(0));
        assert_eq!(Timestamp(5) + Duration::MAX, Timestamp(u64::MAX));
    }

    #[test]
    fn time_since_a_later_point_is_zero() {
        assert_eq!(Timestamp(9).since(Timestamp(4)), Duration::from_nanos(5));
        assert_eq!(Timestamp(4).since(Timestamp(9)), Duration::ZERO);
    }
}
