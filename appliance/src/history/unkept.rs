//! Why the frames of a part are not kept: as text in the database, and in words for people.

use super::entry::Entry;
use crate::station::{Stages, Verdict};
use hal::replay::recorder::RecorderError;
use std::io::ErrorKind;

/// Why the frames of a part that did not pass are not kept, or no longer. `docs/formats.md` has the
/// texts in the database.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Unkept {
    /// Recordings are switched off.
    #[error("off")]
    Off,
    /// The frames of another part were being written.
    #[error("busy")]
    Busy,
    /// Removed, because all together were over the quota.
    #[error("quota")]
    Quota,
    /// Removed, because the storage had no room for results.
    #[error("room")]
    Room,
    /// Found missing at a start.
    #[error("gone")]
    Gone,
    /// The storage was full; with the error in words.
    #[error("full")]
    Full(String),
    /// They could not be written, for a reason in words.
    #[error("failed: {0}")]
    Failed(String),
}

impl Unkept {
    /// What went wrong, in words, where something did.
    pub fn problem(&self) -> Option<&str> {
        match self {
            Self::Full(words) | Self::Failed(words) => Some(words),
            _ => None,
        }
    }
}

impl From<&RecorderError> for Unkept {
    fn from(error: &RecorderError) -> Self {
        match error {
            RecorderError::Create { source, .. }
                if matches!(
                    source.kind(),
                    ErrorKind::StorageFull | ErrorKind::QuotaExceeded
                ) =>
            {
                Self::Full(error.to_string())
            }
            error => Self::Failed(error.to_string()),
        }
    }
}

/// Why there are no frames of a result, in words; none where they are kept.
pub fn why_no_frames(entry: &Entry) -> Option<String> {
    if entry.recording.is_some() {
        return None;
    }
    let words = match entry.unkept.as_deref() {
        Some("off") => "recordings are switched off: history.recordings_mib is 0",
        Some("busy") => "the frames of another part were being written at that time",
        Some("quota") => {
            "they were removed: all recordings together took more than history.recordings_mib"
        }
        Some("room") => "they were removed: the storage had no room left for results",
        Some("gone") => "their folder was removed or renamed, not by the station",
        Some("full") => "the storage was full: free space",
        Some(other) => {
            let words = other.strip_prefix("failed: ").unwrap_or(other);
            return Some(format!("they could not be written: {words}"));
        }
        None if entry.verdict == Verdict::Pass => "those of a part that passes are not kept",
        None if entry.stages == Stages::default() => "nothing was measured",
        None => {
            "it is not known why: they are still being written, or the station ended before that"
        }
    };
    Some(words.into())
}
