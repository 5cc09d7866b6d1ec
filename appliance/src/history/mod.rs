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

pub mod after;
mod columns;
pub mod csv;
pub mod entry;
mod handle;
mod keeper;
pub mod kept;
mod message;
mod open;
pub mod reader;
mod recordings;
pub mod schema;
pub mod seqs;
mod spool;
mod task;
pub mod time;
mod unkept;
pub mod writer;

#[cfg(test)]
mod tests;

pub use entry::{Entry, Filter, GaugeEntry, difference};
pub use handle::History;
pub use open::{OpenedHistory, open};
pub use reader::{Reader, Trend, TrendPoint};
pub use recordings::{JudgedPart, RECIPE, name_of, seq_of};
pub use seqs::Numbering;
pub use task::Task;
pub use unkept::{Unkept, why_no_frames};
pub use writer::Writer;

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
    pub path: std::path::PathBuf,
    /// What is wrong.
    pub reason: String,
    /// What the file is called when it is set aside, between its stem and its extension, where it
    /// is damaged, of another version or no history at all.
    pub aside: Option<String>,
}

/// What is asked of the history, or why it could not be read or written.
pub type HistoryResult<T> = Result<T, HistoryError>;

impl HistoryError {
    fn of(path: &std::path::Path, error: &rusqlite::Error) -> Self {
        Self {
            path: path.to_path_buf(),
            reason: error.to_string(),
            aside: schema::means_damage(error).then(|| schema::DAMAGED.into()),
        }
    }
}
