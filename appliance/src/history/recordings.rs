//! The recordings of parts that did not pass (FAIL or INVALID), and of some that did: a folder with a
//! quota, from which the oldest are removed.
//!
//! Each recording holds the recipe that judged the part, so that the part can be judged again after
//! the recipe was edited or deleted. The recipe is a hard link to the store's file, which the store
//! replaces and never changes: it takes no room while the store or another recording has it, counts
//! once towards the quota, and goes with its last link.

use super::entry::Entry;
use crate::head::calibration::Calibration;
use crate::recipe::Store;
use crate::recipe::file::archive;
use crate::recipe::plan::Plan;
use crate::station::{ResultRecord, Stages, Verdict};
use crate::storage::folder::{name_also, rename_whole};
use hal::frame::Frame;
use hal::replay::Recording;
use hal::replay::recorder::{self, RecorderError};
use std::collections::{BTreeMap, VecDeque};
use std::fs;
use std::io::{self, ErrorKind};
use std::os::unix::fs::MetadataExt as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The recipe's name in a recording's folder.
pub const RECIPE: &str = "recipe.recipe";

/// A part with its result and what it was judged by.
#[derive(Clone, Debug)]
pub struct JudgedPart {
    /// The result.
    pub record: Arc<ResultRecord>,
    /// Which of the recipe's sequences it was judged by.
    pub sequence: usize,
    /// The frames of that sequence.
    pub frames: Vec<Frame>,
    /// The plan that judged it.
    pub plan: Arc<Plan>,
    /// The head's calibration.
    pub calibration: Calibration,
}

impl JudgedPart {
    /// Writes the frames as the new folder `folder`, with the recipe that judged the part, if it is
    /// among the files `recipes`. The recipe is left out where it is not among them, or where it
    /// and the frames would take more than `most` bytes.
    ///
    /// # Errors
    /// [`RecorderError`]; nothing of it is left then.
    pub fn write(
        &self,
        folder: &Path,
        recipes: &[PathBuf],
        most: u64,
    ) -> Result<(), RecorderError> {
        let fingerprint = &self.plan.id().fingerprint;
        recorder::write_with(&recording(self), folder, |partial| {
            let room = most.saturating_sub(bytes_in(partial));
            let fits = |path: &&PathBuf| fs::metadata(path).is_ok_and(|file| file.len() <= room);
            let own = partial.join(RECIPE);
            let added = recipes.iter().filter(fits).any(|path| {
                // Checked under its new name: the store may give the old one to another file at any
                // time.
                name_also(path, &own).is_ok() && fingerprint_of(&own).as_ref() == Some(fingerprint)
            });
            if !added {
                // There may be nothing to remove. A recording without a recipe is judged again by
                // the store's.
                let _ = fs::remove_file(&own);
            }
        })
    }
}

fn fingerprint_of(recipe: &Path) -> Option<String> {
    let file = fs::File::open(recipe).ok()?;
    Some(archive::manifest(file).ok()?.fingerprint)
}

/// The folder.
#[derive(Debug)]
pub(super) struct Recordings {
    folder: PathBuf,
    recipes: Store,
    /// Oldest first.
    kept: VecDeque<OnDisk>,
    quota: u64,
}

/// One recording.
#[derive(Debug, PartialEq, Eq, PartialOrd, Ord)]
struct OnDisk {
    name: String,
    /// Without its recipe.
    bytes: u64,
    /// The inode number and size in bytes of the recipe's file, by which links to the same file are
    /// counted once.
    recipe: Option<(u64, u64)>,
}

impl OnDisk {
    fn at(folder: &Path, name: String) -> Self {
        let recipe = fs::metadata(folder.join(RECIPE)).ok();
        let recipe = recipe.map(|file| (file.ino(), file.len()));
        let bytes = bytes_in(folder).saturating_sub(recipe.map_or(0, |(_, bytes)| bytes));
        Self {
            name,
            bytes,
            recipe,
        }
    }
}

impl Recordings {
    /// Opens the folder and removes recordings that were being written or removed when the program
    /// was killed. `recipes` are those of the station, `quota` is in bytes.
    ///
    /// # Errors
    /// Whatever the file system answers.
    pub(super) fn open(folder: &Path, recipes: Store, quota: u64) -> io::Result<Self> {
        fs::create_dir_all(folder)?;
        let mut kept = Vec::new();
        for entry in fs::read_dir(folder)? {
            let entry = entry?;
            let name = entry.file_name().to_string_lossy().into_owned();
            if name.starts_with('.') && name.contains(".partial-") {
                fs::remove_dir_all(entry.path())?;
            } else if seq_of(&name).is_some() {
                kept.push(OnDisk::at(&entry.path(), name));
            }
        }
        kept.sort();
        Ok(Self {
            folder: folder.to_path_buf(),
            recipes,
            kept: kept.into(),
            quota,
        })
    }

    /// The names of the recordings, oldest first.
    pub(super) fn names(&self) -> impl Iterator<Item = &str> {
        self.kept.iter().map(|kept| kept.name.as_str())
    }

    /// Writes the frames of a part; answers with the recording's name.
    ///
    /// # Errors
    /// [`RecorderError`]; nothing of it is left then.
    pub(super) fn keep(&mut self, part: &JudgedPart) -> Result<String, RecorderError> {
        let name = name_of(&part.record);
        let folder = self.folder.join(&name);
        // The recipe of the newest recording is tried first: a recipe that was imported again is a
        // new file in the store with the same fingerprint, and a link to that file would take room
        // for a second copy.
        let before = self.kept.back().filter(|kept| kept.recipe.is_some());
        let before = before.map(|kept| self.folder.join(&kept.name).join(RECIPE));
        let stored = self.recipes.generations(part.plan.id().number);
        let recipes: Vec<_> = before.into_iter().chain(stored).collect();
        part.write(&folder, &recipes, self.quota)?;
        self.kept.push_back(OnDisk::at(&folder, name.clone()));
        Ok(name)
    }

    /// Removes the oldest recording if all together are over the quota, and answers with its name;
    /// to be repeated until there is none.
    pub(super) fn remove_over_quota(&mut self) -> Option<String> {
        let recipes: BTreeMap<u64, u64> = self.kept.iter().filter_map(|kept| kept.recipe).collect();
        let frames: u64 = self.kept.iter().map(|kept| kept.bytes).sum();
        if frames + recipes.values().sum::<u64>() > self.quota {
            self.remove_oldest()
        } else {
            None
        }
    }

    /// Removes the oldest recording; answers with its name. It is renamed first, so that a loss of
    /// power leaves a whole recording or none.
    pub(super) fn remove_oldest(&mut self) -> Option<String> {
        let OnDisk { name, .. } = self.kept.pop_front()?;
        let nameless = self.folder.join(format!(".{name}.partial-removed"));
        // What cannot be removed now is removed at the next start. If it could not be renamed
        // either, it is counted again from then on.
        let _ = rename_whole(&self.folder.join(&name), &nameless)
            .and_then(|()| fs::remove_dir_all(nameless));
        Some(name)
    }
}

/// The name of a result's recording, `0000000042-0003-fail`: SEQ, recipe, verdict. Sorted by name
/// they are sorted by SEQ.
pub fn name_of(record: &ResultRecord) -> String {
    let verdict = match record.verdict {
        Verdict::Pass => "pass",
        Verdict::Fail => "fail",
        Verdict::None | Verdict::Invalid => "invalid",
    };
    format!("{:010}-{:04}-{verdict}", record.seq, record.recipe)
}

/// The SEQ in a recording's name.
pub fn seq_of(name: &str) -> Option<u32> {
    let (seq, _) = name.split_once('-')?;
    if seq.len() == 10 {
        seq.parse().ok()
    } else {
        None
    }
}

/// Bytes of all files below a folder, as far as they can be read.
fn bytes_in(folder: &Path) -> u64 {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    entries
        .map(|entry| match entry.metadata() {
            Ok(found) if found.is_dir() => bytes_in(&entry.path()),
            Ok(found) => found.len(),
            Err(_) => 0,
        })
        .sum()
}

fn recording(part: &JudgedPart) -> Recording {
    let JudgedPart {
        record,
        sequence,
        frames,
        plan,
        calibration,
    } = part;
    Recording {
        description: format!(
            "result {}, recipe {}, {}",
            record.seq,
            record.recipe,
            record.verdict.word()
        ),
        source: "kept by fringed".into(),
        part_id: Some(record.part_id.to_string()),
        ..plan.recording(*sequence, frames, calibration)
    }
}

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

#[cfg(test)]
mod tests {
    use super::*;

    /// A recording by hand: frames of 100 bytes, and a recipe of 1000, linked to `recipe` or a file
    /// of its own.
    fn put(folder: &Path, seq: u32, recipe: Option<&Path>) {
        let place = folder.join(format!("{seq:010}-0001-fail"));
        fs::create_dir_all(&place).unwrap();
        fs::write(place.join("frame"), [0; 100]).unwrap();
        match recipe {
            Some(recipe) => fs::hard_link(recipe, place.join(RECIPE)).unwrap(),
            None => fs::write(place.join(RECIPE), [0; 1000]).unwrap(),
        }
    }

    #[test]
    fn a_recipe_counts_once_however_many_recordings_have_it_and_goes_with_the_last_of_them() {
        let folder = tempfile::tempdir().unwrap();
        let (recordings, recipe) = (folder.path().join("kept"), folder.path().join("recipe"));
        fs::write(&recipe, [0; 1000]).unwrap();
        put(&recordings, 1, Some(&recipe));
        put(&recordings, 2, Some(&recipe));
        put(&recordings, 3, None);
        let open = |quota| {
            let mut recordings = Recordings::open(&recordings, Store::at(folder.path()), quota);
            std::iter::from_fn(|| recordings.as_mut().unwrap().remove_over_quota()).count()
        };
        // Three sets of frames and two recipes.
        assert_eq!(open(2300), 0);
        assert_eq!(open(2299), 1);
        assert_eq!(open(2199), 1);
        assert_eq!(open(1100), 0);
        assert_eq!(open(1099), 1);
        assert_eq!(fs::metadata(&recipe).unwrap().nlink(), 1);
    }
}
