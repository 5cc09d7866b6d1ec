//! Writing a recording: to a folder with a temporary name, which is synced and then renamed.

use std::fs;
use std::io::{self, ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

use super::entries::{Names, manifest_of, phase_file, pictures};
use super::manifest::Manifest;
use super::recording::{MANIFEST, PatternSpec, Recording, TRUTH_CLASS, TRUTH_HEIGHT};
use super::{Wrong, check, grey};
use crate::frame::{Frame, Samples};
use crate::npy;

/// Errors of writing a recording. Nothing is left behind.
#[derive(Debug, thiserror::Error)]
pub enum RecorderError {
    /// The name exists already.
    #[error("write recording {}: it exists already: name a folder that does not exist", path.display())]
    Exists {
        /// The folder.
        path: PathBuf,
    },
    /// The recording could not be opened again.
    #[error("write recording {}: {wrong}", path.display())]
    Content {
        /// The folder.
        path: PathBuf,
        /// What is wrong with it.
        wrong: Wrong,
    },
    /// A file or folder could not be created.
    #[error("write recording: cannot create {} ({source}): check that the folder is writable and has space", path.display())]
    Create {
        /// What was to be created.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
}

/// Writes `recording` as the new folder `folder`, whose parent must exist.
///
/// # Errors
/// [`RecorderError`]; the folder does not exist then.
pub fn write(recording: &Recording, folder: &Path) -> Result<(), RecorderError> {
    write_with(recording, folder, |_| ())
}

/// As [`write()`]; before the folder gets its name, `add` may add synced files of its own to it. It
/// is given the temporary folder.
///
/// # Errors
/// As [`write()`].
pub fn write_with(
    recording: &Recording,
    folder: &Path,
    add: impl FnOnce(&Path),
) -> Result<(), RecorderError> {
    let manifest = checked(recording, Names::Kinds, folder)?;
    check_samples(recording).map_err(content(folder))?;
    settled(folder, |partial| {
        put_pictures(recording, partial)?;
        fill(recording, &manifest, partial)?;
        add(partial);
        Ok(())
    })
}

/// Writes everything of `recording` but its frames, as the new folder `folder`, for frames that are
/// yet to be taken: the manifest names the file of each frame by its `count`, the place in the
/// order of projection. `beside` are further files with their names.
///
/// # Errors
/// As [`write()`].
pub fn write_outline(
    recording: &Recording,
    folder: &Path,
    beside: &[(String, Vec<u8>)],
) -> Result<(), RecorderError> {
    let manifest = checked(recording, Names::Counts, folder)?;
    settled(folder, |partial| {
        let frames = partial.join("frames");
        fs::create_dir(&frames).map_err(|source| create(&frames, source))?;
        for (name, bytes) in beside {
            put(&partial.join(name), bytes)?;
        }
        fill(recording, &manifest, partial)
    })
}

/// Writes the frames of `recording`, and further ones with their names, as the new folder `folder`.
/// It is a recording if there are frames of levels; a recording without them could not be opened,
/// so then it is pictures only.
///
/// # Errors
/// As [`write()`].
pub fn write_frames(
    recording: &Recording,
    folder: &Path,
    beside: &[(String, Frame)],
) -> Result<(), RecorderError> {
    let manifest = match recording.frames.is_empty() {
        true => {
            absent(folder)?;
            None
        }
        false => Some(checked(recording, Names::Kinds, folder)?),
    };
    settled(folder, |partial| {
        for (name, frame) in beside {
            put_frame(&partial.join("frames").join(name), frame)?;
        }
        put_pictures(recording, partial)?;
        match &manifest {
            Some(manifest) => fill(recording, manifest, partial),
            None => Ok(()),
        }
    })
}

/// Checks that a folder does not exist.
fn absent(folder: &Path) -> Result<(), RecorderError> {
    match fs::symlink_metadata(folder) {
        Err(_) => Ok(()),
        Ok(_) => Err(RecorderError::Exists {
            path: folder.to_path_buf(),
        }),
    }
}

/// The manifest of a recording, if it can be opened again and its folder does not exist.
fn checked(recording: &Recording, names: Names, folder: &Path) -> Result<Manifest, RecorderError> {
    absent(folder)?;
    let manifest = manifest_of(recording, names);
    check::manifest(&manifest).map_err(content(folder))?;
    Ok(manifest)
}

/// The error of writing something wrong to `folder`.
fn content(folder: &Path) -> impl FnOnce(Wrong) -> RecorderError {
    let path = folder.to_path_buf();
    move |wrong| RecorderError::Content { path, wrong }
}

/// Makes a folder with `fill` under a temporary name, syncs it and renames it. Nothing is left
/// behind if that fails.
fn settled(
    folder: &Path,
    fill: impl FnOnce(&Path) -> Result<(), RecorderError>,
) -> Result<(), RecorderError> {
    let partial = partial_name(folder);
    // Created here and not in `fill`: if this fails, the folder is not ours and must not be
    // removed.
    fs::create_dir(&partial).map_err(|source| create(&partial, source))?;
    let written = fill(&partial)
        .and_then(|()| settle(&partial, folder).map_err(|source| create(folder, source)));
    if written.is_err() {
        // The first error is returned; that the temporary folder cannot be removed either is not
        // worth another.
        let _ = fs::remove_dir_all(&partial);
    }
    written
}

/// A hidden name in the same place as `folder` that no other recorder uses at the same time.
fn partial_name(folder: &Path) -> PathBuf {
    static COUNT: AtomicU64 = AtomicU64::new(0);
    let name = folder.file_name().unwrap_or_default().to_string_lossy();
    let count = COUNT.fetch_add(1, Ordering::Relaxed);
    folder.with_file_name(format!(".{name}.partial-{}-{count}", std::process::id()))
}

fn create(path: &Path, source: io::Error) -> RecorderError {
    RecorderError::Create {
        path: path.to_path_buf(),
        source,
    }
}

/// Renames a folder of synced files to its final name, so that after a loss of power all of it has
/// this name or nothing has. For this the folders are synced before the rename, and the parent
/// folder after it.
fn settle(partial: &Path, folder: &Path) -> io::Result<()> {
    for entry in fs::read_dir(partial)? {
        let entry = entry?;
        if entry.file_type()?.is_dir() {
            sync_folder(&entry.path())?;
        }
    }
    sync_folder(partial)?;
    fs::rename(partial, folder)?;
    let parent = folder.parent();
    sync_folder(
        parent
            .filter(|parent| !parent.as_os_str().is_empty())
            .unwrap_or(Path::new(".")),
    )
}

/// Syncs the names in a folder. That a file system does not support this is not an error.
fn sync_folder(folder: &Path) -> io::Result<()> {
    match fs::File::open(folder)?.sync_all() {
        Err(error)
            if matches!(
                error.kind(),
                ErrorKind::InvalidInput | ErrorKind::Unsupported
            ) =>
        {
            Ok(())
        }
        synced => synced,
    }
}

/// Checks that frames, phases and truth have the shape that the recording states.
fn check_samples(recording: &Recording) -> Result<(), Wrong> {
    let refuse = |problem: String| Err(Wrong::new(problem, "record it again"));
    let wanted = recording.format();
    for (file, frame) in pictures(recording) {
        let format = frame.format();
        if (format.width, format.height, format.bit_depth)
            != (wanted.width, wanted.height, wanted.bit_depth)
        {
            return refuse(format!(
                "{file} is {}, the recording {}",
                format.describe(),
                wanted.describe()
            ));
        }
        if let Samples::Sixteen(samples) = frame.samples()
            && let Some(sample) = samples.iter().find(|sample| **sample > wanted.full_scale())
        {
            return refuse(format!(
                "{file} holds the sample {sample} of {}",
                wanted.describe()
            ));
        }
    }
    let (rows, columns) = (
        recording.projector.height as usize,
        recording.projector.width as usize,
    );
    for pattern in &recording.patterns {
        if let PatternSpec::File {
            rows: r,
            columns: c,
            turns,
        } = pattern
            && ((*r, *c) != (rows, columns)
                || turns.len() != rows * columns
                || !turns.iter().all(|turns| turns.is_finite()))
        {
            return refuse(format!(
                "the phase of a {rows}×{columns} projector is {r}×{c} or not finite"
            ));
        }
    }
    let truths = [
        recording.truth_height.as_ref().map(Vec::len),
        recording.truth_class.as_ref().map(Vec::len),
    ];
    match truths
        .into_iter()
        .flatten()
        .find(|length| *length != wanted.samples())
    {
        Some(length) => refuse(format!(
            "the truth has {length} pixels of {}",
            wanted.samples()
        )),
        None => Ok(()),
    }
}

fn put_pictures(recording: &Recording, partial: &Path) -> Result<(), RecorderError> {
    for (file, frame) in pictures(recording) {
        put_frame(&partial.join(file), frame)?;
    }
    Ok(())
}

fn put_frame(path: &Path, frame: &Frame) -> Result<(), RecorderError> {
    let file = grey::encode(&frame.format(), frame.samples())
        .map_err(|error| create(path, io::Error::other(error)))?;
    put(path, &file)
}

/// Writes everything but the frames.
fn fill(recording: &Recording, manifest: &Manifest, partial: &Path) -> Result<(), RecorderError> {
    for (index, pattern) in recording.patterns.iter().enumerate() {
        if let PatternSpec::File { columns, turns, .. } = pattern {
            let path = partial.join(phase_file(&recording.patterns, index));
            put(&path, &npy::write(*columns, turns))?;
        }
    }
    let columns = recording.width as usize;
    if let Some(height) = &recording.truth_height {
        put(&partial.join(TRUTH_HEIGHT), &npy::write(columns, height))?;
    }
    if let Some(class) = &recording.truth_class {
        put(&partial.join(TRUTH_CLASS), &npy::write(columns, class))?;
    }
    let path = partial.join(MANIFEST);
    let mut text = serde_json::to_string_pretty(manifest)
        .map_err(|error| create(&path, io::Error::other(error)))?;
    text.push('\n');
    put(&path, text.as_bytes())
}

/// Writes and syncs a new file, and makes its folder if there is none yet.
fn put(path: &Path, bytes: &[u8]) -> Result<(), RecorderError> {
    fs::create_dir_all(path.parent().unwrap_or(path))
        .and_then(|()| fs::File::create_new(path))
        .and_then(|mut file| {
            file.write_all(bytes)?;
            file.sync_all()
        })
        .map_err(|source| create(path, source))
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;
    use rustix::fs::inotify;
    use std::mem::MaybeUninit;

    /// What happened in the watched folders, in order.
    fn events(watch: &impl std::os::fd::AsFd) -> Vec<String> {
        let mut buffer = [MaybeUninit::uninit(); 4096];
        let mut reader = inotify::Reader::new(watch, &mut buffer);
        let mut events = Vec::new();
        while let Ok(event) = reader.next() {
            let name = event
                .file_name()
                .map(|name| name.to_string_lossy().into_owned());
            let name = name.unwrap_or_else(|| "itself".into());
            let flags = event.events();
            if flags.contains(inotify::ReadFlags::MOVED_TO) {
                events.push(format!("rename to {name}"));
            } else if flags.contains(inotify::ReadFlags::OPEN | inotify::ReadFlags::ISDIR) {
                events.push(format!("open {name}"));
            }
        }
        events
    }

    #[test]
    fn folders_are_synced_before_a_recording_gets_its_name_and_the_name_after_it() {
        let place = tempfile::tempdir().unwrap();
        let partial = place.path().join(".7.partial");
        for folder in ["frames", "truth"] {
            fs::create_dir_all(partial.join(folder)).unwrap();
        }
        let watch = inotify::init(inotify::CreateFlags::NONBLOCK).unwrap();
        for folder in [&*partial, place.path()] {
            let wanted = inotify::WatchFlags::OPEN | inotify::WatchFlags::MOVED_TO;
            inotify::add_watch(&watch, folder, wanted).unwrap();
        }
        settle(&partial, &place.path().join("7")).unwrap();
        let events = events(&watch);
        let last = |wanted: &str| {
            let found = events.iter().rposition(|event| event == wanted);
            found.unwrap_or_else(|| panic!("no {wanted:?} in {events:?}"))
        };
        // A folder is synced by opening it.
        let renamed = last("rename to 7");
        for folder in ["open frames", "open truth"] {
            assert!(last(folder) < last("open .7.partial"), "{events:?}");
        }
        assert!(last("open .7.partial") < renamed, "{events:?}");
        assert!(renamed < last("open itself"), "{events:?}");
    }
}
