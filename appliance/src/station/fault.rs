//! Faults, which last until their cause is gone, and failures of one cycle, load or teach.

use std::sync::Arc;

use super::clock::Micros;
use super::error_code;
use super::event::Unstored;
use super::health::FULL_STORAGE_MIB;

/// What must happen before a fault can be cleared.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ClearedBy {
    /// The worker missed a deadline: ERROR_RESET, once the worker has given a sign of life since.
    SignOfLife,
    /// The worker reported a broken device: clears by itself when the worker reports its recovery.
    Recovery,
    /// Results cannot be stored: clears by itself when they can.
    Storage,
    /// The worker was silent while it had nothing to do, or in a load, a teach or a step of
    /// commissioning: clears by itself with its next sign of life.
    Life,
}

/// A lasting condition that keeps the station from measuring.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Fault {
    /// ERROR_CODE.
    pub code: u16,
    /// What happened, with numbers.
    pub cause: Arc<str>,
    /// What clears it.
    pub remedy: Arc<str>,
    /// Since when.
    pub since: Micros,
    /// What must happen first.
    pub cleared_by: ClearedBy,
}

impl Fault {
    /// Cause and remedy in a sentence, for the result of a cycle that the fault ends.
    pub(super) fn words(&self) -> Arc<str> {
        format!("{}: {}", self.cause, self.remedy).into()
    }

    /// A worker that was given `limit` for an order and did not answer.
    pub(super) fn deadline(waiting_for: &str, limit: Micros, since: Micros) -> Self {
        Self {
            code: error_code::DEADLINE,
            cause: format!("the measuring task was given {} ms to {waiting_for} and did not answer", limit.0 / 1000).into(),
            remedy: "wait until the heartbeat runs again, then reset errors (ERROR_RESET); if it stays still, restart fringed".into(),
            since,
            cleared_by: ClearedBy::SignOfLife,
        }
    }

    /// A worker that was silent for this long and works at nothing whose result must come in time.
    pub(super) fn silence(silent: Micros, since: Micros) -> Self {
        Self {
            code: error_code::DEADLINE,
            cause: format!(
                "the measuring task gave no sign of life for {} ms",
                silent.0 / 1000
            )
            .into(),
            remedy: "it clears by itself with the next sign of life; if it stays, restart fringed"
                .into(),
            since,
            cleared_by: ClearedBy::Life,
        }
    }

    /// A storage with only this much room left, MiB.
    pub(super) fn storage_full(room: u64, since: Micros) -> Self {
        Self {
            code: error_code::STORAGE_FULL,
            cause: format!("{room} MiB of storage are free, {FULL_STORAGE_MIB} are needed").into(),
            remedy: "remove recordings or other files from the storage; it clears by itself when there is room".into(),
            since,
            cleared_by: ClearedBy::Storage,
        }
    }

    /// No number after `seq` may be used.
    pub(super) fn seq_not_stored(seq: u32, why: Unstored, since: Micros) -> Self {
        let (cause, remedy) = match why {
            Unstored::Busy(ms) => (
                format!(
                    "no result number is reserved after {seq}: the storage is busy, {ms} ms so far"
                ),
                "trigger more slowly, or use faster storage; it clears by itself as soon as the storage has answered",
            ),
            Unstored::Refused(answer) => (
                format!("no result number can be stored after {seq}: {answer}"),
                "free space, or replace the storage if it is broken; it is tried every second and clears by itself",
            ),
        };
        Self {
            code: error_code::SEQ_NOT_STORED,
            cause: cause.into(),
            remedy: remedy.into(),
            since,
            cleared_by: ClearedBy::Storage,
        }
    }
}

/// How the last cycle, load or teach failed. Shown until one succeeds or ERROR_RESET.
#[derive(Debug, Clone)]
pub(super) struct LastFailure {
    /// ERROR_CODE.
    pub(super) code: u16,
    /// What was attempted with what, and the remedy.
    pub(super) words: Arc<str>,
}
