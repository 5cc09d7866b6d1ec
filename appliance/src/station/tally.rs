//! Results since the start, counted by verdict.

use crate::station::Verdict;
use std::sync::{Arc, Mutex, PoisonError};

/// The counters. Cheap to clone; clones share them.
#[derive(Clone, Debug, Default)]
pub struct Tally(Arc<Mutex<Counts>>);

/// How many results there were.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// PASS.
    pub pass: u64,
    /// FAIL.
    pub fail: u64,
    /// INVALID.
    pub invalid: u64,
}

impl Tally {
    /// Counts a result.
    pub fn add(&self, verdict: Verdict) {
        let mut counts = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        match verdict {
            Verdict::Pass => counts.pass += 1,
            Verdict::Fail => counts.fail += 1,
            Verdict::Invalid | Verdict::None => counts.invalid += 1,
        }
    }

    /// How many there were.
    pub fn counts(&self) -> Counts {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
