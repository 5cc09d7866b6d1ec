//! What a loss of power leaves of a folder: a run of the program is traced, and replayed up to any
//! of its operations.
//!
//! [`trace`] reads the operations from a log of `strace`; [`disk`] models which of them are
//! certainly on the medium and which may be lost; [`losses`] replays a run.

pub mod disk;
pub mod losses;
pub mod trace;

#[cfg(test)]
mod tests;

use std::path::PathBuf;

/// One operation on files. Paths are relative to the root folder; times are in µs since 1970.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Operation {
    /// When the call began.
    pub asked: u64,
    /// When the call returned.
    pub done: u64,
    /// What it did.
    pub what: What,
}

/// What an operation does.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum What {
    /// Opens a file for writing; creates it if it does not exist, and empties it if `empty`.
    Open {
        /// The file.
        path: PathBuf,
        /// Whether its content is removed.
        empty: bool,
    },
    /// Writes into a file, at its end if `at` is none.
    Write {
        /// The file.
        path: PathBuf,
        /// The place of the first byte.
        at: Option<u64>,
        /// The bytes.
        bytes: Vec<u8>,
    },
    /// Sets the length of a file.
    Length {
        /// The file.
        path: PathBuf,
        /// Its new length.
        bytes: u64,
    },
    /// Syncs a file or a folder.
    Sync(PathBuf),
    /// Syncs the whole file system.
    SyncAll,
    /// Creates a folder.
    Folder(PathBuf),
    /// Gives a file a second name.
    Link {
        /// The first.
        from: PathBuf,
        /// The second.
        to: PathBuf,
    },
    /// Renames a file or folder, replacing a file that has the new name.
    Rename {
        /// The old one.
        from: PathBuf,
        /// The new one.
        to: PathBuf,
    },
    /// Removes the name of a file or an empty folder.
    Remove(PathBuf),
}
