//! Targets for files with pixels: arrays, frames, recordings.

use super::bounded;
use crate::render::small_recording;
use appliance::measure::measure;
use hal::npy;
use hal::replay::{Recording, recorder};
use std::fs;
use std::path::PathBuf;
use tempfile::TempDir;

/// NumPy arrays of each kind that is read; an array that was read can be written and read again.
pub fn npy(data: &[u8]) {
    bounded(16 * data.len() + (1 << 16), || {
        if let Ok(array) = npy::read::<u8>(data) {
            assert_eq!(
                Some(array.elements.len()),
                array.rows.checked_mul(array.columns)
            );
        }
        if let Ok(array) = npy::read::<f64>(data) {
            assert_eq!(
                Some(array.elements.len()),
                array.rows.checked_mul(array.columns)
            );
        }
        if let Ok(array) = npy::read::<f32>(data)
            && !array.elements.is_empty()
        {
            let again = npy::read::<f32>(&npy::write(array.columns, &array.elements));
            let again = again.expect("what was written can be read");
            let bits = |elements: &[f32]| elements.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
            assert_eq!(bits(&array.elements), bits(&again.elements));
        }
    });
}

/// A recording with few pixels and every optional part, in a temporary folder.
struct Kept {
    folder: TempDir,
}

impl Kept {
    fn new(bit_depth: u8) -> Self {
        let recording = small_recording(bit_depth, &[0.03, 0.2, 1.0]);
        let folder = tempfile::tempdir().expect("a folder");
        recorder::write(&recording, &folder.path().join("recording")).expect("written");
        Self { folder }
    }

    fn path(&self) -> PathBuf {
        self.folder.path().join("recording")
    }

    /// Opens it with `bytes` in place of one file.
    fn opened(&self, name: &str, bytes: &[u8], then: impl FnOnce(Recording)) {
        let path = self.path().join(name);
        let whole = fs::read(&path).expect("the file is there");
        fs::write(&path, bytes).expect("replaced");
        match Recording::open(&self.path()) {
            Ok(recording) => then(recording),
            Err(error) => assert!(!error.to_string().is_empty()),
        }
        fs::write(&path, whole).expect("put back");
    }
}

thread_local! {
    static EIGHT: Kept = Kept::new(8);
    static TWELVE: Kept = Kept::new(12);
}

/// A frame of a recording: the first byte selects the recording's bit depth.
pub fn png_frame(data: &[u8]) {
    let Some((depth, picture)) = data.split_first() else {
        return;
    };
    let kept = if depth & 1 == 0 { &EIGHT } else { &TWELVE };
    kept.with(|kept| kept.opened("frames/000.png", picture, drop));
}

/// A recording, opened and measured: the first byte selects which of its files is replaced.
pub fn recording(data: &[u8]) {
    const FILES: [&str; 5] = [
        "recording.json",
        "frames/003.png",
        "truth/height.npy",
        "truth/class.npy",
        "pattern/phase.npy",
    ];
    let Some((which, content)) = data.split_first() else {
        return;
    };
    let name = FILES[usize::from(*which) % FILES.len()];
    EIGHT.with(|kept| {
        kept.opened(name, content, |recording| {
            let measured = measure(&recording, &kept.path());
            std::hint::black_box(measured.is_ok());
        });
    });
}
