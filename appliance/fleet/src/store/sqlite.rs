//! The embedded store: one SQLite file, for a plant of about thirty heads.
//!
//! Its calls block for as long as the disk takes; with so few heads that is some milliseconds. The
//! log is synced only when it is brought into the database: what a loss of power takes is asked for
//! again.

use super::{Batch, Complaint, Kind, schema};
use rusqlite::types::Value as Sql;
use rusqlite::{Connection, Transaction, params_from_iter};
use serde_json::{Value, json};
use std::os::unix::fs::MetadataExt as _;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Longest wait for another collector that writes, or for a reader that holds the database.
const BUSY: Duration = Duration::from_secs(5);

/// One database.
pub struct Sqlite {
    path: PathBuf,
    open: Option<Connection>,
    /// Which file is open: device and number.
    file: Option<(u64, u64)>,
}

impl Sqlite {
    /// The database of a file; nothing is opened yet.
    pub(super) fn of(path: &str) -> Self {
        Self {
            path: Path::new(path).to_path_buf(),
            open: None,
            file: None,
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
        self.file = self.found();
        Ok(())
    }

    /// The file that has its name now.
    fn found(&self) -> Option<(u64, u64)> {
        let about = self.path.metadata().ok()?;
        Some((about.dev(), about.ino()))
    }

    /// Why nothing must be written any more: the file was deleted or replaced while it was open.
    pub(super) fn gone(&self) -> Option<Complaint> {
        (self.open.is_some() && self.found() != self.file).then(|| {
            format!(
                "{} was deleted or replaced while it was open: start the collector again, which makes it anew and fetches what the heads still have",
                self.path.display()
            )
        })
    }

    pub(super) fn write(&mut self, batch: &Batch) -> Result<(), Complaint> {
        let written = self.connection()?.transaction().and_then(|transaction| {
            write(&transaction, batch)?;
            transaction.commit()
        });
        written.map_err(|error| self.complaint(&error))
    }

    /// Deletes some of the results from before a time, s since 1970 UTC: all of a year at once would
    /// keep collectors and readers waiting.
    pub(super) fn forget(&mut self, before: u64) -> Result<(), Complaint> {
        const OLD: &str =
            "DELETE FROM result WHERE rowid IN (SELECT rowid FROM result WHERE at < ? LIMIT 10000)";
        let deleted = self.connection()?.execute(OLD, [before as i64]);
        deleted.map(drop).map_err(|error| self.complaint(&error))
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
    for received in &batch.rows {
        let mut row = json!(received.row);
        row["at"] = json!(received.at());
        row["received_unix_ms"] = json!(received.at_unix_ms);
        insert(transaction, "OR IGNORE INTO result", "", &row)?;
    }
    for gap in &batch.gaps {
        let newer = "ON CONFLICT DO UPDATE SET last = max(last, excluded.last)";
        insert(transaction, "INTO gap", newer, &json!(gap))?;
    }
    for head in &batch.heads {
        insert(transaction, "OR REPLACE INTO head", "", &json!(head))?;
    }
    Ok(())
}

/// Inserts an object whose keys are columns.
fn insert(
    transaction: &Transaction<'_>,
    into: &str,
    conflict: &str,
    row: &Value,
) -> rusqlite::Result<()> {
    let columns = row.as_object().into_iter().flatten();
    let (names, values): (Vec<_>, Vec<_>) =
        columns.map(|(name, value)| (&**name, cell(value))).unzip();
    let marks = vec!["?"; names.len()].join(", ");
    let names = names.join(", ");
    let sql = format!("INSERT {into} ({names}) VALUES ({marks}) {conflict}");
    transaction
        .prepare_cached(&sql)?
        .execute(params_from_iter(values))?;
    Ok(())
}

/// A value as SQLite has it; arrays are JSON.
fn cell(value: &Value) -> Sql {
    match value {
        Value::Null => Sql::Null,
        Value::String(text) => Sql::Text(text.clone()),
        Value::Number(number) => match (number.as_i64(), number.as_f64()) {
            (Some(whole), _) => Sql::Integer(whole),
            (None, real) => real.map_or(Sql::Null, Sql::Real),
        },
        other => Sql::Text(other.to_string()),
    }
}

#[cfg(test)]
mod tests {
    use super::super::Received;
    use super::*;
    use crate::answer::Row;

    #[test]
    fn results_from_before_a_time_are_deleted_and_no_others() {
        let folder = std::env::temp_dir().join(format!("fringed-fleet-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let mut store = Sqlite::of(folder.join("plant.db").to_str().unwrap());
        let rows = (1..=4).map(|seq| Received {
            row: Row {
                seq,
                at_unix_ms: (seq < 4).then_some(u64::from(seq) * 10_000_000),
                ..Row::default()
            },
            at_unix_ms: 39_999_000,
        });
        let batch = Batch {
            rows: rows.collect(),
            ..Batch::default()
        };
        store.write(&batch).unwrap();
        store.forget(20_000).unwrap();
        // One whose head has no time has that of the hour in which it was received.
        let left = store
            .lines("SELECT json_array(seq, at) FROM result ORDER BY seq")
            .unwrap();
        std::fs::remove_dir_all(&folder).unwrap();
        assert_eq!(left, "[2,20000]\n[3,30000]\n[4,39600]");
    }
}
