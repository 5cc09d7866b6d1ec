//! Carries a history from one state to another: a consistent copy, the check of one from elsewhere, and
//! the id and the numbers with which it goes on.
//!
//! A collector knows a result by serial, history and SEQ. So no SEQ is used twice, and a history that
//! goes on without results that it once had gets a new id. The ids before are kept with the last SEQ
//! of each: a collector that has those results asks for none of them again.

use super::reader::{Reader, rows};
use super::spool::Spool;
use super::writer::Writer;
use super::{DATABASE, HistoryError, HistoryResult, beyond, is_after, schema, shown_of};
use crate::storage::state::{Counted, StateFolder};
use rusqlite::backup::{Backup, StepResult};
use rusqlite::{Connection, OpenFlags, OptionalExtension as _};
use serde::Serialize;
use std::os::unix::fs::MetadataExt as _;
use std::path::Path;

/// Pages of the database that are copied at a time: all, as a writer between two pieces would have the
/// copy begin anew.
const ALL_PAGES: i32 = -1;

/// What a history holds.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Holding {
    /// Its id.
    pub id: String,
    /// How many results.
    pub results: u64,
    /// The SEQ of the newest.
    pub last: Option<u32>,
}

/// The results of a history up to a SEQ were kept under another id before.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct EarlierHistory {
    /// That id.
    pub history: String,
    /// The last SEQ under it.
    pub last: u32,
}

impl Reader {
    /// Copies the database as it is at one moment; cycles and their results go on meanwhile.
    ///
    /// # Errors
    /// [`HistoryError`]
    pub fn copy(&self, target: &Path) -> HistoryResult<()> {
        let failed = |error: rusqlite::Error| HistoryError::of(target, &error);
        let source = self.open()?;
        let mut copy = Connection::open(target).map_err(failed)?;
        // A copy that a loss of power leaves half is removed at the next start.
        copy.pragma_update(None, "synchronous", false)
            .map_err(failed)?;
        let backup = Backup::new(&source, &mut copy).map_err(failed)?;
        match backup.step(ALL_PAGES).map_err(failed)? {
            StepResult::Done => drop(backup),
            _ => {
                return Err(HistoryError {
                    path: target.to_path_buf(),
                    reason: "another program holds the history: try again".into(),
                    aside: None,
                });
            }
        }
        in_one_file(&copy).map_err(failed)
    }

    /// What the history holds.
    ///
    /// # Errors
    /// As [`Self::results`].
    pub fn holding(&self) -> HistoryResult<Holding> {
        self.read(holding)
    }
}

/// Leaves the database in one file, without a log beside it.
fn in_one_file(connection: &Connection) -> rusqlite::Result<()> {
    connection.pragma_update_and_check(None, "journal_mode", "delete", |_| Ok(()))
}

fn holding(connection: &Connection) -> rusqlite::Result<Holding> {
    let query = "SELECT (SELECT id FROM history), (SELECT count(*) FROM result),
        (SELECT seq FROM result ORDER BY id DESC LIMIT 1)";
    connection.query_row(query, (), |row| {
        Ok(Holding {
            id: row.get(0)?,
            results: row.get(1)?,
            last: row.get(2)?,
        })
    })
}

/// The ids that a history had before, the newest first.
pub(super) fn earlier(connection: &Connection) -> rusqlite::Result<Vec<EarlierHistory>> {
    let query = "SELECT id, last FROM earlier ORDER BY rowid DESC";
    rows(connection, query, (), |row| {
        Ok(EarlierHistory {
            history: row.get(0)?,
            last: row.get(1)?,
        })
    })
}

/// Checks a database that comes from elsewhere before anything in it is used, and answers with what
/// it holds.
///
/// # Errors
/// It is damaged, of another version, or has what no program of this project puts into one.
pub fn check(path: &Path) -> HistoryResult<Holding> {
    let failed = |error: rusqlite::Error| HistoryError::of(path, &error);
    let flags = OpenFlags::SQLITE_OPEN_READ_ONLY | OpenFlags::SQLITE_OPEN_NO_MUTEX;
    let connection = Connection::open_with_flags(path, flags).map_err(failed)?;
    for (pragma, value) in [("trusted_schema", false), ("cell_size_check", true)] {
        connection
            .pragma_update(None, pragma, value)
            .map_err(failed)?;
    }
    schema::refuse_other(&connection, path)?;
    // A trigger or a view would do as its maker wants, later.
    let strange = "SELECT name FROM sqlite_schema
        WHERE type NOT IN ('table', 'index') OR sql LIKE '%VIRTUAL%' LIMIT 1";
    let strange = connection.query_row(strange, (), |row| row.get::<_, String>(0));
    let strange = strange.optional().map_err(failed)?;
    let strange = strange.map(|name| format!("no history has {name:?}"));
    if let Some(reason) = strange.or_else(|| schema::complaint(&connection)) {
        return Err(HistoryError {
            path: path.to_path_buf(),
            reason,
            aside: None,
        });
    }
    holding(&connection).map_err(failed)
}

/// Gives a history a new id, unless it is another than `id` already.
///
/// # Errors
/// [`HistoryError`]
pub fn renew(path: &Path, id: &str) -> HistoryResult<()> {
    let failed = |error: rusqlite::Error| HistoryError::of(path, &error);
    let mut connection = schema::open(path)?;
    let renewed = connection.transaction().and_then(|transaction| {
        let before = holding(&transaction)?;
        if before.id != id {
            return Ok(());
        }
        let keep = "INSERT INTO earlier VALUES (?1, ?2)";
        transaction.execute(keep, (before.id, before.last.unwrap_or(0)))?;
        transaction.execute("UPDATE history SET id = lower(hex(randomblob(16)))", ())?;
        transaction.commit()
    });
    renewed.map_err(failed)?;
    in_one_file(&connection).map_err(failed)
}

/// Stores what the run before has shown and the database lacks, before another history takes its
/// place; answers with what the database holds then, and the last SEQ that may be in use.
///
/// # Errors
/// [`HistoryError`], also where the counter cannot be read.
pub fn drain(state: &StateFolder) -> HistoryResult<(Option<Holding>, u32)> {
    let path = state.path().join(DATABASE);
    let failed = |reason: String| HistoryError {
        path: path.clone(),
        reason,
        aside: None,
    };
    let counted = state.counted();
    let serial = state.serial().map_err(|error| failed(error.to_string()))?;
    let owner = std::fs::metadata(state.path()).map_err(|error| failed(error.to_string()))?;
    let spool = Spool::open(&serial, owner.uid()).ok();
    let found = shown_of(spool.as_ref(), &counted);
    let counted = counted.map_err(|error| failed(error.to_string()))?;
    let (last, mut shown) = found.unwrap_or((counted.last, Vec::new()));
    if !path.exists() {
        return Ok((None, last));
    }
    let (mut writer, _) = Writer::open(&path, u64::MAX)?;
    let stored = writer.last_seq()?;
    shown.retain(|entry| stored.is_none_or(|stored| is_after(entry.seq, stored)));
    writer.store(shown.iter())?;
    drop(writer);
    spool.inspect(Spool::remove);
    let held = Reader::of(state.path()).holding()?;
    let last = held.last.filter(|&seq| is_after(seq, last)).unwrap_or(last);
    Ok((Some(held), last))
}

/// Has numbers go on behind all of these; far behind them if they are those of another device, or of a
/// copy, of which it is not known how far it went. `run` is random.
///
/// # Errors
/// Whatever the file system answers.
pub fn go_on_behind(
    state: &StateFolder,
    last: impl IntoIterator<Item = u32>,
    of_other: bool,
    (run, utc_s): (u32, Option<u64>),
) -> std::io::Result<()> {
    let counted = state.counted().unwrap_or_default();
    let latest = last
        .into_iter()
        .fold(counted.last, |latest, seq| match is_after(seq, latest) {
            true => seq,
            false => latest,
        });
    let last = match of_other || counted.copied {
        true => beyond(latest, run, utc_s).wrapping_sub(1),
        false => latest,
    };
    state.counter().store(Counted { last, ..counted })
}
