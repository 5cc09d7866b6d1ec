//! Fuzz targets: what a file, a PLC or a browser may send, as functions of bytes. None may panic, whatever the bytes are.
//!
//! `tests/fuzz` calls them under libFuzzer; the suite calls them with the inputs that lie there.

mod folder;
mod head;
mod page;
mod part;
mod plant;
mod recipe;

/// A target: fails by a panic.
pub type Target = fn(&[u8]);

/// All targets with their names, which are those of the folders of their inputs.
pub const TARGETS: [(&str, Target); 12] = [
    ("npy", folder::npy),
    ("png_frame", folder::png_frame),
    ("recording", folder::recording),
    ("recipe_zip", recipe::zip),
    ("recipe_json", recipe::json),
    ("edit", recipe::edit),
    ("calibration", head::calibration),
    ("opencv", head::opencv),
    ("scenario", head::scenario),
    ("config", head::config),
    ("modbus", plant::modbus),
    ("http", page::http),
];

/// The target of a name; none where there is no such target.
pub fn target(name: &str) -> Option<Target> {
    let found = TARGETS.iter().find(|(other, _)| *other == name);
    found.map(|(_, target)| *target)
}

/// Runs `work` and fails if this thread held more than `most` bytes at a time for it: a small file must not take much memory.
fn bounded<T>(most: usize, work: impl FnOnce() -> T) -> T {
    let mut answer = None;
    let counted = allocation_counter::measure(|| answer = Some(work()));
    assert!(
        counted.bytes_max <= most as u64,
        "{} bytes of memory, at most {most} expected",
        counted.bytes_max
    );
    answer.expect("it has run")
}
