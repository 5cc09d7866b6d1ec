//! The history: every result in an SQLite database, and the frames of failed parts, and of some good ones, as recordings.
//!
//! Threads of its own write ([`Task`]); the station and the measuring task hand over through a
//! bounded queue ([`History`]) and never wait. The page and the command line read with a
//! [`Reader`], which sees every stored result; reader and writer do not hold each other up
//! (SQLite's write-ahead log). All calls of a reader block: call them from
//! `tokio::task::spawn_blocking` where a socket runtime must go on.
//!
//! ```text
//! station ───result──► spool                            shared memory, which kill -9 does not touch
//!                     queue ──► thread `history`    ──► history.db      ──► Reader ──► page, `fringed history`
//! SEQ in use ──────────────────► thread `reserving`  ──► result-seq      SEQs reserved ahead of their use
//! measuring ──frames──► one slot ─► thread `recordings` ─► recordings/NAME ──► `fringed replay`
//! ```
//!
//! A result is shown before it is stored: a card that takes a second makes no verdict late. Each
//! result is put into the spool before it is shown, and the next start stores what the database
//! lacks: kill -9 costs at most the result in flight, however busy the card was. A loss of power
//! costs what was not synced yet: what came in the time that the card takes for one sync.

pub mod carry;
pub mod course;
pub mod design;
pub mod entry;
pub mod export;
mod handle;
pub mod kept;
pub mod reader;
mod recordings;
pub mod schema;
pub mod seqs;
mod spool;
pub mod statistics;
pub mod studies;
mod task;
pub mod writer;

#[cfg(test)]
mod tests;

pub use entry::{Entry, Filter, GaugeEntry, difference};
pub use handle::History;
pub use reader::{Reader, Trend, TrendPoint};
pub use recordings::{JudgedPart, RECIPE, Unkept, name_of, seq_of, why_no_frames};
pub use seqs::Numbering;
pub use task::Task;
pub use writer::Writer;

use crate::recipe::Store;
use crate::storage::state::{Counted, CounterError};
use handle::MAX_WAITING;
use seqs::AHEAD;
pub use spool::is_after;
use spool::{SLOTS, Spool};
use std::os::unix::fs::MetadataExt as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::sync_channel;

/// The database's name in the state folder.
pub const DATABASE: &str = "history.db";
/// The folder of recordings in the state folder.
pub const RECORDINGS: &str = "recordings";

/// What is kept, and how much of it.
#[derive(Clone, Copy, Debug)]
pub struct Bounds {
    /// The most results.
    pub results: u64,
    /// The most bytes of recordings of parts; 0 = none are kept.
    pub recordings: u64,
    /// Of so many parts that pass the frames of the first are kept; 0 = of none.
    pub good_every: u32,
}

/// A history that could not be read or written: what was attempted with what, and the remedy.
#[derive(Debug, thiserror::Error)]
#[error("history {path}: {reason}", path = path.display())]
pub struct HistoryError {
    /// The database.
    pub path: PathBuf,
    /// What is wrong.
    pub reason: String,
    /// What the file is called when it is set aside, between its stem and its extension, where it
    /// is damaged, of another version or no history at all.
    pub aside: Option<String>,
}

/// What is asked of the history, or why it could not be read or written.
pub type HistoryResult<T> = Result<T, HistoryError>;

impl HistoryError {
    fn of(path: &Path, error: &rusqlite::Error) -> Self {
        Self {
            path: path.to_path_buf(),
            reason: error.to_string(),
            aside: schema::means_damage(error).then(|| schema::DAMAGED.into()),
        }
    }
}

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

/// The number that a copy of a state goes on with behind `last`, as it is not known how far the
/// original went; `run` is random.
fn beyond(last: u32, run: u32, utc_s: Option<u64>) -> u32 {
    let by_time = utc_s.and_then(by_time);
    let by_time = by_time.filter(|&next| is_after(next, last));
    by_time.unwrap_or_else(|| last.wrapping_add(RESTORED + run % APART).wrapping_add(1))
}

/// The last SEQ that the run before has shown and the results that are still in memory, where that is
/// known; all that is there where the counter is lost.
fn shown_of(
    spool: Option<&Spool>,
    counted: &Result<Counted, CounterError>,
) -> Option<(u32, Vec<Entry>)> {
    match counted {
        Ok(counted) => spool?.of_run(counted.run),
        Err(_) => spool?.of_any_run(),
    }
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
    let found = shown_of(spool.as_ref(), &numbering.counted);
    let counted = numbering.counted.as_ref().copied().unwrap_or_default();
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
    let lost = numbering.counted.as_ref().err();
    let next = match lost {
        Some(_) => last.wrapping_add(UNKNOWN + 1),
        None if restored => beyond(last, numbering.run, numbering.utc_s),
        None => last.wrapping_add(1),
    };
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
    let opened = handle::open(&folder, recipes, bounds.recordings, queue.clone());
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
