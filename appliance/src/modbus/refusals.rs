//! Refusals for the log: what was refused to which address, with a rate limit, so that an attack
//! cannot flood the log.

use std::net::IpAddr;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use crate::system::progress::Progress;

/// At most one line in this time.
const PAUSE: Duration = Duration::from_secs(10);

/// What was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RefusedPeer {
    /// A connection from outside the subnets that may read.
    Connection,
    /// A connection while all others are in use and none is idle.
    Full,
    /// A write of a client that may not write.
    Write,
}

impl RefusedPeer {
    fn words(self) -> &'static str {
        match self {
            Self::Connection => {
                "a connection was refused: modbus.readers does not list its address"
            }
            Self::Full => "a connection was refused: all connections are in use and none is idle",
            Self::Write => "a write was refused: modbus.writers does not list its address",
        }
    }
}

/// Logs refusals. Cheap to clone; clones share the rate limit.
#[derive(Clone, Debug)]
pub struct Refusals {
    progress: Progress,
    /// By kind, so that a flood of one does not hide another.
    limits: Arc<Mutex<[RateLimit; 3]>>,
}

#[derive(Debug, Default)]
struct RateLimit {
    last: Option<Instant>,
    /// Refusals since the last line.
    silent: u64,
}

impl RateLimit {
    /// Whether a line may be written now: then the number of refusals since the last line.
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
    /// Logs refusals as warnings.
    pub fn new(progress: Progress) -> Self {
        Self {
            progress,
            limits: Arc::default(),
        }
    }

    /// Logs a refusal, or counts it for the next line.
    pub(super) fn note(&self, refused: RefusedPeer, peer: IpAddr) {
        let mut limits = self.limits.lock().unwrap_or_else(PoisonError::into_inner);
        let Some(silent) = limits[refused as usize].pass(Instant::now()) else {
            return;
        };
        let mut line = format!("Modbus, {peer}: {}", refused.words());
        if silent > 0 {
            line += &format!("; {silent} more since the last such line");
        }
        self.progress.warn(&line);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flood_of_refusals_is_one_line_in_ten_seconds_that_counts_the_others() {
        let (mut limit, start) = (RateLimit::default(), Instant::now());
        assert_eq!(limit.pass(start), Some(0));
        for ms in 1..=500 {
            assert_eq!(limit.pass(start + Duration::from_millis(ms)), None);
        }
        assert_eq!(limit.pass(start + PAUSE), Some(500));
        assert_eq!(limit.pass(start + 2 * PAUSE), Some(0));
    }
}
