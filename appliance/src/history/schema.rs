//! The database's tables, how it is opened, and how one that cannot be used is set aside.

use super::entry::{Entry, GaugeEntry};
use super::{HistoryError, HistoryResult};
use rusqlite::{Connection, ErrorCode, OpenFlags};
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// SQLite's `application_id` of a history: "FRNG".
const APPLICATION: i64 = 0x4652_4E47;
/// The schema that this program writes and reads, as SQLite's `user_version`.
pub const VERSION: i64 = 3;
/// Longest wait for another process that holds the database, the command line's for instance.
const BUSY: Duration = Duration::from_secs(2);

/// Longest wait for readers while nothing is stored: most queries take some milliseconds, and a
/// sixth of a fast line's queue is filled by then.
const READING: Duration = Duration::from_secs(1);
/// What a damaged database is called when it is set aside, between its stem and its extension.
pub(super) const DAMAGED: &str = "damaged";
/// The log's file is not made shorter than this many bytes.
const LOG_KEPT: u64 = 1 << 20;

/// The tables; `docs/formats.md` has the columns in words.
fn tables() -> String {
    let of = |columns: &[&str]| columns.join(",\n    ");
    format!(
        "
CREATE TABLE history (id TEXT NOT NULL);
{EARLIER};
INSERT INTO history VALUES (lower(hex(randomblob(16))));
CREATE TABLE result (
    id INTEGER PRIMARY KEY,
    {}
);
CREATE INDEX result_seq ON result (seq);
CREATE INDEX result_recipe ON result (recipe, id);
CREATE INDEX result_time ON result (time_utc_us);
CREATE INDEX result_recording ON result (recording) WHERE recording IS NOT NULL;
{REQUESTED};
CREATE TABLE gauge (
    result INTEGER NOT NULL REFERENCES result (id) ON DELETE CASCADE,
    place INTEGER NOT NULL,
    {},
    PRIMARY KEY (result, place)
) WITHOUT ROWID;
CREATE TABLE start (boot_id TEXT PRIMARY KEY, browser_utc_us INTEGER NOT NULL);
",
        of(Entry::COLUMNS),
        of(GaugeEntry::COLUMNS)
    )
}

/// Prepares a connection that reads only. Readers see of a result, where the clock was not
/// synchronised, also the time of its trigger by the clock of a signed-in user's browser.
const DATED: &str = "
PRAGMA temp_store = memory;
CREATE TEMP VIEW dated AS SELECT result.*, CASE WHEN time_utc_us IS NULL THEN
    (SELECT browser_utc_us FROM start WHERE start.boot_id = result.boot_id) + uptime_s * 1000000 END
    AS browser_utc_us FROM result;
PRAGMA query_only = true;
";

/// Opens the database for writing; creates it where the file does not exist.
///
/// # Errors
/// [`HistoryError`]; `aside` if the file is there and is not a history of this version.
pub(super) fn open(path: &Path) -> HistoryResult<Connection> {
    let failed = |error: rusqlite::Error| HistoryError::of(path, &error);
    let mut connection = Connection::open(path).map_err(failed)?;
    settle(&connection).map_err(failed)?;
    match version(&connection).map_err(failed)? {
        (APPLICATION, VERSION) => complete(&connection).map_err(failed)?,
        (0, 0) if is_empty(&connection).map_err(failed)? => {
            create(&mut connection).map_err(failed)?;
        }
        found => return Err(strange(path, found)),
    }
    Ok(connection)
}

/// Opens the database for reading only.
///
/// # Errors
/// [`HistoryError`], also where the file does not exist.
pub(super) fn open_read_only(path: &Path) -> HistoryResult<Connection> {
    let failed = |error: rusqlite::Error| HistoryError::of(path, &error);
    // Read and write for the log's shared index; `query_only` keeps the content as it is.
    let flags = OpenFlags::SQLITE_OPEN_READ_WRITE | OpenFlags::SQLITE_OPEN_NO_MUTEX;
    let connection = Connection::open_with_flags(path, flags)
        .or_else(|_| Connection::open_with_flags(path, OpenFlags::SQLITE_OPEN_READ_ONLY))
        .map_err(failed)?;
    connection.busy_timeout(BUSY).map_err(failed)?;
    refuse_other(&connection, path)?;
    connection.execute_batch(DATED).map_err(failed)?;
    Ok(connection)
}

/// Refuses what is not a history of this version.
///
/// # Errors
/// [`HistoryError`]
pub(super) fn refuse_other(connection: &Connection, path: &Path) -> HistoryResult<()> {
    let found = version(connection).map_err(|error| HistoryError::of(path, &error))?;
    match found {
        (APPLICATION, VERSION) => Ok(()),
        found => Err(strange(path, found)),
    }
}

fn settle(connection: &Connection) -> rusqlite::Result<()> {
    connection.busy_timeout(BUSY)?;
    // The answer is the mode that is used: a file system that cannot have a log works without.
    let _: String =
        connection.pragma_update_and_check(None, "journal_mode", "wal", |row| row.get(0))?;
    // Each commit is synced: what is stored is safe from a loss of power.
    connection.pragma_update(None, "synchronous", "full")?;
    // The log is brought into the database by `checkpoint`.
    connection.pragma_update(None, "wal_autocheckpoint", 0)?;
    connection.pragma_update(None, "foreign_keys", true)?;
    connection.pragma_update(None, "journal_size_limit", LOG_KEPT)?;
    // Negative: KiB.
    connection.pragma_update(None, "cache_size", -1024)
}

/// The write-ahead log of a database.
pub(super) fn log_of(path: &Path) -> PathBuf {
    with_suffix(path, "-wal")
}

/// The bytes of the log of a database; 0 without one.
pub(super) fn log_bytes(path: &Path) -> u64 {
    fs::metadata(log_of(path)).map_or(0, |found| found.len())
}

/// Brings the log into the database, syncs both, and begins the log anew. Where a reader still
/// needs it after [`READING`] the log stays as it is.
///
/// # Errors
/// Whatever SQLite answers.
pub(super) fn checkpoint(connection: &Connection) -> rusqlite::Result<()> {
    connection.busy_timeout(READING)?;
    let restart = "PRAGMA wal_checkpoint(RESTART)";
    let blocked = connection.query_row(restart, (), |row| row.get(0));
    connection.busy_timeout(BUSY)?;
    if blocked? {
        return Ok(());
    }
    // The log begins anew, and gets shorter, with the next write.
    connection.pragma_update(None, "user_version", VERSION)
}

fn version(connection: &Connection) -> rusqlite::Result<(i64, i64)> {
    let number = |name| connection.pragma_query_value(None, name, |row| row.get(0));
    Ok((number("application_id")?, number("user_version")?))
}

fn is_empty(connection: &Connection) -> rusqlite::Result<bool> {
    let tables = "SELECT count(*) = 0 FROM sqlite_schema";
    connection.query_row(tables, (), |row| row.get(0))
}

fn create(connection: &mut Connection) -> rusqlite::Result<()> {
    let transaction = connection.transaction()?;
    transaction.execute_batch(&tables())?;
    transaction.pragma_update(None, "application_id", APPLICATION)?;
    transaction.pragma_update(None, "user_version", VERSION)?;
    transaction.commit()
}

/// Finds results by the token of a request.
const REQUESTED: &str =
    "CREATE INDEX IF NOT EXISTS result_request ON result (request) WHERE request IS NOT NULL";

/// The ids that the history had before, each with the last SEQ under it.
const EARLIER: &str =
    "CREATE TABLE IF NOT EXISTS earlier (id TEXT NOT NULL, last INTEGER NOT NULL)";

/// Adds the columns and the table that a history of this version lacks which was begun before they were thought of.
fn complete(connection: &Connection) -> rusqlite::Result<()> {
    for column in ["light", "request"] {
        if connection
            .prepare(&format!("SELECT {column} FROM result"))
            .is_err()
        {
            let add = format!("ALTER TABLE result ADD COLUMN {column} TEXT");
            connection.execute_batch(&add)?;
        }
    }
    connection.execute_batch(REQUESTED)?;
    connection.execute_batch(EARLIER)
}

fn strange(path: &Path, (application, version): (i64, i64)) -> HistoryError {
    let (reason, aside) = if application == APPLICATION {
        (
            format!(
                "it has version {version}, this program reads {VERSION}: the station sets it aside when it starts"
            ),
            format!("version-{version}"),
        )
    } else {
        (
            "it is a database, but no history of fringed".into(),
            DAMAGED.into(),
        )
    };
    HistoryError {
        path: path.to_path_buf(),
        reason,
        aside: Some(aside),
    }
}

/// What SQLite says where a table or a column is gone.
const OTHER_TABLES: [&str; 3] = ["no such table", "no such column", "has no column named"];

/// Whether an error says that the file itself is damaged, so that trying again cannot help.
pub(super) fn means_damage(error: &rusqlite::Error) -> bool {
    let codes = [ErrorCode::DatabaseCorrupt, ErrorCode::NotADatabase];
    let words = error.to_string();
    let code = error.sqlite_error_code();
    code.is_some_and(|code| codes.contains(&code))
        || OTHER_TABLES.iter().any(|other| words.contains(other))
}

/// Asks for every column that this program writes.
fn all_columns(connection: &Connection) -> rusqlite::Result<()> {
    let tables = [("result", Entry::COLUMNS), ("gauge", GaugeEntry::COLUMNS)];
    for (table, columns) in tables {
        let names = columns.iter().filter_map(|column| column.split(' ').next());
        let names: Vec<&str> = names.collect();
        connection.prepare(&format!("SELECT {} FROM {table}", names.join(", ")))?;
    }
    connection.prepare("SELECT id FROM history")?;
    connection.prepare("SELECT boot_id, browser_utc_us FROM start")?;
    Ok(())
}

/// What SQLite's check of the database finds wrong first, or which table or column is missing.
pub(super) fn complaint(connection: &Connection) -> Option<String> {
    let check = connection.query_row("PRAGMA quick_check(1)", (), |row| row.get::<_, String>(0));
    match check {
        Ok(answer) if answer == "ok" => {
            all_columns(connection).err().map(|error| error.to_string())
        }
        Ok(complaint) => Some(complaint),
        Err(error) => Some(error.to_string()),
    }
}

/// Renames a database that cannot be used, with its log, so that a new one can be begun; answers
/// with its new name, which is made of `name`. Of damaged ones the last is kept, of others all.
///
/// # Errors
/// Whatever the file system answers.
pub(super) fn set_aside(path: &Path, name: &str) -> std::io::Result<PathBuf> {
    let mut aside = path.with_extension(format!("{name}.db"));
    let mut number = 1;
    while name != DAMAGED && aside.exists() {
        number += 1;
        aside = path.with_extension(format!("{name}-{number}.db"));
    }
    for suffix in ["-wal", "-shm"] {
        let (from, to) = (with_suffix(path, suffix), with_suffix(&aside, suffix));
        // Without a log of its own the database must not get that of the one that was set aside
        // before.
        if fs::rename(&from, &to).is_err() {
            let _ = fs::remove_file(&to);
        }
    }
    fs::rename(path, &aside)?;
    Ok(aside)
}

fn with_suffix(path: &Path, suffix: &str) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(suffix);
    name.into()
}
