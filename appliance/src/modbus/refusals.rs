//! Refusals: what was refused to whom, for the log, but never so often that the log itself is the attack.

use std::fmt;
use std::net::IpAddr;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// At most one line in this time.
const PAUSE: Duration = Duration::from_secs(10);

/// What was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refused {
    /// A connection from outside the subnets that may read.
    Connection,
    /// A connection to a full house.
    Full,
    /// A write of a client that may not write.
    Write,
}

impl Refused {
    fn words(self) -> &'static str {
        match self {
            Self::Connection => {
                "a connection was refused: modbus.readers does not list its address"
            }
            Self::Full => "a connection was refused: all are taken and none is idle",
            Self::Write => "a write was refused: modbus.writers does not list its address",
        }
    }
}

/// Writes refusals down. Cheap to clone.
#[derive(Clone)]
pub struct Refusals {
    say: Arc<dyn Fn(&str) + Send + Sync>,
    /// By kind, so that a flood of one does not hide another.
    paces: Arc<Mutex<[Pace; 3]>>,
}

impl fmt::Debug for Refusals {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Refusals").finish_non_exhaustive()
    }
}

#[derive(Debug, Default)]
struct Pace {
    last: Option<Instant>,
    /// Refusals since the last line.
    silent: u64,
}

impl Pace {
    /// Whether a line may be written now, and how many were not since the last one.
    fn pass(&mut self, now: Instant) -> Option<u64> {
        if self
            .last
            .is_some_and(|last| now.saturating_duration_since(last) < PAUSE)
        {
            self.silent += 1;
            return None;
        }
        self.last = Some(now);
        Some(std::mem::take(&mut self.silent))
    }
}

impl Refusals {
    /// Refusals are told to `say`, a line at a time.
    pub fn new(say: impl Fn(&str) + Send + Sync + 'static) -> Self {
        Self {
            say: Arc::new(say),
            paces: Arc::default(),
        }
    }

    /// Notes one.
    pub(super) fn note(&self, refused: Refused, peer: IpAddr) {
        let mut paces = self.paces.lock().unwrap_or_else(PoisonError::into_inner);
        let [connection, full, write] = &mut *paces;
        let pace = match refused {
            Refused::Connection => connection,
            Refused::Full => full,
            Refused::Write => write,
        };
        match pace.pass(Instant::now()) {
            None => {}
            Some(0) => (self.say)(&format!("Modbus, {peer}: {}", refused.words())),
            Some(silent) => (self.say)(&format!(
                "Modbus, {peer}: {}; {silent} more since the last such line",
                refused.words()
            )),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flood_of_refusals_is_one_line_in_ten_seconds_that_counts_the_others() {
        let (mut pace, start) = (Pace::default(), Instant::now());
        assert_eq!(pace.pass(start), Some(0));
        for ms in 1..=500 {
            assert_eq!(pace.pass(start + Duration::from_millis(ms)), None);
        }
        assert_eq!(pace.pass(start + PAUSE), Some(500));
        assert_eq!(pace.pass(start + 2 * PAUSE), Some(0));
    }
}
