//! Rendered recordings on disk, and the program that measures them.

use hal::replay::{Recording, recorder};
use serde_json::Value;
use std::fs;
use std::path::PathBuf;
use tempfile::TempDir;
use tests::program::{Program, Run};
use tests::render::{Scene, levels};

/// The path of the program `fringed` of the same build as this suite.
pub const FRINGED: &str = env!("CARGO_BIN_EXE_fringed-under-test");

/// This program.
pub fn program() -> Program {
    Program::at(FRINGED)
}

/// The path of the program `fringed-lab` of the same build as this suite.
pub const FRINGED_LAB: &str = env!("CARGO_BIN_EXE_fringed-lab-under-test");

/// This program.
pub fn laboratory() -> Program {
    Program::at(FRINGED_LAB)
}

/// The program `fringed-fleet` of the same build as this suite.
pub fn collector() -> Program {
    Program::at(env!("CARGO_BIN_EXE_fringed-fleet-under-test"))
}

/// A geometric recording of three levels of four shifts.
pub fn geometric() -> Scene {
    Scene::new(49.0, levels(&[0.0192, 0.138, 1.0], 4))
}

/// A folder with a recording, and a place for results.
pub struct Written {
    folder: TempDir,
}

impl Written {
    pub fn new(recording: &Recording) -> Self {
        let folder = tempfile::tempdir().unwrap();
        recorder::write(recording, &folder.path().join("recording")).unwrap();
        Self { folder }
    }

    pub fn recording(&self) -> PathBuf {
        self.folder.path().join("recording")
    }

    pub fn manifest(&self) -> PathBuf {
        self.recording().join("recording.json")
    }

    pub fn out(&self) -> PathBuf {
        self.folder.path().join("out")
    }

    /// Runs `measure` with more arguments.
    pub fn measure(&self, more: &[&str]) -> Run {
        program().measure(&self.recording(), &self.out(), more)
    }

    /// Changes the manifest.
    pub fn edit(&self, change: impl FnOnce(&mut Value)) {
        let text = fs::read_to_string(self.manifest()).unwrap();
        let mut value = serde_json::from_str(&text).unwrap();
        change(&mut value);
        fs::write(
            self.manifest(),
            serde_json::to_string_pretty(&value).unwrap(),
        )
        .unwrap();
    }

    /// Replaces the first occurrence of a text in the manifest.
    pub fn replace(&self, from: &str, to: &str) {
        let text = fs::read_to_string(self.manifest()).unwrap();
        assert!(text.contains(from), "{from} is not in the manifest");
        fs::write(self.manifest(), text.replacen(from, to, 1)).unwrap();
    }
}
