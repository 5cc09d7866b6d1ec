//! Files that a loss of power leaves whole, and a folder of them.

use crate::error::{Exit, Result};
use crate::station::FULL_STORAGE_MIB;
use rustix::fs::OFlags;
use std::fs;
use std::io::{self, Read as _, Write as _};
use std::os::unix::fs::OpenOptionsExt as _;
use std::path::{Path, PathBuf};

/// An output folder. Each file in it is whole at any time; an older one of the same name is
/// replaced.
#[derive(Debug)]
pub struct OutputFolder {
    path: PathBuf,
}

impl OutputFolder {
    /// Creates the folder and its parents where they do not exist.
    ///
    /// # Errors
    /// If it cannot be created (exit code 73).
    pub fn create(path: &Path) -> Result<Self> {
        let what = format!("create the output folder {}", path.display());
        let failed = Exit::CannotCreate.advising(what, "name one that can be written");
        fs::create_dir_all(path).map_err(failed)?;
        Ok(Self {
            path: path.to_path_buf(),
        })
    }

    /// Writes one file.
    ///
    /// # Errors
    /// If it cannot be written (exit code 73).
    pub fn write(&self, name: &str, bytes: &[u8]) -> Result<()> {
        let target = self.path.join(name);
        let what = format!("write {}", target.display());
        let failed = Exit::CannotCreate.advising(what, "free space or name another folder");
        write_whole(&target, bytes).map_err(failed)
    }

    /// Removes a file, and answers whether there was one.
    ///
    /// # Errors
    /// If it cannot be removed (exit code 73).
    pub fn remove(&self, name: &str) -> Result<bool> {
        let target = self.path.join(name);
        let what = format!(
            "remove {}, which is of another measurement",
            target.display()
        );
        let failed = Exit::CannotCreate.advising(what, "name another folder");
        remove(&target).map_err(failed)
    }
}

/// Removes a file; returns whether it existed.
///
/// # Errors
/// If it cannot be removed.
pub fn remove(file: &Path) -> io::Result<bool> {
    match fs::remove_file(file) {
        Ok(()) => Ok(true),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(false),
        Err(error) => Err(error),
    }
}

/// Writes a file so that a loss of power leaves the old one or the new one, whole: see
/// [`write_whole_with`].
///
/// # Errors
/// Whatever the file system answers.
pub fn write_whole(target: &Path, bytes: &[u8]) -> io::Result<()> {
    write_whole_with(target, |file| file.write_all(bytes))
}

/// Writes a file under a temporary name with `fill`, syncs it, renames it, and syncs the folder.
/// What cannot be finished is removed.
///
/// # Errors
/// Whatever `fill` or the file system answers; then the old file stands.
pub fn write_whole_with(
    target: &Path,
    fill: impl FnOnce(&mut fs::File) -> io::Result<()>,
) -> io::Result<()> {
    let temporary = temporary(target);
    let written = fs::File::create(&temporary)
        .and_then(|mut file| fill(&mut file).and_then(|()| file.sync_all()))
        .and_then(|()| rename_whole(&temporary, target));
    if written.is_err() {
        // There may be nothing to remove.
        let _ = fs::remove_file(&temporary);
    }
    written
}

/// Reads a file of the state folder whole. What is no file is refused at once: a pipe, a device or
/// a link to one would be read for ever. So is one of more than `most` bytes.
///
/// # Errors
/// Whatever the file system answers; `InvalidData` for what is refused.
pub fn read_whole(path: &Path, most: u64) -> io::Result<Vec<u8>> {
    let wrong = |words: String| io::Error::new(io::ErrorKind::InvalidData, words);
    // Opening a pipe would wait for its writer.
    let flags = OFlags::NONBLOCK.bits().cast_signed();
    let file = fs::OpenOptions::new()
        .read(true)
        .custom_flags(flags)
        .open(path)?;
    let about = file.metadata()?;
    if !about.is_file() {
        return Err(wrong("it is not a file".into()));
    }
    let mut bytes = Vec::new();
    if about.len() <= most {
        file.take(most + 1).read_to_end(&mut bytes)?;
    }
    match about.len().max(bytes.len() as u64) > most {
        true => Err(wrong(format!("it has more than {most} bytes"))),
        false => Ok(bytes),
    }
}

/// Copies a file: see [`write_whole_with`].
///
/// # Errors
/// Whatever the file system answers; then the old file stands.
pub fn copy_whole(file: &Path, target: &Path) -> io::Result<()> {
    let mut source = fs::File::open(file)?;
    write_whole_with(target, |copy| io::copy(&mut source, copy).map(drop))
}

/// The name under which a file is written.
fn temporary(target: &Path) -> PathBuf {
    let mut temporary = target.as_os_str().to_owned();
    temporary.push(".new");
    temporary.into()
}

/// Gives a synced file its name, and syncs the folder.
///
/// # Errors
/// Whatever the file system answers.
pub fn rename_whole(from: &Path, target: &Path) -> io::Result<()> {
    fs::rename(from, target)?;
    sync_folder_of(target)
}

/// Gives a file a second name (hard link), in place of whatever had it; the first one stays. A loss
/// of power leaves under the second name what was there before, or this file.
///
/// # Errors
/// Whatever the file system answers.
pub fn name_also(file: &Path, second: &Path) -> io::Result<()> {
    let temporary = temporary(second);
    // Left by a kill; there may be none.
    let _ = fs::remove_file(&temporary);
    let named = fs::hard_link(file, &temporary).and_then(|()| rename_whole(&temporary, second));
    // Two names of one file are not renamed, and a kill may have made this file the second one
    // already.
    let _ = fs::remove_file(&temporary);
    // Not every file system gives a file two names.
    named.or_else(|_| copy_whole(file, second))
}

/// Checks that `more` bytes beside this file leave as much free storage as the station needs.
///
/// # Errors
/// `StorageFull` if not, or whatever the file system answers.
pub fn check_room(file: &fs::File, more: u64) -> io::Result<()> {
    let storage = rustix::fs::fstatvfs(file)?;
    let free = storage.f_bavail.saturating_mul(storage.f_frsize);
    let needed = (FULL_STORAGE_MIB << 20).saturating_add(more);
    if free >= needed {
        return Ok(());
    }
    let mib = |bytes: u64| bytes.div_ceil(1 << 20);
    let words = format!("{} MiB are free, {} are needed", mib(free), mib(needed));
    Err(io::Error::new(io::ErrorKind::StorageFull, words))
}

/// Syncs the folder that a file lies in, so that its name is there after a loss of power, or gone.
///
/// # Errors
/// Whatever the file system answers.
pub fn sync_folder_of(file: &Path) -> io::Result<()> {
    let folder = file
        .parent()
        .filter(|folder| !folder.as_os_str().is_empty());
    fs::File::open(folder.unwrap_or(Path::new(".")))?.sync_all()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_never_ends_is_refused_at_once_and_a_file_is_read_whole() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        fs::write(path("file"), [7; 100]).unwrap();
        assert_eq!(read_whole(&path("file"), 100).unwrap(), [7; 100]);
        let (kind, mode) = (rustix::fs::FileType::Fifo, rustix::fs::Mode::RWXU);
        rustix::fs::mknodat(rustix::fs::CWD, path("pipe"), kind, mode, 0).unwrap();
        std::os::unix::fs::symlink("/dev/zero", path("endless")).unwrap();
        fs::create_dir(path("folder")).unwrap();
        for (name, most) in [("file", 99), ("pipe", 99), ("endless", 99), ("folder", 99)] {
            let error = read_whole(&path(name), most).unwrap_err();
            assert_eq!(error.kind(), io::ErrorKind::InvalidData, "{name}");
        }
        let none = read_whole(&path("none"), 1).unwrap_err();
        assert_eq!(none.kind(), io::ErrorKind::NotFound);
    }

    #[test]
    fn a_second_name_replaces_another_file_and_leaves_nothing_else_behind() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        fs::write(path("new"), "new").unwrap();
        fs::write(path("old"), "old").unwrap();
        fs::write(path("old.new"), "left by a kill").unwrap();
        // Again, as after a kill behind the first time.
        for _ in 0..2 {
            name_also(&path("new"), &path("old")).unwrap();
            assert_eq!(fs::read(path("old")).unwrap(), b"new");
            assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 2);
        }
        fs::remove_file(path("new")).unwrap();
        assert!(name_also(&path("new"), &path("old")).is_err());
        assert_eq!(fs::read(path("old")).unwrap(), b"new");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
