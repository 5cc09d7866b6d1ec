//! Recordings that are measured in this process; each shared recording once for all tests.

use appliance::measure::{MeasuredRecording, measure};
use hal::replay::Recording;
use std::path::Path;
use std::sync::OnceLock;
use tests::shared;

/// A recording, and the results of the program's code for it.
pub struct Measured {
    pub recording: Recording,
    pub result: MeasuredRecording,
}

impl Measured {
    pub fn new(recording: Recording) -> Self {
        let result = measure(&recording, Path::new("in memory")).expect("it can be measured");
        Self { recording, result }
    }

    /// Heights of the primary pattern in mm, NaN = unresolved.
    pub fn heights(&self) -> Vec<f32> {
        let surface = self.result.heights.as_ref().expect("there are models");
        let heights = surface.map.height.iter();
        heights.map(|height| height.mm() as f32).collect()
    }
}

pub const SKULL: &str = "slstudio-skull";
pub const BOARD: &str = "slstudio-board2";
pub const SPHERE: &str = "study-sphere-fixed81";
pub const CONE: &str = "study-cone-adaptive";
pub const SPLINE: &str = "study-spline-dense121";
const ALL: [&str; 5] = [SKULL, BOARD, SPHERE, CONE, SPLINE];

/// A shared recording, measured; `None` if it is not on this machine, and then the test counts as
/// skipped.
pub fn shared_recording(name: &str) -> Option<&'static Measured> {
    static MEASURED: [OnceLock<Option<Measured>>; ALL.len()] =
        [const { OnceLock::new() }; ALL.len()];
    let at = ALL.iter().position(|known| *known == name).expect(name);
    shared::folder(name)?;
    MEASURED[at]
        .get_or_init(|| shared::recording(name).map(|(_, recording)| Measured::new(recording)))
        .as_ref()
}
