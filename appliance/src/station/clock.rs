//! The station's time: monotonic, and as UTC while the system clock is synchronised.

/// Time since the start of the daemon in µs, on a clock that never runs backwards. Always an
/// argument, never read.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Micros(pub u64);

impl Micros {
    /// A span of `ms` milliseconds.
    pub const fn from_millis(ms: u64) -> Self {
        Self(ms.saturating_mul(1000))
    }

    /// This time plus a span; saturates.
    pub const fn after(self, span: Self) -> Self {
        Self(self.0.saturating_add(span.0))
    }

    /// The span from `earlier` to this time; zero if `earlier` is later.
    pub const fn since(self, earlier: Self) -> Self {
        Self(self.0.saturating_sub(earlier.0))
    }

    /// Whole seconds; saturates at 136 years.
    pub fn seconds(self) -> u32 {
        u32::try_from(self.0 / 1_000_000).unwrap_or(u32::MAX)
    }

    /// The number of µs for a 32-bit register; saturates at about 71 minutes.
    pub fn to_u32(self) -> u32 {
        u32::try_from(self.0).unwrap_or(u32::MAX)
    }
}

/// The time of the last event, and its relation to UTC.
#[derive(Debug, Clone, Default)]
pub(super) struct Clock {
    now: Micros,
    /// µs since 1970 UTC at time zero of [`Micros`], while the system clock is synchronised.
    utc_at_zero: Option<u64>,
}

impl Clock {
    /// Advances to the time of an event. An earlier time than the last one changes nothing.
    pub(super) fn advance(&mut self, now: Micros) {
        self.now = self.now.max(now);
    }

    /// The time of the last event.
    pub(super) fn now(&self) -> Micros {
        self.now
    }

    /// Takes the present UTC in µs since 1970; `None` if the system clock is not synchronised.
    pub(super) fn synchronise(&mut self, utc_us: Option<u64>) {
        self.utc_at_zero = utc_us.map(|utc| utc.saturating_sub(self.now.0));
    }

    /// A time of the station as UTC in µs since 1970, while the system clock is synchronised.
    pub(super) fn utc_us(&self, at: Micros) -> Option<u64> {
        self.utc_at_zero.map(|zero| zero.saturating_add(at.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_never_runs_backwards_and_utc_is_known_only_while_synchronised() {
        let mut clock = Clock::default();
        clock.advance(Micros(50));
        clock.advance(Micros(40));
        assert_eq!((clock.now(), clock.utc_us(Micros(50))), (Micros(50), None));
        clock.synchronise(Some(1050));
        assert_eq!(clock.utc_us(Micros(30)), Some(1030));
        clock.synchronise(None);
        assert_eq!(clock.utc_us(Micros(30)), None);
    }
}
