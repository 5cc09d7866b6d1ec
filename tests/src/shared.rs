//! The recordings that lie beside the project.

use hal::replay::Recording;
use std::path::PathBuf;

/// The folder of a shared recording; none, with a message, where it is absent.
pub fn folder(name: &str) -> Option<PathBuf> {
    let root = PathBuf::from(env!("CARGO_MANIFEST_DIR"));
    let folder = root.join("../../shared/recordings").join(name);
    if folder.join("recording.json").is_file() {
        return Some(folder);
    }
    println!(
        "SKIPPED: the recording {name} is not at {}",
        folder.display()
    );
    None
}

/// A shared recording, opened; none, with a message, where it is absent.
pub fn recording(name: &str) -> Option<(PathBuf, Recording)> {
    let folder = folder(name)?;
    let recording = Recording::open(&folder).expect("a shared recording is valid");
    Some((folder, recording))
}
