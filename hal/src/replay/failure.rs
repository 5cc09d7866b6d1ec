//! Errors of opening a recording: it does not exist, or its content is wrong.

use std::path::{Path, PathBuf};

use crate::bounds::shortened;

/// A recording that cannot be opened. The message names the file and the remedy.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum RecordingError {
    /// The named folder, or its `recording.json`, does not exist.
    #[error("open recording {}: no such {what}: name a folder that holds a recording.json", path.display())]
    Missing {
        /// What was looked for.
        path: PathBuf,
        /// "folder" or "recording.json".
        what: &'static str,
    },
    /// Something in the folder is wrong; this includes a missing file that the manifest names.
    #[error("open recording {}: {wrong}", path.display())]
    Content {
        /// The file that is wrong.
        path: PathBuf,
        /// What is wrong with it.
        wrong: Wrong,
    },
}

/// What is wrong with a file of a recording.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{problem}: {remedy}")]
pub struct Wrong {
    /// What is wrong, with the numbers.
    problem: String,
    /// What to do about it.
    remedy: String,
}

impl RecordingError {
    /// Whether the recording does not exist at all, as opposed to having wrong content.
    #[must_use]
    pub fn is_missing(&self) -> bool {
        matches!(self, Self::Missing { .. })
    }
}

impl Wrong {
    pub(crate) fn new(problem: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self {
            problem: shortened(&problem.into()),
            remedy: remedy.into(),
        }
    }

    /// This problem, naming the key of the manifest that is concerned.
    pub(crate) fn of(self, key: &str) -> Self {
        Self {
            problem: format!("{key}: {}", self.problem),
            ..self
        }
    }

    /// The error of opening the recording in which the file `path` is wrong.
    pub(crate) fn at(self, path: &Path) -> RecordingError {
        RecordingError::Content {
            path: path.to_path_buf(),
            wrong: self,
        }
    }
}
