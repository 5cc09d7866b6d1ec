//! The database's tables, how it is opened, and how a damaged one is set aside.

use super::HistoryError;
use rusqlite::{Connection, ErrorCode, OpenFlags};
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// SQLite's `application_id` of a history: "FRNG".
const APPLICATION: i64 = 0x4652_4E47;
/// The schema that this program writes, as SQLite's `user_version`.
pub const VERSION: i64 = 1;
/// Longest wait for another process that holds the database, the command line's for instance.
const BUSY: Duration = Duration::from_secs(2);

/// Longest wait for readers while nothing can be stored: most queries take some milliseconds, and half of a fast line's queue
/// is filled by then.
const READING: Duration = Duration::from_secs(1);
/// The log's file is not made shorter than this many bytes.
const LOG_KEPT: u64 = 1 << 20;

/// `docs/formats.md` has the columns in words.
const TABLES: &str = "
CREATE TABLE result (
    id INTEGER PRIMARY KEY,
    seq INTEGER NOT NULL,
    time_utc_us INTEGER,
    recipe INTEGER NOT NULL,
    fingerprint TEXT NOT NULL,
    part_id INTEGER NOT NULL,
    press_stroke INTEGER NOT NULL,
    token INTEGER NOT NULL,
    verdict INTEGER NOT NULL,
    error_code INTEGER NOT NULL,
    reason TEXT,
    flags INTEGER NOT NULL,
    valid_points INTEGER NOT NULL,
    coverage_permille INTEGER NOT NULL,
    temperature_c REAL,
    height_noise_mm REAL,
    fitness_permille INTEGER NOT NULL,
    exposure_us INTEGER NOT NULL,
    total_us INTEGER NOT NULL,
    stages TEXT NOT NULL,
    recording TEXT
);
CREATE INDEX result_seq ON result (seq);
CREATE INDEX result_recipe ON result (recipe, id);
CREATE INDEX result_time ON result (time_utc_us);
CREATE INDEX result_recording ON result (recording) WHERE recording IS NOT NULL;
CREATE TABLE gauge (
    result INTEGER NOT NULL REFERENCES result (id) ON DELETE CASCADE,
    place INTEGER NOT NULL,
    name TEXT NOT NULL,
    unit TEXT NOT NULL,
    value REAL,
    sigma REAL,
    low REAL,
    high REAL,
    decision INTEGER NOT NULL,
    PRIMARY KEY (result, place)
) WITHOUT ROWID;
";

/// Columns of `result` that came later; older databases get them when they are opened for writing.
const ADDED: [(&str, &str); 4] = [
    ("uptime_s", "INTEGER"),
    ("boot_id", "TEXT"),
    ("unkept", "TEXT"),
    ("placement", "TEXT"),
];
/// A table that came later as well: when a start of the daemon was, by the clock of a signed-in user's browser.
const STARTS: &str =
    "CREATE TABLE IF NOT EXISTS start (boot_id TEXT PRIMARY KEY, browser_utc_us INTEGER NOT NULL)";
/// What a reader sees of a result: also the time of its trigger by that clock, where nothing better is known of it.
const DATED: &str = "CREATE TEMP VIEW dated AS SELECT result.*, CASE WHEN time_utc_us IS NULL THEN
    (SELECT browser_utc_us FROM start WHERE start.boot_id = result.boot_id) + uptime_s * 1000000 END
    AS browser_utc_us FROM result";
/// The same of a database in which older programs have left that out.
const UNDATED: &str =
    "CREATE TEMP VIEW dated AS SELECT result.*, NULL AS browser_utc_us FROM result";

/// Opens the database for writing; makes it where there is none.
///
/// # Errors
/// [`HistoryError`]; `damaged` if the file is there and is no history of this version.
pub(super) fn open(path: &Path) -> Result<Connection, HistoryError> {
    let failed = |error: rusqlite::Error| HistoryError::of(path, &error);
    let mut connection = Connection::open(path).map_err(failed)?;
    settle(&connection).map_err(failed)?;
    let found = version(&connection).map_err(failed)?;
    match found {
        (APPLICATION, VERSION) => {}
        (0, 0) if is_empty(&connection).map_err(failed)? => {
            create(&mut connection).map_err(failed)?;
        }
        found => return Err(strange(path, found)),
    }
    complete(&connection).map_err(failed)?;
    Ok(connection)
}

fn complete(connection: &Connection) -> rusqlite::Result<()> {
    for (name, kind) in ADDED {
        let known = "SELECT count(*) > 0 FROM pragma_table_info('result') WHERE name = ?1";
        if !connection.query_row(known, [name], |row| row.get(0))? {
            connection.execute_batch(&format!("ALTER TABLE result ADD COLUMN {name} {kind}"))?;
        }
    }
    connection.execute_batch(STARTS)
}

/// Makes the view that readers read.
fn date(connection: &Connection) -> rusqlite::Result<()> {
    let known = "SELECT (SELECT count(*) FROM pragma_table_info('result') WHERE name IN ('uptime_s', 'boot_id')) = 2
        AND EXISTS (SELECT 1 FROM sqlite_schema WHERE name = 'start')";
    let known = connection.query_row(known, (), |row| row.get(0))?;
    connection.execute_batch(if known { DATED } else { UNDATED })
}

/// Opens the database for reading only.
///
/// # Errors
/// [`HistoryError`], also where there is none.
pub(super) fn open_read_only(path: &Path) -> Result<Connection, HistoryError> {
    let failed = |error: rusqlite::Error| HistoryError::of(path, &error);
    // Read and write for the log's shared index; the pragma below keeps the content as it is.
    let flags = OpenFlags::SQLITE_OPEN_READ_WRITE | OpenFlags::SQLITE_OPEN_NO_MUTEX;
    let connection = Connection::open_with_flags(path, flags)
        .or_else(|_| Connection::open_with_flags(path, OpenFlags::SQLITE_OPEN_READ_ONLY))
        .map_err(failed)?;
    connection.busy_timeout(BUSY).map_err(failed)?;
    let readable = || {
        let found = version(&connection)?;
        if found == (APPLICATION, VERSION) {
            connection.pragma_update(None, "temp_store", "memory")?;
            date(&connection)?;
        }
        connection.pragma_update(None, "query_only", true)?;
        Ok(found)
    };
    match readable().map_err(failed)? {
        (APPLICATION, VERSION) => Ok(connection),
        found => Err(strange(path, found)),
    }
}

fn settle(connection: &Connection) -> rusqlite::Result<()> {
    connection.busy_timeout(BUSY)?;
    // The answer is the mode that it got; a file system that cannot have a log works without.
    let _: String =
        connection.pragma_update_and_check(None, "journal_mode", "wal", |row| row.get(0))?;
    // A commit is handed to the system, not waited for: `syncing` brings it onto the card. The database stays whole
    // whenever the power goes, because the log is synced before it is brought into the database.
    connection.pragma_update(None, "synchronous", "normal")?;
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

/// Brings the log into the database, as far as no reader needs it, and syncs both.
///
/// Results are stored meanwhile, so that on a fast line there are always some more in the log than in the database, and it
/// would never begin anew. Where it is longer than `most` bytes after that, the rest is brought in while nothing is stored:
/// results wait in the queue for as long as the card takes for two syncs.
///
/// # Errors
/// [`HistoryError`].
pub(super) fn checkpoint(path: &Path, most: u64) -> Result<(), HistoryError> {
    let brought = || {
        let connection = Connection::open(path)?;
        settle(&connection)?;
        let bring = |how: &str| {
            let pragma = format!("PRAGMA wal_checkpoint({how})");
            connection.query_row(&pragma, (), |_| Ok(()))
        };
        bring("PASSIVE")?;
        begin_log(&connection)?;
        if log_bytes(path) <= most {
            return Ok(());
        }
        // It holds up whoever stores results, so it does not wait long for whoever reads them.
        connection.busy_timeout(READING)?;
        bring("RESTART")?;
        connection.busy_timeout(BUSY)?;
        begin_log(&connection)
    };
    brought().map_err(|error| HistoryError::of(path, &error))
}

/// Begins the log anew where all of it is in the database. That is the one write that SQLite syncs by itself, so it is done
/// before a result could have to wait for it.
pub(super) fn begin_log(connection: &Connection) -> rusqlite::Result<()> {
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
    transaction.execute_batch(TABLES)?;
    transaction.pragma_update(None, "application_id", APPLICATION)?;
    transaction.pragma_update(None, "user_version", VERSION)?;
    transaction.commit()
}

fn strange(path: &Path, (application, version): (i64, i64)) -> HistoryError {
    let reason = if application == APPLICATION {
        format!("version {version} is not this program's ({VERSION})")
    } else {
        "it is a database, but no history of fringed".into()
    };
    HistoryError {
        path: path.to_path_buf(),
        reason,
        damaged: true,
    }
}

/// Whether an error says that the file itself is damaged, so that trying again cannot help.
pub(super) fn means_damage(error: &rusqlite::Error) -> bool {
    let codes = [ErrorCode::DatabaseCorrupt, ErrorCode::NotADatabase];
    error
        .sqlite_error_code()
        .is_some_and(|code| codes.contains(&code))
}

/// Whether all pages of the database hang together; the first complaint if not.
pub(super) fn complaint(connection: &Connection) -> Option<String> {
    let check = connection.query_row("PRAGMA quick_check(1)", (), |row| row.get::<_, String>(0));
    match check {
        Ok(answer) if answer == "ok" => None,
        Ok(complaint) => Some(complaint),
        Err(error) => Some(error.to_string()),
    }
}

/// Renames a damaged database, with its log, so that a new one can be begun; answers with its new name. The one that
/// was set aside before goes.
///
/// # Errors
/// Whatever the file system answers.
pub(super) fn set_aside(path: &Path) -> std::io::Result<PathBuf> {
    let aside = path.with_extension("damaged.db");
    for suffix in ["-wal", "-shm"] {
        let (from, to) = (with_suffix(path, suffix), with_suffix(&aside, suffix));
        // Where there is no log, none of another database may stay beside the one that is set aside.
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
