//! The shared recordings beside the project, and a mark for each test that is skipped because they
//! are absent.

use hal::replay::Recording;
use std::path::{Path, PathBuf};
use std::{env, fs, thread};

/// The root of the workspace.
pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .parent()
        .expect("this package lies in the workspace")
        .to_path_buf()
}

/// The folder of the shared recordings.
pub fn recordings() -> PathBuf {
    root().join("../shared/recordings")
}

/// The folder of a shared recording. If it is absent, returns none and marks the calling test as
/// skipped.
pub fn folder(name: &str) -> Option<PathBuf> {
    unless_absent(recordings().join(name), "recording.json")
}

/// The folder of one of the small inputs as other programs store them. If it is absent, as with
/// [`folder`].
pub fn case(name: &str) -> Option<PathBuf> {
    unless_absent(root().join("../shared/cases").join(name), "README.md")
}

/// The folder of a tool that tests use. If it is absent, as with [`folder`].
pub fn tool(name: &str) -> Option<PathBuf> {
    unless_absent(root().join("../shared/tools").join(name), "README.md")
}

/// A folder that has this file, else a mark for the calling test.
fn unless_absent(folder: PathBuf, file: &str) -> Option<PathBuf> {
    if folder.join(file).is_file() {
        return Some(folder);
    }
    let marks = marks();
    let test = thread::current().name().unwrap_or("unnamed").to_owned();
    fs::create_dir_all(&marks).expect("the target folder can be written");
    fs::write(marks.join(test.replace("::", ".")), "").expect("the target folder can be written");
    None
}

/// A shared recording, opened; none if it is absent, as with [`folder`].
pub fn recording(name: &str) -> Option<(PathBuf, Recording)> {
    let folder = folder(name)?;
    let recording = Recording::open(&folder).expect("a shared recording is valid");
    Some((folder, recording))
}

/// The folder with one empty file per skipped test, in the target folder beside the test programs.
pub fn marks() -> PathBuf {
    let program = env::current_exe().expect("a program knows its file");
    program.with_file_name("skipped")
}
