//! Fuzz targets: the parsers of files, Modbus and HTTP, as functions of bytes. None may panic,
//! whatever the bytes are.
//!
//! `tests/fuzz` calls them under libFuzzer; the suite calls them with the inputs stored there.

mod backup;
mod folder;
mod head;
mod page;
mod part;
mod plant;
mod recipe;
mod study;

/// A target; it panics if a promise is not kept.
pub type Target = fn(&[u8]);

/// All targets with their names, which are also the names of the folders of their inputs.
pub const TARGETS: [(&str, Target); 15] = [
    ("npy", folder::npy),
    ("png_frame", folder::png_frame),
    ("recording", folder::recording),
    ("recipe_zip", recipe::zip),
    ("recipe_json", recipe::json),
    ("backup", backup::archive),
    ("edit", recipe::edit),
    ("gauges_toml", recipe::gauges_toml),
    ("calibration", head::calibration),
    ("opencv", head::opencv),
    ("scenario", head::scenario),
    ("config", head::config),
    ("modbus", plant::modbus),
    ("http", page::http),
    ("study", study::csv),
];

/// The target of this name, if there is one.
pub fn target(name: &str) -> Option<Target> {
    let found = TARGETS.iter().find(|(other, _)| *other == name);
    found.map(|(_, target)| *target)
}

/// Runs `work` and panics if this thread held more than `most` bytes at a time: a small file must
/// not take much memory.
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
