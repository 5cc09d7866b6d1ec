//! Commissioning: the steps from a bare head to a complete calibration. Each measures what the
//! doctor or `fringed calibrate` measures, says what is wrong and what to do, and can be repeated
//! alone; its result is kept in `commissioning.json`.
//!
//! [`Step::run`] works on the head and on the [`Commissioning`] that is kept; who owns both, and
//! who asks for steps, is decided elsewhere.

mod empty;
mod file;
mod geometry;
mod laid;
mod outcome;
mod plane;
mod pose;
mod timing;

pub use file::{Commissioning, FILE, Models};
pub use geometry::{Poses, Solving};
pub use laid::Laid;
pub use outcome::Outcome;
pub use pose::{PoseFile, pose_name};

use crate::error::Result;
use crate::head::calibration::Calibration;
use crate::head::calibration::file::CalibrationFile;
use crate::head::doctor::examine_for;
use hal::frame::Frame;
use hal::head::Head;
use std::path::Path;

/// A step: a row of [`STEPS`].
#[derive(Debug)]
pub struct Step {
    /// Its name.
    pub name: &'static str,
    /// Measures, judges, and stores in what is kept what later steps need. Without an outcome the
    /// step is to be done again.
    measure: fn(&mut Subject<'_>, &mut Commissioning) -> Result<Option<Outcome>>,
}

/// The step before which exposure and gain are set.
pub const EXPOSURE: &str = "exposure";
/// The step in which poses are taken, and models made of them.
pub const GEOMETRY: &str = "geometry";
/// The step that measures the head whatever its geometry.
pub const TIMING: &str = "timing";
/// The step that stores the calibration.
pub const PLANE: &str = "plane";

/// The steps in their order.
pub static STEPS: [Step; 7] = [
    Step {
        name: "devices",
        measure: |subject, _| {
            doctor(
                subject,
                &["devices", "format", "mode", "cadence", "trigger"],
            )
        },
    },
    Step {
        name: "aim",
        measure: |subject, _| doctor(subject, &["light", "contrast"]),
    },
    Step {
        name: EXPOSURE,
        measure: |subject, _| doctor(subject, &["light", "exposure"]),
    },
    Step {
        name: TIMING,
        measure: timing::measure,
    },
    Step {
        name: GEOMETRY,
        measure: geometry::measure,
    },
    Step {
        name: PLANE,
        measure: plane::measure,
    },
    // May be left out, and be done again.
    Step {
        name: "empty",
        measure: empty::measure,
    },
];

/// The head that a step works on.
pub struct Subject<'a> {
    /// The devices.
    pub head: &'a mut Head,
    /// What is known of them; the response and the noise become those that are measured.
    pub calibration: &'a mut Calibration,
    /// Whether the calibration can be trusted.
    pub calibrated: bool,
    /// Whether the models of the calibration are exact although none is stored: those of a
    /// simulated head.
    pub exact: bool,
    /// The stored calibration of this head.
    pub before: Option<CalibrationFile>,
    /// Where the calibration is stored.
    pub place: &'a Path,
    /// What the step [`GEOMETRY`] does; without it, it makes the models.
    pub poses: Option<Poses>,
    /// The white frame of the pose that was taken.
    pub white: Option<Frame>,
    /// Gets the share done and what is done next.
    pub progress: &'a (dyn Fn(f64, &str) + Sync),
}

impl Step {
    /// The step of this name.
    pub fn of(name: &str) -> Option<&'static Self> {
        STEPS.iter().find(|step| step.name == name)
    }

    /// Carries it out and keeps how it ended in `kept`, which is not written here.
    pub fn run(&self, subject: &mut Subject<'_>, kept: &mut Commissioning) {
        match (self.measure)(subject, kept).unwrap_or_else(|failure| Some(failure.into())) {
            Some(outcome) => drop(kept.steps.insert(self.name.into(), outcome)),
            None => drop(kept.steps.remove(self.name)),
        }
    }
}

/// The doctor's checks of these names.
fn doctor(subject: &mut Subject<'_>, names: &[&str]) -> Result<Option<Outcome>> {
    Ok(Some(Outcome::of(&examine_for(
        subject.head,
        subject.calibration,
        subject.calibrated,
        &|name| names.contains(&name),
        subject.progress,
    ))))
}
