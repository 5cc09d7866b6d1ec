//! The state folder: its lock, the result counter and the device's serial.

use crate::error::{Exit, Failure, Result};
use crate::storage::folder::{read_whole, write_whole};
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::ErrorKind;
use std::os::unix::fs::FileExt as _;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

/// The folder that outlives a restart. One daemon at a time holds it.
#[derive(Debug)]
pub struct StateFolder {
    path: PathBuf,
    /// Held until the daemon ends; the system releases it with the process, also by a kill.
    _lock: File,
}

/// The counter's file: the last SEQ that may be in use, in decimal, the run that wrote it, in
/// hexadecimal, and where the record of changes ends.
const COUNTER: &str = "result-seq";
/// The serial's file.
pub const SERIAL: &str = "serial";
/// Longest of these files, bytes.
const MOST: u64 = 4096;

impl StateFolder {
    /// The platform's state folder for this program.
    ///
    /// # Errors
    /// If the platform has none, e.g. without a home directory.
    pub fn default_path() -> Result<PathBuf> {
        dirs::state_dir()
            .or_else(dirs::data_local_dir)
            .map(|folder| folder.join("fringed"))
            .ok_or_else(|| {
                Failure::new(
                    Exit::CannotCreate,
                    "find the state folder: this user has no home directory; name one with --state",
                )
            })
    }

    /// Opens the folder, creating it where it does not exist, and takes it for this process.
    ///
    /// # Errors
    /// If it cannot be created or written, or another daemon holds it (exit code 73).
    pub fn open(path: &Path) -> Result<Self> {
        let remedy = "another fringed uses it: end that one or name another folder with --state";
        Self::open_unless_held(path, (Exit::CannotCreate, remedy))
    }

    /// As [`StateFolder::open`], for a command that changes what a running station uses; `instead`
    /// says how it is done while the station runs.
    ///
    /// # Errors
    /// If it cannot be created or written (exit code 73), or a station uses it (exit code `used`).
    pub fn open_unless_used(path: &Path, used: Exit, instead: &str) -> Result<Self> {
        let remedy = format!("a station uses it: {instead}, or end the station first");
        Self::open_unless_held(path, (used, &remedy))
    }

    fn open_unless_held(path: &Path, (held, remedy): (Exit, &str)) -> Result<Self> {
        let refused = |exit, error: String| {
            let what = format!("open the state folder {}", path.display());
            Failure::because(exit, what, error)
        };
        let cannot = |error: std::io::Error| {
            let words = format!("{error}: name one that can be written with --state");
            refused(Exit::CannotCreate, words)
        };
        fs::create_dir_all(path).map_err(cannot)?;
        let lock = File::create(path.join("lock")).map_err(cannot)?;
        match lock.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => return Err(refused(held, remedy.into())),
            Err(TryLockError::Error(error)) => return Err(cannot(error)),
        }
        Ok(Self {
            path: path.to_path_buf(),
            _lock: lock,
        })
    }

    /// Whether a station uses a folder.
    pub fn is_used(path: &Path) -> bool {
        let lock = File::open(path.join("lock"));
        lock.is_ok_and(|lock| matches!(lock.try_lock_shared(), Err(TryLockError::WouldBlock)))
    }

    /// The folder.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// What the counter's file says; 0 without a file.
    ///
    /// # Errors
    /// It cannot be read or is damaged. Guessing would let a SEQ be used twice.
    pub fn counted(&self) -> Result<Counted, CounterError> {
        Counted::in_folder(&self.path)
    }

    /// A writer of the counter.
    pub fn counter(&self) -> Counter {
        Counter::of(&self.path)
    }

    /// The serial in a folder, which a station may use; `None` before its first start.
    pub fn serial_in(folder: &Path) -> Option<String> {
        let serial = read_whole(&folder.join(SERIAL), MOST).ok()?;
        let serial = String::from_utf8(serial).ok()?.trim().to_owned();
        (!serial.is_empty()).then_some(serial)
    }

    /// The device's serial, made at the first start.
    ///
    /// # Errors
    /// If it can neither be read nor written.
    pub fn serial(&self) -> Result<String> {
        if let Some(serial) = Self::serial_in(&self.path) {
            return Ok(serial);
        }
        let file = self.path.join(SERIAL);
        let serial = format!("{:08X}", random()?);
        write_whole(&file, format!("{serial}\n").as_bytes())
            .map_err(Exit::CannotCreate.because(format!("write {}", file.display())))?;
        Ok(serial)
    }
}

/// Why it is not known which SEQs may be in use.
#[derive(Debug, thiserror::Error)]
pub enum CounterError {
    /// The counter's file cannot be read.
    #[error("read {}: {source}", file.display())]
    Read {
        /// The file.
        file: PathBuf,
        /// What the file system answers.
        source: std::io::Error,
    },
    /// The counter's file holds something else.
    #[error("read {}: {begin:?} is no number", file.display())]
    Damaged {
        /// The file.
        file: PathBuf,
        /// How its content begins.
        begin: String,
    },
}

/// The last SEQ that may be in use, and which run of the daemon wrote it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counted {
    /// The SEQ.
    pub last: u32,
    /// Random per start; 0 where a person wrote the number.
    pub run: u32,
    /// The SEQ that was acknowledged last in BUFFERED mode; `None` outside of it.
    pub buffered: Option<u32>,
    /// Whether the file is a copy, as a restored backup is: it was made at another time than it
    /// says. A file system that does not know when a file was made copies unseen.
    pub copied: bool,
}

impl Counted {
    /// What the counter's file of a folder says; see [`StateFolder::counted`].
    ///
    /// # Errors
    /// As there.
    pub fn in_folder(folder: &Path) -> Result<Self, CounterError> {
        let file = folder.join(COUNTER);
        let bytes = match read_whole(&file, MOST) {
            Ok(bytes) => bytes,
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(Self::default()),
            Err(source) => return Err(CounterError::Read { file, source }),
        };
        let text = String::from_utf8_lossy(&bytes);
        let made = File::open(&file).map_or(0, |file| made(&file));
        Self::read(&text, made).ok_or_else(|| {
            let begin = text.trim().chars().take(40).collect();
            CounterError::Damaged { file, begin }
        })
    }

    /// Reads the content of the counter's file, which was made at `made`: ns since 1970,
    /// 0 where that is not known.
    pub fn read(text: &str, made: u64) -> Option<Self> {
        let mut words = text.split_whitespace();
        let last = words.next()?.parse().ok()?;
        let hex = |word: &str| u64::from_str_radix(word, 16).ok();
        let run = words.next().map(|word| hex(word)?.try_into().ok());
        let said = words.next().map(hex).unwrap_or(Some(0))?;
        let buffered = match words.next() {
            None | Some("-") => None,
            Some(seq) => Some(seq.parse().ok()?),
        };
        let rest = words.next();
        let ends = rest.is_none() || RecordEnd::read(text).is_some();
        ends.then_some(Self {
            last,
            run: run.unwrap_or(Some(0))?,
            buffered,
            copied: said != 0 && made != 0 && said != made,
        })
    }

    /// What a counter's file that was made at `made` begins with. Its length is always the same, so
    /// that overwriting it needs no room.
    pub fn text(self, made: u64) -> String {
        let buffered = self.buffered.map_or("-".into(), |seq| seq.to_string());
        let Self { last, run, .. } = self;
        format!("{last:010} {run:08x} {made:016x} {buffered:>10}")
    }
}

/// Bytes of [`Counted::text`].
const COUNTED: usize = 47;

/// Where the record of changes ends, as the counter's file says.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RecordEnd {
    /// The number of the last line; 0 if there is none.
    pub number: u32,
    /// Its SHA-256, 64 hexadecimal digits.
    pub hash: String,
}

impl RecordEnd {
    /// Reads the fifth and sixth word of the counter's file.
    fn read(text: &str) -> Option<Self> {
        let mut words = text.split_whitespace().skip(4);
        let (number, hash) = (words.next()?.parse().ok()?, words.next()?);
        let is_hash = hash.len() == 64 && hash.bytes().all(|byte| byte.is_ascii_hexdigit());
        (is_hash && words.next().is_none()).then(|| Self {
            number,
            hash: hash.to_owned(),
        })
    }

    /// What follows [`Counted::text`], always as long.
    fn text(&self) -> String {
        format!(" {:010} {}\n", self.number, self.hash)
    }
}

/// When a file was made, ns since 1970; 0 where its file system does not know.
fn made(file: &File) -> u64 {
    let created = file.metadata().and_then(|file| file.created()).ok();
    let since = created.and_then(|at| at.duration_since(SystemTime::UNIX_EPOCH).ok());
    since.map_or(0, |since| since.as_nanos() as u64)
}

/// Stores which SEQs may be in use before their results are shown, so that none is used twice.
#[derive(Clone, Debug)]
pub struct Counter {
    file: PathBuf,
}

impl Counter {
    /// That of a state folder.
    pub fn of(state: &Path) -> Self {
        Self {
            file: state.join(COUNTER),
        }
    }

    /// Puts a file that cannot be used beside the one that is written next.
    pub fn put_aside(&self) {
        // Where it cannot be renamed it is replaced.
        let _ = fs::rename(&self.file, self.file.with_extension("damaged"));
    }

    /// Stores that SEQs up to this one may be in use. It is written in place, within one sector: it
    /// needs no room on a full card, and a loss of power leaves the old numbers or the new ones.
    ///
    /// # Errors
    /// Whatever the file system answers.
    pub fn store(&self, counted: Counted) -> std::io::Result<()> {
        let file = match self.open()? {
            Some(file) => file,
            // The first time, or a file that a person wrote.
            None => {
                let end = self.record_end().map_or("\n".into(), |end| end.text());
                write_whole(&self.file, (counted.text(0) + &end).as_bytes())?;
                OpenOptions::new().write(true).open(&self.file)?
            }
        };
        file.write_all_at(counted.text(made(&file)).as_bytes(), 0)?;
        file.sync_data()
    }

    /// Where the record of changes ends; `None` where the file does not say so.
    pub fn record_end(&self) -> Option<RecordEnd> {
        let bytes = read_whole(&self.file, MOST).ok()?;
        RecordEnd::read(&String::from_utf8_lossy(&bytes))
    }

    /// Stores where the record of changes ends, beside the numbers of results, which stay as they
    /// are: both are written in place by different threads or processes.
    ///
    /// # Errors
    /// Whatever the file system answers; `InvalidData` if the file is damaged.
    pub fn store_end(&self, end: &RecordEnd) -> std::io::Result<()> {
        let file = match self.open()? {
            Some(file) => file,
            None => {
                let text = match read_whole(&self.file, MOST) {
                    Err(error) if error.kind() == ErrorKind::NotFound => b"0".to_vec(),
                    read => read?,
                };
                let counted = Counted::read(&String::from_utf8_lossy(&text), 0);
                self.store(counted.ok_or(ErrorKind::InvalidData)?)?;
                OpenOptions::new().write(true).open(&self.file)?
            }
        };
        file.write_all_at(end.text().as_bytes(), COUNTED as u64)?;
        file.sync_data()
    }

    /// The file, to be written in place; `None` if it is not there or has another length.
    fn open(&self) -> std::io::Result<Option<File>> {
        let Ok(file) = OpenOptions::new().write(true).open(&self.file) else {
            return Ok(None);
        };
        let length = file.metadata()?.len() as usize;
        let lengths = [
            COUNTED + 1,
            COUNTED + RecordEnd::default().text().len() + 64,
        ];
        Ok(lengths.contains(&length).then_some(file))
    }
}

/// 32 random bits from the system.
///
/// # Errors
/// If the system gives none.
pub fn random() -> Result<u32> {
    getrandom::u32().map_err(Exit::Software.because("ask the system for random bits"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_counter_and_the_serial_outlive_a_restart() {
        let folder = tempfile::tempdir().unwrap();
        let first = StateFolder::open(folder.path()).unwrap();
        assert_eq!(first.counted().unwrap(), Counted::default());
        let counted = Counted {
            last: 41,
            run: 7,
            buffered: Some(40),
            copied: false,
        };
        first.counter().store(counted).unwrap();
        let serial = first.serial().unwrap();
        drop(first);
        let second = StateFolder::open(folder.path()).unwrap();
        assert_eq!(second.counted().unwrap(), counted);
        assert_eq!(second.serial().unwrap(), serial);
    }

    #[test]
    fn a_copy_of_the_counter_is_known_as_one_and_a_folder_that_was_renamed_is_not() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let state = StateFolder::open(&at("first")).unwrap();
        let counted = Counted {
            last: 9,
            run: 3,
            ..Counted::default()
        };
        state.counter().store(counted).unwrap();
        drop(state);
        fs::rename(at("first"), at("moved")).unwrap();
        let moved = StateFolder::open(&at("moved")).unwrap();
        assert_eq!(moved.counted().unwrap(), counted);
        fs::create_dir(at("copied")).unwrap();
        fs::copy(at("moved").join(COUNTER), at("copied").join(COUNTER)).unwrap();
        let copied = StateFolder::open(&at("copied")).unwrap();
        let found = copied.counted().unwrap();
        let is_known = made(&File::open(at("copied").join(COUNTER)).unwrap()) != 0;
        assert_eq!((found.last, found.copied), (9, is_known));
        // From then on it is its own.
        copied.counter().store(found).unwrap();
        assert!(!copied.counted().unwrap().copied);
    }

    #[test]
    fn one_daemon_at_a_time_holds_the_folder() {
        let folder = tempfile::tempdir().unwrap();
        let _first = StateFolder::open(folder.path()).unwrap();
        let refused = StateFolder::open(folder.path()).unwrap_err();
        assert_eq!(refused.exit, Exit::CannotCreate);
        assert!(refused.to_string().contains("another fringed"), "{refused}");
    }

    #[test]
    fn a_damaged_counter_is_not_guessed() {
        let folder = tempfile::tempdir().unwrap();
        let state = StateFolder::open(folder.path()).unwrap();
        for damaged in ["4x", "", "4 y", "4 5 6 7 8", "-4", "4294967296"] {
            fs::write(folder.path().join(COUNTER), damaged).unwrap();
            let refused = state.counted().unwrap_err().to_string();
            assert!(refused.contains("result-seq"), "{damaged}");
        }
        fs::write(folder.path().join(COUNTER), "4\n").unwrap();
        let by_hand = Counted {
            last: 4,
            ..Counted::default()
        };
        assert_eq!(state.counted().unwrap(), by_hand);
    }
}
