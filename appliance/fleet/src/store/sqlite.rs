//! The embedded store: one SQLite file, for a plant of about thirty heads.
//!
//! Its calls block for as long as the disk takes; with so few heads that is some milliseconds. The
//! log is synced only when it is brought into the database: what a loss of power takes is asked for
//! again.

use super::schema::{Kind, schema};
use super::{Batch, Complaint};
use rusqlite::{Connection, Transaction, params};
use serde_json::json;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Longest wait for another collector that writes, or for a reader that holds the database.
const BUSY: Duration = Duration::from_secs(5);

/// One database.
pub struct Sqlite {
    path: PathBuf,
    open: Option<Connection>,
}

impl Sqlite {
    /// The database of a file; nothing is opened yet.
    pub(super) fn of(path: &str) -> Self {
        Self {
            path: Path::new(path).to_path_buf(),
            open: None,
        }
    }

    /// Creates the file and its tables where they are missing.
    pub(super) fn prepare(&mut self) -> Result<(), Complaint> {
        let made = Connection::open(&self.path).and_then(|connection| {
            connection.busy_timeout(BUSY)?;
            connection.pragma_update(None, "journal_mode", "wal")?;
            connection.pragma_update(None, "synchronous", "normal")?;
            connection.execute_batch(&schema(Kind::Sqlite))?;
            Ok(connection)
        });
        self.open = Some(made.map_err(|error| self.complaint(&error))?);
        Ok(())
    }

    pub(super) fn write(&mut self, batch: &Batch) -> Result<(), Complaint> {
        let written = self.connection()?.transaction().and_then(|transaction| {
            write(&transaction, batch)?;
            transaction.commit()
        });
        written.map_err(|error| self.complaint(&error))
    }

    /// The first column of every row.
    pub(super) fn lines(&mut self, sql: &str) -> Result<String, Complaint> {
        let lines = self.connection().map(|connection| {
            let mut statement = connection.prepare(sql)?;
            let rows = statement.query_map((), |row| row.get::<_, String>(0))?;
            rows.collect::<rusqlite::Result<Vec<_>>>()
        })?;
        let lines = lines.map_err(|error| self.complaint(&error))?;
        Ok(lines.join("\n"))
    }

    fn connection(&mut self) -> Result<&mut Connection, Complaint> {
        if self.open.is_none() {
            self.prepare()?;
        }
        self.open
            .as_mut()
            .ok_or_else(|| "the store is not open".into())
    }

    fn complaint(&self, error: &rusqlite::Error) -> Complaint {
        format!("{}: {error}", self.path.display())
    }
}

fn write(transaction: &Transaction<'_>, batch: &Batch) -> rusqlite::Result<()> {
    let mut insert = transaction.prepare_cached(
        "INSERT OR IGNORE INTO result VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)",
    )?;
    for received in &batch.rows {
        let row = &received.row;
        insert.execute(params![
            row.serial,
            row.history,
            row.seq,
            received.at(),
            row.at_unix_ms,
            row.clock,
            received.at_unix_ms,
            row.recipe,
            row.fingerprint,
            row.part_id,
            row.press_stroke,
            row.verdict,
            row.error_code,
            row.flags,
            row.exposure_us,
            row.processing_us,
            row.coverage,
            row.placement.map(|placement| json!(placement).to_string()),
            json!(row.gauges).to_string(),
        ])?;
    }
    let mut insert = transaction.prepare_cached(
        "INSERT INTO gap VALUES (?, ?, ?, ?) ON CONFLICT DO UPDATE SET last = max(last, excluded.last)",
    )?;
    for gap in &batch.gaps {
        insert.execute(params![gap.serial, gap.history, gap.first, gap.last])?;
    }
    let mut insert = transaction.prepare_cached(
        "INSERT OR REPLACE INTO head VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)",
    )?;
    for head in &batch.heads {
        insert.execute(params![
            head.url,
            head.line,
            head.serial,
            head.history,
            head.seq,
            head.updated_unix_ms,
            head.reachable,
            head.error,
            head.state,
            head.recipe,
            head.recipe_name,
            head.drift_px,
            head.last_result_unix_ms,
        ])?;
    }
    Ok(())
}
