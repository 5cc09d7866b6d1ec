//! The record of changes: who changed what and when, as JSON lines of limited size.
//!
//! Each line has a number and the hash of the line before; the last number and hash stand in the
//! file `result-seq` as well ([`super::chain`] checks both). The daemon and the command line append
//! under one lock, and a change is answered "done" when its line is on the card.

use super::backward::Backward;
use super::role::Role;
use super::users::ENGINEER;
use crate::station::Snapshot;
use crate::storage::folder::{rename_whole, sync_folder_of};
use crate::storage::state::{Counter, RecordEnd};
use crate::storage::{hex, quoted};
use crate::system::clock::utc;
use serde::de::IgnoredAny;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use sha2::{Digest, Sha256};
use std::collections::HashMap;
use std::fs::{self, File, OpenOptions};
use std::io::{self, ErrorKind, Write as _};
use std::net::IpAddr;
use std::os::unix::fs::FileExt as _;
use std::path::{Path, PathBuf};

/// The file in the folder `access`, and the one before it.
pub const FILES: [&str; 2] = ["changes.jsonl", "changes.previous.jsonl"];

/// The way by which a change came.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Way {
    /// The page or its API.
    Page,
    /// Modbus.
    Plc,
    /// A command.
    CommandLine,
}

/// One change, done or refused.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Change {
    /// Time of the change in µs since 1970 UTC; `None` if the clock is not synchronised.
    pub utc_us: Option<u64>,
    /// Time of the change in s since the start of the daemon.
    pub uptime_s: Option<u32>,
    /// BOOT_ID of that start, 8 hexadecimal digits.
    pub boot_id: Option<String>,
    /// The way by which it came.
    pub way: Way,
    /// The client's address, or the uid.
    pub from: String,
    /// The signed-in user.
    pub user: Option<String>,
    /// Its role then.
    pub role: Option<Role>,
    /// What was done, e.g. `"edit recipe"`.
    pub action: String,
    /// What was changed; never a secret.
    pub subject: String,
    /// `"done"`, or why it was refused.
    pub outcome: String,
    /// What was changed, in words, where that is known.
    pub changed: Option<String>,
    /// The number of the recipe that it is about.
    pub recipe: Option<u16>,
    /// The fingerprint of the version of it that came of the change.
    pub fingerprint: Option<String>,
}

impl Change {
    /// A change that came to the station by this way from an address, now.
    pub fn of_station(
        snapshot: &Snapshot,
        (way, from): (Way, IpAddr),
        action: &str,
        subject: String,
    ) -> Self {
        Self {
            uptime_s: Some(snapshot.uptime_s),
            boot_id: Some(format!("{:08x}", snapshot.boot_id)),
            way,
            from: from.to_string(),
            ..Self::of_command(action, subject)
        }
    }

    /// A change by the command line: the user of the system that runs it, now.
    pub fn of_command(action: &str, subject: String) -> Self {
        Self {
            utc_us: crate::system::clock::utc_us(),
            uptime_s: None,
            boot_id: None,
            way: Way::CommandLine,
            from: format!("uid {}", rustix::process::getuid().as_raw()),
            user: None,
            role: None,
            action: action.into(),
            recipe: recipe_of(&subject),
            subject,
            outcome: "done".into(),
            changed: None,
            fingerprint: None,
        }
    }
}

/// The number of the recipe that a subject such as `recipes/7/load` names.
pub fn recipe_of(subject: &str) -> Option<u16> {
    let number = subject.strip_prefix("recipes/")?.split('/').next()?;
    number.parse().ok()
}

/// A line of the record.
#[derive(Serialize)]
struct RecordLine<'a> {
    number: u32,
    /// The hash of the line before, 64 hexadecimal digits.
    previous: &'a str,
    /// In the first line of a file: the number of the oldest line that is kept.
    #[serde(skip_serializing_if = "Option::is_none")]
    first: Option<u32>,
    #[serde(flatten)]
    change: &'a Change,
}

/// Which lines are read.
#[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RecordFilter {
    /// Only of this user.
    pub user: Option<String>,
    /// Only about this recipe.
    pub recipe: Option<u16>,
    /// Only from this time on, µs since 1970 UTC.
    pub since_us: Option<u64>,
    /// Only before this time.
    pub until_us: Option<u64>,
    /// Only lines with a smaller number.
    pub before: Option<u32>,
    /// At most so many.
    pub limit: Option<usize>,
}

impl RecordFilter {
    fn passes(&self, line: &Value) -> bool {
        let at = line["utc_us"].as_u64();
        let number = |key: &str| line[key].as_u64();
        let is = |wanted: Option<u64>, found: Option<u64>| wanted.is_none_or(|w| found == Some(w));
        self.user.as_deref().is_none_or(|user| line["user"] == user)
            && is(self.recipe.map(u64::from), number("recipe"))
            && self.since_us.is_none_or(|since| at >= Some(since))
            && self
                .until_us
                .is_none_or(|until| at.is_some_and(|at| at < until))
            && self
                .before
                .is_none_or(|before| number("number").is_some_and(|n| n < u64::from(before)))
    }
}

/// The record of a device. Cheap to clone.
#[derive(Clone, Debug)]
pub struct ChangeRecord {
    folder: PathBuf,
    counter: Counter,
    /// The most bytes of both files.
    most: u64,
}

impl ChangeRecord {
    /// That of a state folder, at most `most` bytes; the oldest lines are dropped.
    pub fn of(state: &Path, most: u64) -> Self {
        Self {
            folder: state.join("access"),
            counter: Counter::of(state),
            most,
        }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }

    /// Keeps others from appending until the answer is dropped.
    ///
    /// # Errors
    /// Whatever the file system answers.
    pub fn lock(&self) -> io::Result<File> {
        fs::create_dir_all(&self.folder)?;
        let lock = File::create(self.path("lock"))?;
        lock.lock()?;
        Ok(lock)
    }

    /// The files as they are, with their lengths, the newer first; the caller holds the lock.
    ///
    /// # Errors
    /// Whatever the file system answers; a file that is not there is left out.
    pub fn files(&self) -> io::Result<Vec<(&'static str, File, u64)>> {
        let mut files = Vec::new();
        for name in FILES {
            match File::open(self.path(name)) {
                Err(error) if error.kind() == ErrorKind::NotFound => {}
                opened => {
                    let file = opened?;
                    let length = file.metadata()?.len();
                    files.push((name, file, length));
                }
            }
        }
        Ok(files)
    }

    /// Adds a line and waits until it is stored.
    ///
    /// # Errors
    /// Whatever the file system answers.
    pub fn add(&self, change: &Change) -> io::Result<()> {
        let _alone = self.lock()?;
        let [path, before] = FILES.map(|name| self.path(name));
        if fs::metadata(&path).is_ok_and(|file| file.len() >= self.most / 2) {
            rename_whole(&path, &before)?;
        }
        let is_new = !path.exists();
        let mut file = OpenOptions::new()
            .create(true)
            .read(true)
            .append(true)
            .open(&path)?;
        let said = self.counter.record_end().unwrap_or_default();
        self.drop_torn(&file, said.number)?;
        let begins = file.metadata()?.len() == 0;
        let written = self.last()?;
        // Where the card says more than the file has, lines were cut off: numbers go on behind them.
        let RecordEnd { number, hash } = match said.number > written.number {
            true => said,
            false => written,
        };
        let number = number.saturating_add(1);
        let line = RecordLine {
            number,
            previous: &hash,
            first: begins.then(|| self.first().ok().flatten().unwrap_or(number)),
            change,
        };
        let mut text = serde_json::to_string(&line)?;
        let hash = hash_of(text.as_bytes());
        text.push('\n');
        file.write_all(text.as_bytes())?;
        file.sync_data()?;
        if is_new {
            sync_folder_of(&path)?;
        }
        match self.counter.store_end(&RecordEnd { number, hash }) {
            // A damaged counter is put aside at the next start.
            Err(error) if error.kind() == ErrorKind::InvalidData => Ok(()),
            stored => stored,
        }
    }

    /// Cuts off a last line that has no end, or is torn and was never answered: `said` is the number of
    /// the last one that was.
    fn drop_torn(&self, file: &File, said: u32) -> io::Result<()> {
        let Some(line) = Backward::of(&self.path(FILES[0]))?.next().transpose()? else {
            return Ok(());
        };
        let before = self.backward()?.nth(1).transpose()?;
        let before = before.and_then(|line| number_of(&line)).unwrap_or(0);
        let length = file.metadata()?.len();
        let mut end = [0];
        file.read_exact_at(&mut end, length - 1)?;
        let ended = end == *b"\n";
        match ended && !(is_torn(&line) && said <= before) {
            true => Ok(()),
            false => file.set_len(length - line.len() as u64 - u64::from(ended)),
        }
    }

    /// The number and the hash of the last line; of a file of an older program the number is 0.
    fn last(&self) -> io::Result<RecordEnd> {
        let line = self.backward()?.next().transpose()?;
        Ok(line.map_or_else(RecordEnd::default, |line| RecordEnd {
            number: number_of(&line).unwrap_or(0),
            hash: hash_of(&line),
        }))
    }

    /// The number of the oldest line that is kept; the caller holds the lock.
    fn first(&self) -> io::Result<Option<u32>> {
        let mut first = None;
        for line in self.backward()? {
            match number_of(&line?) {
                Some(number) => first = Some(number),
                // Lines of an older program have none.
                None => break,
            }
        }
        Ok(first)
    }

    /// All lines, the newest first.
    pub(super) fn backward(&self) -> io::Result<impl Iterator<Item = io::Result<Vec<u8>>> + use<>> {
        let [newer, older] = FILES.map(|name| Backward::of(&self.path(name)));
        Ok(newer?.chain(older?))
    }

    /// Where the record ends as the file `result-seq` says.
    pub(super) fn said_end(&self) -> Option<RecordEnd> {
        self.counter.record_end()
    }

    /// Hands the lines that pass the filter to `take`, the newest first, until it answers `false`.
    /// A line that cannot be read is left out.
    ///
    /// # Errors
    /// Whatever the file system answers; a file that is not there is empty.
    pub fn each(
        &self,
        filter: &RecordFilter,
        mut take: impl FnMut(Value) -> bool,
    ) -> io::Result<()> {
        let mut left = filter.limit.unwrap_or(usize::MAX);
        for line in self.backward()? {
            let Ok(line) = serde_json::from_slice(&line?) else {
                continue;
            };
            if !filter.passes(&line) {
                continue;
            }
            if left == 0 || !take(line) {
                break;
            }
            left -= 1;
        }
        Ok(())
    }

    /// The lines that pass the filter, the newest first.
    ///
    /// # Errors
    /// As [`Self::each`].
    pub fn list(&self, filter: &RecordFilter) -> io::Result<Vec<Value>> {
        let mut lines = Vec::new();
        self.each(filter, |line| {
            lines.push(line);
            true
        })?;
        Ok(lines)
    }

    /// Who made the versions of recipes that the record knows, by their fingerprints.
    ///
    /// # Errors
    /// As [`Self::each`].
    pub fn makers(&self) -> io::Result<HashMap<String, String>> {
        let mut makers = HashMap::new();
        for line in self.backward()? {
            let line = line?;
            // Most lines make no version, and all of them need not be read as JSON.
            if contains(&line, b"\"fingerprint\":\"")
                && let Ok(line) = serde_json::from_slice::<Value>(&line)
                && let Some(fingerprint) = line["fingerprint"].as_str()
            {
                makers
                    .entry(fingerprint.to_owned())
                    .or_insert_with(|| author(&line));
            }
        }
        Ok(makers)
    }
}

/// Who made a change, in words.
pub fn author(line: &Value) -> String {
    let word = |key: &str| line[key].as_str().unwrap_or_default();
    match (word("user"), word("way")) {
        ("", "plc") => format!("PLC {}", word("from")),
        ("", _) => word("from").to_owned(),
        (ENGINEER, _) => ENGINEER.to_owned(),
        (user, _) => format!("{user} ({})", word("role")),
    }
}

/// The columns of the record as CSV (RFC 4180).
pub const CSV_COLUMNS: &str = "number,time_utc,boot_id,uptime_s,way,from,user,role,action,subject,outcome,changed,recipe,fingerprint\r\n";

/// A line of it.
pub fn csv_line(line: &Value) -> String {
    let keys = CSV_COLUMNS.trim_end().split(',');
    let cells = keys.map(|key| match (key, &line[key]) {
        ("time_utc", _) => line["utc_us"].as_u64().map(utc).unwrap_or_default(),
        (_, Value::Null) => String::new(),
        (_, Value::String(text)) => quoted(text).into_owned(),
        (_, other) => other.to_string(),
    });
    cells.collect::<Vec<_>>().join(",") + "\r\n"
}

fn contains(line: &[u8], text: &[u8]) -> bool {
    line.windows(text.len()).any(|window| window == text)
}

/// The number of a line, where it has one.
pub(super) fn number_of(line: &[u8]) -> Option<u32> {
    #[derive(Deserialize)]
    struct Numbered {
        number: u32,
    }
    let read = serde_json::from_slice(line).ok();
    read.map(|Numbered { number }| number)
}

/// The hash of a line without its end.
pub(super) fn hash_of(line: &[u8]) -> String {
    hex(&Sha256::digest(line))
}

/// Whether a line may be what a loss of power left: its end or sectors of it are missing.
pub(super) fn is_torn(line: &[u8]) -> bool {
    serde_json::from_slice::<IgnoredAny>(line).is_err()
}
