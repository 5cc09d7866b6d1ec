//! What a loss of power leaves of a folder: a run of the program is traced, and replayed up to any of its operations.
//!
//! [`trace`] reads the operations from a log of `strace`, [`disk`] knows which of them are on the medium for certain and which may
//! be lost.

pub mod disk;
pub mod trace;

#[cfg(test)]
mod tests;

use std::path::PathBuf;

/// One operation on files. Paths are relative to the folder that is looked at; times are in µs since 1970.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Operation {
    /// When it was asked for.
    pub asked: u64,
    /// When it had been done.
    pub done: u64,
    /// What it did.
    pub what: What,
}

/// What an operation does.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum What {
    /// Opens a file for writing: makes it where there is none, and empties it if `empty`.
    Open {
        /// The file.
        path: PathBuf,
        /// Whether what it held goes.
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
    /// Cuts a file off or makes it longer.
    Length {
        /// The file.
        path: PathBuf,
        /// Bytes.
        bytes: u64,
    },
    /// Syncs a file or a folder.
    Sync(PathBuf),
    /// Makes a folder.
    Folder(PathBuf),
    /// Gives a file a second name.
    Link {
        /// The first.
        from: PathBuf,
        /// The second.
        to: PathBuf,
    },
    /// Gives a file or folder another name, in place of what has it.
    Rename {
        /// The old one.
        from: PathBuf,
        /// The new one.
        to: PathBuf,
    },
    /// Removes the name of a file or an empty folder.
    Remove(PathBuf),
}
