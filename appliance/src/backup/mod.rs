//! Backups: everything that a device has learned in one ZIP, and the way back.
//!
//! A backup is a consistent snapshot ([`making`]): the station runs on while it is made. One that
//! comes back is checked as a whole beside the state ([`checking`]), and a person is shown what would
//! be replaced ([`plan`]). At the next start it is exchanged by renames ([`exchange`]); the state
//! before is kept once.
//!
//! ```text
//! state folder ──► restore/making-N/ ──► ZIP                             snapshot, members, manifest last
//! ZIP ──► restore/arriving-N.zip ──► restore/staged/ + checked.json      checked, nothing is touched
//!                                    order.json ──next start──► done.json, restore/before/
//! ```
//!
//! What belongs to a device alone stays on it: its secret, the record of changes, its result numbers,
//! and its serial unless it replaces the device of the backup.

pub mod checking;
pub mod exchange;
pub mod making;
pub mod plan;

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// The folder in the state folder that backups leave out.
const FOLDER: &str = "restore";
/// The member that names all others.
pub const MANIFEST: &str = "manifest.json";
/// The manifest's `format` and `version`.
const FORMAT: (&str, u32) = ("fringed-backup", 1);
/// Members of the configuration and of the numbers of results, which stay the device's.
pub const CONFIGURATION: &str = "fringed.toml";
const COUNTER: &str = "result-seq";
/// The database, and the files that SQLite puts beside it.
const DATABASE: [&str; 3] = ["history.db", "history.db-wal", "history.db-shm"];
const USERS: &str = "access/users.json";
const CALIBRATION: &str = "calibration/calibration.json";
/// Whose names are in [`Manifest::serial`].
const LONGEST_SERIAL: usize = 32;

/// What is in a backup: `manifest.json`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    /// `fringed-backup`.
    pub format: String,
    /// 1.
    pub version: u32,
    /// The versions of the formats of its members, for people.
    pub versions: BTreeMap<String, u32>,
    /// The program.
    pub made_by: String,
    /// When, s since 1970 UTC; 0 if the clock was not synchronised.
    pub made_at_unix_s: u64,
    /// The serial of the device.
    pub serial: String,
    /// All other members.
    pub members: Vec<MemberEntry>,
}

/// A member of a backup.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MemberEntry {
    /// Its name in the ZIP and in the state folder.
    pub name: String,
    /// Its size.
    pub bytes: u64,
    /// SHA-256, 64 hexadecimal digits.
    pub sha256: String,
}

/// What comes back.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum RestorePart {
    /// Everything.
    Everything,
    /// The recipes alone.
    Recipes,
    /// The calibration of the head alone, with what commissioning keeps of it.
    Calibration,
    /// The state before the last restore.
    Undo,
}

impl RestorePart {
    /// Its name.
    pub fn word(self) -> &'static str {
        match self {
            Self::Everything => "everything",
            Self::Recipes => "recipes",
            Self::Calibration => "calibration",
            Self::Undo => "undo",
        }
    }
}

/// Folders and files of the state of a head, in the order in which they are exchanged.
const OF_HEAD: [&str; 4] = [
    "calibration",
    "commissioning.json",
    "commissioning",
    "drift.json",
];
const RECIPES: &str = "recipes";
const RECORDINGS: &str = "recordings";
const STUDIES: &str = "studies";

/// The backups of a device. Cheap to clone.
#[derive(Clone, Debug)]
pub struct Backups {
    state: PathBuf,
}

impl Backups {
    /// Those of a state folder.
    pub fn of(state: &Path) -> Self {
        Self {
            state: state.to_path_buf(),
        }
    }

    /// The folder for what is on its way.
    pub fn folder(&self) -> PathBuf {
        self.state.join(FOLDER)
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder().join(name)
    }

    /// What was checked and waits for a choice.
    fn staged(&self) -> PathBuf {
        self.path("staged")
    }

    /// The state before the last restore.
    fn before(&self) -> PathBuf {
        self.path("before")
    }
}
