//! The record of changes: from which address what was changed and when, as JSON lines, of limited
//! size.

use serde::Serialize;
use serde_json::{Value, json};
use std::fs::{self, File, OpenOptions};
use std::io::{Read as _, Seek as _, SeekFrom, Write as _};
use std::net::IpAddr;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// When the file reaches this size it is renamed, and the file that had that name is deleted.
const FULL_BYTES: u64 = 512 << 10;
/// How much of the end of the file is read for the page.
const SHOWN_BYTES: u64 = 64 << 10;

/// One change, done or refused.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Change<'a> {
    /// Time of the change in µs since 1970 UTC; `None` if the clock is not synchronised.
    pub utc_us: Option<u64>,
    /// Time of the change in s since the start of the daemon.
    pub uptime_s: u32,
    /// BOOT_ID of that start.
    pub boot_id: u32,
    /// The client's address.
    pub from: IpAddr,
    /// What was done, e.g. `"edit recipe"`.
    pub action: &'a str,
    /// What was changed; never a secret.
    pub subject: &'a str,
    /// `"done"`, or why it was refused.
    pub outcome: &'a str,
    /// What was changed, in words, where that is known.
    pub changed: Option<&'a str>,
}

/// The file with the record.
#[derive(Debug)]
pub struct Changes {
    path: PathBuf,
    /// One writer at a time, so that lines stay whole.
    writing: Mutex<()>,
}

impl Changes {
    pub(super) fn open(path: &Path) -> Self {
        Self {
            path: path.to_path_buf(),
            writing: Mutex::default(),
        }
    }

    /// Adds a line and waits until it is stored.
    ///
    /// # Errors
    /// Whatever the file system answers.
    pub fn add(&self, change: &Change<'_>) -> std::io::Result<()> {
        let mut line = json!(change);
        line["boot_id"] = format!("{:08x}", change.boot_id).into();
        let _one = self.writing.lock().unwrap_or_else(PoisonError::into_inner);
        if fs::metadata(&self.path).is_ok_and(|file| file.len() >= FULL_BYTES) {
            fs::rename(&self.path, self.path.with_extension("previous.jsonl"))?;
        }
        let mut file = OpenOptions::new()
            .create(true)
            .read(true)
            .append(true)
            .open(&self.path)?;
        // A loss of power can leave an unfinished line, which this line must not continue.
        let begin = if ends_in_line(&mut file)? { "" } else { "\n" };
        file.write_all(format!("{begin}{line}\n").as_bytes())?;
        file.sync_data()
    }

    /// The latest changes, newest first. A line that was cut off by a loss of power is left out.
    ///
    /// # Errors
    /// Whatever the file system answers; a file that is not there is empty.
    pub fn latest(&self) -> std::io::Result<Vec<Value>> {
        let mut file = match File::open(&self.path) {
            Ok(file) => file,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(Vec::new()),
            Err(error) => return Err(error),
        };
        let size = file.metadata()?.len();
        file.seek(SeekFrom::Start(size.saturating_sub(SHOWN_BYTES)))?;
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes)?;
        let text = String::from_utf8_lossy(&bytes);
        let lines = text.lines().rev();
        Ok(lines
            .filter_map(|line| serde_json::from_str(line).ok())
            .collect())
    }
}

fn ends_in_line(file: &mut File) -> std::io::Result<bool> {
    if file.metadata()?.len() == 0 {
        return Ok(true);
    }
    let mut last = [0];
    file.seek(SeekFrom::End(-1))?;
    file.read_exact(&mut last)?;
    Ok(last == *b"\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn change(subject: &str) -> Change<'_> {
        Change {
            utc_us: Some(1),
            uptime_s: 7,
            boot_id: 0xB007,
            from: IpAddr::from([127, 0, 0, 1]),
            action: "edit recipe",
            subject,
            outcome: "done",
            changed: None,
        }
    }

    #[test]
    fn changes_are_read_back_newest_first_and_a_torn_line_is_left_out() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("changes.jsonl");
        let changes = Changes::open(&path);
        assert_eq!(changes.latest().unwrap(), Vec::<Value>::new());
        changes.add(&change("recipe 1")).unwrap();
        changes.add(&change("recipe 2 \"x\"\n{")).unwrap();
        OpenOptions::new()
            .append(true)
            .open(&path)
            .unwrap()
            .write_all(b"{\"utc_us\":")
            .unwrap();
        let latest = changes.latest().unwrap();
        assert_eq!(latest.len(), 2);
        assert_eq!(latest[0]["subject"], "recipe 2 \"x\"\n{");
        assert_eq!(latest[1]["from"], "127.0.0.1");
        assert_eq!(
            (&latest[1]["uptime_s"], &latest[1]["boot_id"]),
            (&json!(7), &json!("0000b007"))
        );
        changes.add(&change("recipe 3")).unwrap();
        assert_eq!(changes.latest().unwrap()[0]["subject"], "recipe 3");
    }

    #[test]
    fn the_record_stays_bounded_and_keeps_the_newest() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("changes.jsonl");
        let changes = Changes::open(&path);
        let long = "x".repeat(64 << 10);
        for _ in 0..40 {
            changes.add(&change(&long)).unwrap();
        }
        changes.add(&change("last")).unwrap();
        let sizes = fs::read_dir(folder.path())
            .unwrap()
            .map(|file| file.unwrap().metadata().unwrap().len());
        assert!(sizes.sum::<u64>() < 2 * FULL_BYTES + 2 * (64 << 10) + 1024);
        assert_eq!(changes.latest().unwrap()[0]["subject"], "last");
    }
}
