//! Writes results into the database, bounds their number, and links recordings to them.
//!
//! A history of another version is renamed, and a new one begun.

use super::entry::Entry;
use super::reader::rows;
use super::recordings::Unkept;
use super::{HistoryError, HistoryResult, schema};
use rusqlite::{Connection, OptionalExtension as _, Transaction, params};
use std::path::{Path, PathBuf};

/// Starts of the daemon whose time is kept: more than there are in a year.
const MOST_STARTS: u32 = 1000;

/// The one writer of a database.
pub struct Writer {
    connection: Connection,
    path: PathBuf,
    /// Results stored.
    count: u64,
    /// The most that are kept.
    limit: u64,
}

impl Writer {
    /// Opens the database; one that is damaged or of another version is set aside and a new one
    /// begun: then the answer says so. `limit` is the most results that are kept.
    ///
    /// # Errors
    /// If it can be neither opened nor set aside.
    pub fn open(path: &Path, limit: u64) -> HistoryResult<(Self, Option<String>)> {
        match Self::open_sound(path, limit) {
            Err(error) if error.aside.is_some() => {
                let said = set_aside(&error)?;
                Ok((Self::open_sound(path, limit)?, Some(said)))
            }
            opened => Ok((opened?, None)),
        }
    }

    fn open_sound(path: &Path, limit: u64) -> HistoryResult<Self> {
        let connection = schema::open(path)?;
        if let Some(reason) = schema::complaint(&connection) {
            return Err(HistoryError {
                path: path.to_path_buf(),
                reason,
                aside: Some(schema::DAMAGED.into()),
            });
        }
        let count = connection
            .query_row("SELECT count(*) FROM result", (), |row| row.get(0))
            .map_err(|error| HistoryError::of(path, &error))?;
        Ok(Self {
            connection,
            path: path.to_path_buf(),
            count,
            limit: limit.max(1),
        })
    }

    /// Sets the database aside, which `why` says is damaged, and begins a new one; answers with a
    /// line for the log.
    ///
    /// # Errors
    /// If that is not possible; then nothing can be stored until it is.
    pub fn begin_anew(&mut self, why: &HistoryError) -> HistoryResult<String> {
        let failed = |error| HistoryError::of(&self.path, &error);
        // Closed before it is renamed: a log that is still open would be taken for the new
        // database's.
        self.connection = Connection::open_in_memory().map_err(failed)?;
        let said = set_aside(why)?;
        self.connection = schema::open(&self.path)?;
        self.count = 0;
        Ok(said)
    }

    /// The most pages that the database may have.
    #[cfg(test)]
    pub(super) fn bound_pages(&self, most: u32) {
        let pragma = self
            .connection
            .pragma_update_and_check(None, "max_page_count", most, |_| Ok(()));
        assert!(pragma.is_ok());
    }

    /// The SEQ of the result that was stored last.
    ///
    /// # Errors
    /// [`HistoryError`].
    pub fn last_seq(&self) -> HistoryResult<Option<u32>> {
        let newest = "SELECT seq FROM result ORDER BY id DESC LIMIT 1";
        let seq = self.connection.query_row(newest, (), |row| row.get(0));
        seq.optional().map_err(|error| self.failed(&error))
    }

    /// Stores results in one transaction and removes the oldest above the limit: all of it happens,
    /// or nothing.
    ///
    /// # Errors
    /// [`HistoryError`]; then nothing was stored.
    pub fn store<'a>(&mut self, entries: impl Iterator<Item = &'a Entry>) -> HistoryResult<()> {
        let (known, limit) = (self.count, self.limit);
        let stored = self.connection.transaction().and_then(|transaction| {
            let mut count = known;
            for entry in entries {
                insert(&transaction, entry)?;
                count += 1;
            }
            if count > limit {
                let oldest =
                    "DELETE FROM result WHERE id IN (SELECT id FROM result ORDER BY id LIMIT ?1)";
                count -= transaction
                    .prepare_cached(oldest)?
                    .execute([count - limit])? as u64;
            }
            transaction.commit()?;
            Ok(count)
        });
        self.count = stored.map_err(|error| self.failed(&error))?;
        Ok(())
    }

    /// The write-ahead log.
    pub fn log(&self) -> PathBuf {
        schema::log_of(&self.path)
    }

    /// The bytes of the log.
    pub fn log_bytes(&self) -> u64 {
        schema::log_bytes(&self.path)
    }

    /// Brings the log into the database and begins it anew, unless a reader needs it.
    ///
    /// # Errors
    /// [`HistoryError`].
    pub fn checkpoint(&mut self) -> HistoryResult<()> {
        schema::checkpoint(&self.connection).map_err(|error| self.failed(&error))
    }

    /// Notes that the frames of the newest result with this SEQ are kept under `name`.
    ///
    /// # Errors
    /// [`HistoryError`].
    pub fn link(&mut self, seq: u32, name: &str) -> HistoryResult<()> {
        let newest = "UPDATE result SET recording = ?2, unkept = NULL
            WHERE id = (SELECT max(id) FROM result WHERE seq = ?1)";
        self.change(newest, params![seq, name])
    }

    /// Notes why the frames of the newest result with this SEQ are not kept.
    ///
    /// # Errors
    /// [`HistoryError`].
    pub fn leave_out(&mut self, seq: u32, why: &Unkept) -> HistoryResult<()> {
        let newest =
            "UPDATE result SET unkept = ?2 WHERE id = (SELECT max(id) FROM result WHERE seq = ?1)";
        self.change(newest, params![seq, why.to_string()])
    }

    /// Notes that a recording is gone, and why.
    ///
    /// # Errors
    /// [`HistoryError`].
    pub fn unlink(&mut self, name: &str, why: &Unkept) -> HistoryResult<()> {
        let linked = "UPDATE result SET recording = NULL, unkept = ?2 WHERE recording = ?1";
        self.change(linked, params![name, why.to_string()])
    }

    /// Notes when a start of the daemon was by the clock of a signed-in user's browser, in place of
    /// what another one said before.
    ///
    /// # Errors
    /// [`HistoryError`].
    pub fn date(&mut self, boot_id: &str, utc_us: u64) -> HistoryResult<()> {
        let start = "INSERT INTO start VALUES (?1, ?2)
            ON CONFLICT (boot_id) DO UPDATE SET browser_utc_us = excluded.browser_utc_us";
        self.change(start, params![boot_id, utc_us])?;
        let oldest = "DELETE FROM start WHERE rowid <= (SELECT max(rowid) FROM start) - ?1";
        self.change(oldest, params![MOST_STARTS])
    }

    /// The recordings that results are linked to.
    ///
    /// # Errors
    /// [`HistoryError`].
    pub fn linked(&self) -> HistoryResult<Vec<String>> {
        let linked = "SELECT DISTINCT recording FROM result WHERE recording IS NOT NULL";
        let names = rows(&self.connection, linked, (), |row| row.get(0));
        names.map_err(|error| self.failed(&error))
    }

    fn change(&mut self, statement: &str, values: impl rusqlite::Params) -> HistoryResult<()> {
        let changed = self.connection.execute(statement, values);
        changed.map_err(|error| self.failed(&error))?;
        Ok(())
    }

    fn failed(&self, error: &rusqlite::Error) -> HistoryError {
        HistoryError::of(&self.path, error)
    }
}

/// Stores a result with its gauges.
fn insert(transaction: &Transaction<'_>, entry: &Entry) -> rusqlite::Result<()> {
    entry.insert(transaction, &[])?;
    let result = transaction.last_insert_rowid();
    for gauge in &entry.gauges {
        let place = gauge.slot.saturating_sub(1);
        gauge.insert(transaction, &[("result", &result), ("place", &place)])?;
    }
    Ok(())
}

/// Sets the database of an error aside; answers with a line for the log.
fn set_aside(error: &HistoryError) -> HistoryResult<String> {
    let HistoryError {
        path,
        reason,
        aside,
    } = error;
    let name = aside.as_deref().unwrap_or(schema::DAMAGED);
    match schema::set_aside(path, name) {
        Ok(aside) => Ok(format!(
            "{error}; it is kept as {} and a new history begins",
            aside.display()
        )),
        Err(failed) => Err(HistoryError {
            path: path.clone(),
            reason: format!("{reason}; and it cannot be set aside: {failed}"),
            aside: None,
        }),
    }
}
