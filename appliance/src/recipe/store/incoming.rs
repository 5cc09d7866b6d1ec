//! A recipe file that is being received: written beside the stored recipes under a temporary name,
//! checked, then renamed.
//!
//! Dropping it removes the file; files that a kill leaves behind are removed at the next start.

use crate::recipe::{Recipe, RecipeFile, Refusal, Store};
use crate::storage::folder::{check_room, rename_whole};
use std::fs::File;
use std::io::{BufReader, ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::{fs, io};

/// Prefix of the temporary names.
const PREFIX: &str = "arriving-";
/// The free storage is checked each time this many more bytes were written.
const STRETCH: u64 = 1 << 20;

/// A file that is being received.
#[derive(Debug)]
pub struct Incoming {
    path: PathBuf,
    file: File,
    bytes: u64,
}

impl Incoming {
    /// Begins a file of `expected` bytes in a folder; 0 if the size is not known.
    ///
    /// # Errors
    /// Errors of the file system, or that the file would leave less free storage than the station
    /// needs.
    pub fn begin(folder: &Path, expected: u64) -> io::Result<Self> {
        static COUNT: AtomicU64 = AtomicU64::new(0);
        loop {
            let count = COUNT.fetch_add(1, Ordering::Relaxed);
            let name = format!("{PREFIX}{}-{count}.new", std::process::id());
            let path = folder.join(name);
            let opened = File::options().write(true).create_new(true).open(&path);
            match opened {
                Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
                opened => {
                    let file = opened?;
                    let bytes = 0;
                    let incoming = Self { path, file, bytes };
                    check_room(&incoming.file, expected)?;
                    return Ok(incoming);
                }
            }
        }
    }
}

impl Store {
    /// Begins a recipe's file in its folder.
    ///
    /// # Errors
    /// As [`Incoming::begin`].
    pub fn receive(&self, expected: u64) -> io::Result<Incoming> {
        Incoming::begin(&self.folder, expected)
    }

    /// Stores a received file under a number; the old recipe stays as the previous generation. The
    /// caller holds the lock.
    pub(crate) fn put_received(&self, incoming: Incoming, number: u16) -> io::Result<()> {
        incoming.file.sync_all()?;
        self.keep_previous(number)?;
        rename_whole(&incoming.path, &self.path(number))
    }

    /// Removes the temporary files that a kill left behind.
    ///
    /// # Errors
    /// Errors of the file system.
    pub fn remove_left_behind(&self) -> io::Result<()> {
        // Another process may be importing at this moment.
        let _alone = self.lock()?;
        for entry in fs::read_dir(&self.folder)? {
            let entry = entry?;
            if entry.file_name().to_string_lossy().starts_with(PREFIX) {
                fs::remove_file(entry.path())?;
            }
        }
        Ok(())
    }
}

impl Incoming {
    /// Its temporary path.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Reads and checks the received recipe.
    ///
    /// # Errors
    /// In words: why it is not a usable recipe.
    pub fn recipe(&self) -> Result<Recipe, Refusal> {
        Recipe::read(BufReader::new(File::open(&self.path)?), self.bytes)
    }

    /// The recipe with its manifest, once it was checked.
    pub(crate) fn read(&self) -> Result<(RecipeFile, Recipe), Refusal> {
        Recipe::read_to_edit(BufReader::new(File::open(&self.path)?), self.bytes)
    }
}

impl Write for Incoming {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.file.write(bytes)?;
        let before = self.bytes;
        self.bytes += written as u64;
        if before / STRETCH < self.bytes / STRETCH {
            check_room(&self.file, 0)?;
        }
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

impl Drop for Incoming {
    fn drop(&mut self) {
        // Once it is stored there is nothing to remove; what cannot be removed now is removed at
        // the next start.
        let _ = fs::remove_file(&self.path);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_arrives_is_no_recipe_until_it_is_taken_and_leaves_nothing_behind() {
        let folder = tempfile::tempdir().unwrap();
        let store = Store::open(folder.path()).unwrap();
        let files = || fs::read_dir(folder.path()).unwrap().count();
        let mut incoming = store.receive(4).unwrap();
        incoming.write_all(b"none").unwrap();
        assert!(incoming.recipe().is_err());
        assert_eq!((store.numbers(), files()), (Vec::new(), 1));
        drop(incoming);
        assert_eq!(files(), 0);
        // A kill leaves it behind.
        std::mem::forget(store.receive(0).unwrap());
        assert_eq!(files(), 1);
        store.remove_left_behind().unwrap();
        let mut incoming = store.receive(4).unwrap();
        incoming.write_all(b"some").unwrap();
        store.put_received(incoming, 7).unwrap();
        assert_eq!(store.numbers(), [7]);
        // The lock's file beside it.
        assert_eq!(fs::read(store.path(7)).unwrap(), b"some");
        assert_eq!(files(), 2);
    }

    #[test]
    fn a_file_that_would_fill_the_storage_is_refused_before_it_comes() {
        let folder = tempfile::tempdir().unwrap();
        let store = Store::open(folder.path()).unwrap();
        let refused = store.receive(u64::MAX / 2).unwrap_err();
        assert_eq!(refused.kind(), ErrorKind::StorageFull);
        assert!(refused.to_string().contains("MiB are free"), "{refused}");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}
