//! Opens the history: database, counter, spool and recordings.

use super::handle::History;
use super::keeper;
use super::message::MAX_WAITING;
use super::seqs::{AHEAD, Numbering};
use super::spool::{SLOTS, Spool, is_after};
use super::task::Task;
use super::writer::Writer;
use super::{Bounds, DATABASE, HistoryError, HistoryResult, RECORDINGS};
use crate::recipe::Store;
use std::os::unix::fs::MetadataExt as _;
use std::path::Path;
use std::sync::Arc;
use std::sync::mpsc::sync_channel;

/// As many numbers are skipped where the counter is lost: those of results that were shown and not
/// stored.
const UNKNOWN: u32 = SLOTS + AHEAD;
/// As many are skipped at least where the state folder is a copy and the time is not known: more
/// results than a station shows in the half year that a backup may be old, at one a second.
const RESTORED: u32 = 1 << 24;
/// Up to so many more, at random: a backup may be restored twice.
const APART: u32 = 1 << 27;
/// Numbers per second of time that a copy goes on with where the time is known: more than a station
/// shows results, and enough for seventeen years.
const PER_SECOND: u64 = 8;
/// The beginning of 2026, s since 1970 UTC.
const YEAR_2026_S: u64 = 1_767_225_600;

/// An opened history.
pub struct OpenedHistory {
    /// The way to it.
    pub history: History,
    /// Its thread's side.
    pub task: Task,
    /// The SEQ of the next result.
    pub next_seq: u32,
    /// The SEQ that was acknowledged last in BUFFERED mode; `None` outside of it.
    pub buffered: Option<u32>,
    /// What had to be set aside, or is a copy.
    pub complaint: Option<String>,
}

/// The number that a copy goes on with at a time: behind those of every copy that began before.
fn by_time(utc_s: u64) -> Option<u32> {
    let since = utc_s.checked_sub(YEAR_2026_S)?;
    u32::try_from(since.checked_mul(PER_SECOND)?).ok()
}

/// Opens the history of a state folder, and stores what the run before has shown and the database
/// lacks.
///
/// # Errors
/// If database, folder or counter can neither be opened nor begun.
pub fn open(state: &Path, numbering: Numbering, bounds: Bounds) -> HistoryResult<OpenedHistory> {
    let failed = |what: &str, error: std::io::Error| HistoryError {
        path: state.join(what),
        reason: format!("{error}: free space"),
        aside: None,
    };
    let (mut writer, complaint) = Writer::open(&state.join(DATABASE), bounds.results)?;
    let owner = std::fs::metadata(state).map_err(|error| failed("", error))?;
    // Where the system has no shared memory, or another process has it, a kill skips numbers and
    // loses results that wait.
    let spool = Spool::open(&numbering.serial, owner.uid()).ok();
    let found = spool.as_ref().and_then(|spool| match &numbering.counted {
        Ok(counted) => spool.of_run(counted.run),
        Err(_) => spool.of_any_run(),
    });
    let counted = numbering.counted.clone().unwrap_or_default();
    let of_run = found.as_ref().and(spool.as_ref());
    let buffered = of_run.and_then(Spool::buffered).unwrap_or(counted.buffered);
    // Where shared memory does not say how a copied folder went on, nothing bounds its age.
    let restored = counted.copied && found.is_none();
    let (last, mut shown) = found.unwrap_or((counted.last, Vec::new()));
    let stored = writer.last_seq()?;
    shown.retain(|entry| stored.is_none_or(|stored| is_after(entry.seq, stored)));
    // A counter that was lost or taken from an older copy of the folder must not bring back a
    // number.
    let last = stored.filter(|&seq| is_after(seq, last)).unwrap_or(last);
    let lost = numbering.counted.clone().err();
    let skipped = match lost {
        Some(_) => UNKNOWN,
        None if restored => RESTORED + numbering.run % APART,
        None => 0,
    };
    let by_time = numbering.utc_s.filter(|_| restored).and_then(by_time);
    let by_time = by_time.filter(|&next| is_after(next, last));
    let next = by_time.unwrap_or(last.wrapping_add(skipped).wrapping_add(1));
    let lost = lost.map(|problem| {
        numbering.counter.put_aside();
        format!(
            "{problem}: it is put aside as result-seq.damaged; which results were shown last is not known, so RESULT_SEQ goes on \
             with {next}, behind all that the history has"
        )
    });
    let lost = lost.or_else(|| {
        restored.then(|| {
            format!(
                "the state folder is a copy, as a restored backup is: which results were shown after it was made is not known, so RESULT_SEQ goes on with {next}"
            )
        })
    });
    let waiting = match writer.store(shown.iter()) {
        Ok(()) => Vec::new(),
        // It stays in the spool until it is stored.
        Err(_) => shown,
    };
    let numbered = numbering.reserve(spool, next, buffered);
    let (seqs, spool) = numbered.map_err(|error| failed("result-seq", error))?;
    let spool = spool.map(Arc::new);
    let (queue, inbox) = sync_channel(MAX_WAITING);
    let recipes = Store::at(&state.join("recipes"));
    let folder = state.join(RECORDINGS);
    let opened = keeper::open(&folder, recipes, bounds.recordings, queue.clone());
    let (keeper, keeping) = opened.map_err(|error| failed(RECORDINGS, error))?;
    let history = History {
        queue,
        lost: Arc::default(),
        spool,
        seqs,
        keeper,
        good: Arc::default(),
        good_every: bounds.good_every,
    };
    let task = Task::new(history.clone(), inbox, writer, keeping, waiting);
    let complaints = lost.into_iter().chain(complaint);
    Ok(OpenedHistory {
        history,
        task,
        next_seq: next,
        buffered,
        complaint: complaints.reduce(|all, more| all + "\n" + &more),
    })
}
