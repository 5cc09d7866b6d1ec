//! Makes a backup: a snapshot by hard links under the locks of those who write, then a ZIP that is
//! written piece by piece, its manifest last.

use super::{
    Backups, CALIBRATION, CONFIGURATION, COUNTER, DATABASE, FORMAT, MANIFEST, Manifest,
    MemberEntry, OF_HEAD, RECIPES, RECORDINGS, STUDIES, USERS,
};
use crate::access::ChangeRecord;
use crate::head::calibration::place::CalibrationPlace;
use crate::history::Reader;
use crate::recipe::Store;
use crate::storage::archive::stored;
use crate::storage::folder::{check_room, copy_whole, read_whole};
use crate::storage::hex;
use sha2::{Digest, Sha256};
use std::fs::{self, File};
use std::io::{self, ErrorKind, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};
use zip::ZipWriter;
use zip::result::ZipError;

/// The most members: a ZIP without 64-bit sizes has no more.
const MOST_MEMBERS: usize = 65_000;
/// The most bytes of all of them, for the same reason.
const MOST_BYTES: u64 = (4 << 30) - (64 << 20);
/// How often a calibration is read again that was replaced meanwhile.
const ATTEMPTS: usize = 5;
/// Bytes that are copied at a time.
const PIECE: usize = 256 << 10;
/// After each piece there is a rest of so many times the work on it, so that a cycle beside it has the
/// cores and the memory, but not longer than this: a slow client has made it wait already.
const REST: u32 = 8;
const LONGEST_REST: Duration = Duration::from_millis(20);

/// What a backup has beside recipes, calibration, history and record.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BackupContents {
    /// The users, with the hashes of their passwords.
    pub users: bool,
    /// The recordings of parts.
    pub recordings: bool,
}

/// What is said of a device in its backup.
#[derive(Clone, Debug)]
pub struct BackedUpDevice {
    /// Its serial.
    pub serial: String,
    /// Its configuration as it was read.
    pub configuration: String,
}

/// The content of a member.
#[derive(Debug)]
enum Content {
    /// A file of the snapshot.
    File(PathBuf),
    /// So many bytes of a file that grows.
    Begin(File, u64),
    /// In memory.
    Bytes(Vec<u8>),
}

/// A consistent snapshot of a device; dropping it removes its files.
#[derive(Debug)]
pub struct StateSnapshot {
    scratch: MakingFolder,
    members: Vec<(String, Content)>,
    manifest: Manifest,
}

/// A folder that is removed when this is dropped; what a kill leaves is removed at the next start.
#[derive(Debug)]
struct MakingFolder(PathBuf);

impl Drop for MakingFolder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

impl Backups {
    /// Takes a snapshot, beside a station that runs on.
    ///
    /// # Errors
    /// In words, with the remedy.
    pub fn snapshot(
        &self,
        device: &BackedUpDevice,
        wanted: BackupContents,
        record: &ChangeRecord,
    ) -> Result<StateSnapshot, String> {
        let failed = |error: io::Error| format!("back up: {error}: free space");
        self.taken(device, wanted, record).map_err(failed)
    }

    fn taken(
        &self,
        device: &BackedUpDevice,
        wanted: BackupContents,
        record: &ChangeRecord,
    ) -> io::Result<StateSnapshot> {
        static COUNT: AtomicU64 = AtomicU64::new(0);
        let count = COUNT.fetch_add(1, Ordering::Relaxed);
        let name = format!("making-{}-{count}", std::process::id());
        let scratch = MakingFolder(self.path(&name));
        fs::create_dir_all(&scratch.0)?;
        let mut snapshot = StateSnapshot {
            members: Vec::new(),
            manifest: Manifest {
                format: FORMAT.0.into(),
                version: FORMAT.1,
                versions: versions(),
                made_by: format!("fringed {}", crate::VERSION),
                made_at_unix_s: crate::system::clock::utc_us().map_or(0, |us| us / 1_000_000),
                serial: device.serial.clone(),
                members: Vec::new(),
            },
            scratch,
        };
        let state = &self.state;
        let history = Reader::of(state);
        if let Ok(found) = fs::metadata(history.path()) {
            let target = snapshot.scratch.0.join(DATABASE[0]);
            check_room(&File::open(&snapshot.scratch.0)?, found.len())?;
            history.copy(&target).map_err(io::Error::other)?;
            snapshot.add(DATABASE[0].into(), Content::File(target))?;
        }
        let recipes = Store::at(&state.join(RECIPES));
        if recipes.folder().exists() {
            // Every generation of every recipe is of one moment.
            let _alone = recipes.lock()?;
            snapshot.link_all(state, RECIPES, &|name| {
                let ending = name.split_once(".recipe").map(|(_, ending)| ending);
                matches!(ending, Some("" | ".previous" | ".kept"))
            })?;
        }
        snapshot.link_calibration(state)?;
        for name in &OF_HEAD[1..] {
            snapshot.link_all(state, name, &|name| !name.ends_with(".new"))?;
        }
        snapshot.link_all(state, STUDIES, &|name| name.ends_with(".json"))?;
        if wanted.users {
            snapshot.link_all(state, USERS, &|_| true)?;
        }
        if wanted.recordings {
            snapshot.link_recordings(state)?;
        }
        snapshot.add(
            CONFIGURATION.into(),
            Content::Bytes(device.configuration.clone().into_bytes()),
        )?;
        let alone = record.lock()?;
        for (name, file, length) in record.files()? {
            snapshot.add(format!("access/{name}"), Content::Begin(file, length))?;
        }
        // Behind the history, so that no result in it has a number that is not used.
        if let Ok(counter) = read_whole(&state.join(COUNTER), 4096) {
            snapshot.add(COUNTER.into(), Content::Bytes(counter))?;
        }
        drop(alone);
        Ok(snapshot)
    }
}

/// The versions of formats that this program writes.
fn versions() -> std::collections::BTreeMap<String, u32> {
    let of = |name: &str, version: u32| (name.to_owned(), version);
    [
        of("recipe", crate::recipe::file::VERSION),
        of("calibration", crate::head::calibration::file::VERSION),
        of("history", crate::history::schema::VERSION as u32),
    ]
    .into()
}

impl StateSnapshot {
    /// Adds a member.
    fn add(&mut self, name: String, content: Content) -> io::Result<()> {
        self.members.push((name, content));
        match self.members.len() > MOST_MEMBERS {
            true => Err(io::Error::other(format!(
                "it would have more than {MOST_MEMBERS} files: leave the recordings out"
            ))),
            false => Ok(()),
        }
    }

    /// Links a file, or the files of a folder and its folders whose names are wanted, into the
    /// snapshot. What is gone before it is linked is left out.
    fn link_all(
        &mut self,
        state: &Path,
        name: &str,
        wanted: &dyn Fn(&str) -> bool,
    ) -> io::Result<()> {
        let path = state.join(name);
        let target = self.scratch.0.join(name);
        match fs::symlink_metadata(&path) {
            Err(error) if error.kind() == ErrorKind::NotFound => Ok(()),
            Err(error) => Err(error),
            Ok(found) if found.is_dir() => {
                fs::create_dir_all(&target)?;
                let mut names: Vec<_> = fs::read_dir(&path)?
                    .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
                    .filter(|name| wanted(name))
                    .collect();
                names.sort();
                for inside in names {
                    self.link_all(state, &format!("{name}/{inside}"), &|_| true)?;
                }
                Ok(())
            }
            Ok(found) if found.is_file() => {
                target.parent().map_or(Ok(()), fs::create_dir_all)?;
                // Not every file system gives a file two names.
                let linked = fs::hard_link(&path, &target).or_else(|_| copy_whole(&path, &target));
                match linked {
                    Err(error) if error.kind() == ErrorKind::NotFound => Ok(()),
                    Err(error) => Err(error),
                    Ok(()) => self.add(name.to_owned(), Content::File(target)),
                }
            }
            Ok(_) => Ok(()),
        }
    }

    /// Links each recording that is whole: what is being written or removed has a dot in front.
    fn link_recordings(&mut self, state: &Path) -> io::Result<()> {
        for entry in fs::read_dir(state.join(RECORDINGS))
            .into_iter()
            .flatten()
            .flatten()
        {
            let name = format!("{RECORDINGS}/{}", entry.file_name().to_string_lossy());
            if name.contains("/.") {
                continue;
            }
            let before = self.members.len();
            self.link_all(state, &name, &|_| true)?;
            // One that was removed meanwhile may be there in part.
            if !entry.path().exists() {
                self.members.truncate(before);
            }
        }
        Ok(())
    }

    /// Links the calibration with its maps and the one before. They are not written under a lock, so
    /// what was linked is read, and linked again if it is not whole.
    fn link_calibration(&mut self, state: &Path) -> io::Result<()> {
        for _ in 0..ATTEMPTS {
            let before = self.members.len();
            self.link_all(state, OF_HEAD[0], &|name| !name.ends_with(".new"))?;
            let place = CalibrationPlace::at(&self.scratch.0.join(CALIBRATION));
            let whole = match place.load() {
                Ok(None) => true,
                Ok(Some(loaded)) => {
                    let beside = |map: &&str| place.path().with_file_name(map).exists();
                    loaded.file.maps().iter().all(beside)
                }
                // Nothing of it could be used before either.
                Err(_) => CalibrationPlace::at(&state.join(CALIBRATION))
                    .load()
                    .is_err(),
            };
            if whole {
                return Ok(());
            }
            self.members.truncate(before);
            fs::remove_dir_all(self.scratch.0.join(OF_HEAD[0]))?;
        }
        Err(io::Error::other(
            "the calibration is being changed: try again when the step has ended",
        ))
    }

    /// Writes the ZIP.
    ///
    /// # Errors
    /// Whatever reading and writing answer.
    pub fn write(mut self, to: impl Write) -> Result<(), ZipError> {
        let mut zip = ZipWriter::new_stream(to);
        let mut all = 0;
        for (name, content) in std::mem::take(&mut self.members) {
            zip.start_file(&*name, stored())?;
            let (bytes, sha256) = match content {
                Content::File(path) => copy(&mut File::open(path)?, &mut zip)?,
                Content::Begin(file, length) => copy(&mut file.take(length), &mut zip)?,
                Content::Bytes(bytes) => copy(&mut &bytes[..], &mut zip)?,
            };
            all += bytes;
            if all > MOST_BYTES {
                let words = "a backup has less than 4 GiB: leave the recordings out";
                return Err(io::Error::other(words).into());
            }
            self.manifest.members.push(MemberEntry {
                name,
                bytes,
                sha256,
            });
        }
        zip.start_file(MANIFEST, stored())?;
        let manifest = serde_json::to_vec(&self.manifest).map_err(io::Error::from)?;
        zip.write_all(&manifest)?;
        zip.finish().map(drop)
    }
}

/// Copies to the end, with rests; answers with the bytes and their hash.
pub(super) fn copy(from: &mut impl Read, to: &mut impl Write) -> io::Result<(u64, String)> {
    let mut hash = Sha256::new();
    let (mut bytes, mut piece) = (0, vec![0; PIECE]);
    loop {
        let begun = Instant::now();
        let read = from.read(&mut piece)?;
        if read == 0 {
            return Ok((bytes, hex(&hash.finalize())));
        }
        hash.update(&piece[..read]);
        to.write_all(&piece[..read])?;
        bytes += read as u64;
        if read == PIECE {
            std::thread::sleep((begun.elapsed() * REST).min(LONGEST_REST));
        }
    }
}
