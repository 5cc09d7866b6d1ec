//! What goes wrong on a head, and when: for 6 s in every 47 s, from a seeded time in the first 24 s on.

/// A fault of one head in twenty.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum Fault {
    /// Requests are not answered.
    Silence,
    /// Answers come with 10 kB/s.
    Slow,
    /// The head is off: connections are closed, no parts are measured, and their SEQ are skipped.
    Restart,
    /// The history is made anew, with SEQ from 1.
    Renew,
    /// Answers end in the middle.
    Cut,
    /// Results behind the last one, without end.
    Endless,
    /// 1 GB without the end of a line.
    Line,
    /// Results of the next head.
    Serial,
    /// SEQ that falls.
    Falling,
    /// A value that is NaN.
    Nan,
    /// The next head's address in place of an answer.
    Redirect,
}

/// Of so many heads one has a certain fault: the first the first of a list, and so on.
pub(super) const SHARE: u32 = 20;
/// Time between the beginnings of a fault, ms: no multiple of the time after which a collector asks
/// again, so that it does not ask in the next one.
pub(super) const PERIOD_MS: u64 = 47_000;
/// A fault begins for the first time before this, ms.
pub(super) const FIRST_MS: u64 = 24_000;
/// How long it lasts, ms.
pub(super) const LENGTH_MS: u64 = 6_000;

/// How often the fault of a head has begun `since_ms` after the start, and whether it lasts.
pub(super) fn begun(phase_ms: u64, since_ms: u64) -> (u64, bool) {
    match since_ms.checked_sub(phase_ms) {
        Some(since) => (since / PERIOD_MS + 1, since % PERIOD_MS < LENGTH_MS),
        None => (0, false),
    }
}
