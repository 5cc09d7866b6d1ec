//! The steps, and how each is carried out.

use super::file::Commissioning;
use super::outcome::Outcome;
use super::poses::Solving;
use crate::error::Failure;
use crate::head::calibrate::{Characteristics, characterise, off_proportion};
use crate::head::calibration::Calibration;
use crate::head::calibration::file::CalibrationFile;
use crate::head::doctor::examine_for;
use crate::head::examine::by_pitch;
use crate::head::geometry::SeenPose;
use algo::calibration::Board;
use hal::frame::Frame;
use hal::head::Head;
use serde::{Deserialize, Serialize};
use serde_json::json;
use std::path::Path;

/// The names of the steps, in their order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Name {
    /// Camera, projector and trigger work.
    Devices,
    /// There is light, and it is sharp.
    Aim,
    /// It is neither too dark nor saturated.
    Exposure,
    /// Delay, stamps, response, noise and contrast.
    Timing,
    /// The models of camera and projector.
    Geometry,
    /// The reference plane.
    Plane,
}

impl Name {
    /// All of them.
    pub const ALL: [Self; 6] = [
        Self::Devices,
        Self::Aim,
        Self::Exposure,
        Self::Timing,
        Self::Geometry,
        Self::Plane,
    ];

    /// The word for it.
    pub fn word(self) -> &'static str {
        match self {
            Self::Devices => "devices",
            Self::Aim => "aim",
            Self::Exposure => "exposure",
            Self::Timing => "timing",
            Self::Geometry => "geometry",
            Self::Plane => "plane",
        }
    }
}

/// A step with its options.
#[derive(Clone, Debug, PartialEq)]
pub enum Step {
    /// The doctor's checks of devices.
    Devices,
    /// The doctor's checks of light and sharpness.
    Aim,
    /// The doctor's check of exposure; exposure and gain were set before.
    Exposure,
    /// What does not depend on the geometry is measured.
    Timing,
    /// A pose of this board is taken under this number.
    Pose(Board, u32),
    /// A pose, or all of them, is forgotten.
    Forget(Option<u32>),
    /// The models are made of the poses.
    Solve(Solving),
    /// The reference plane is measured, and the calibration stored.
    Plane,
}

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
    /// Gets the share done and what is done next.
    pub progress: &'a (dyn Fn(f64, &str) + Sync),
}

impl Step {
    /// The name of the step that it belongs to.
    pub fn name(&self) -> Name {
        match self {
            Self::Devices => Name::Devices,
            Self::Aim => Name::Aim,
            Self::Exposure => Name::Exposure,
            Self::Timing => Name::Timing,
            Self::Pose(..) | Self::Forget(_) | Self::Solve(_) => Name::Geometry,
            Self::Plane => Name::Plane,
        }
    }

    /// Carries it out and keeps how it ended in `kept`, which is not written here. Returns the
    /// white frame of a pose.
    pub fn run(&self, subject: &mut Subject<'_>, kept: &mut Commissioning) -> Option<Frame> {
        let doctor = |subject: &mut Subject<'_>, names: &[&str]| {
            Outcome::of(&examine_for(
                subject.head,
                subject.calibration,
                subject.calibrated,
                &|name| names.contains(&name),
                subject.progress,
            ))
        };
        let mut white = None;
        let poses: Vec<SeenPose> = kept.usable(None).collect();
        let outcome = match self {
            Self::Devices => doctor(
                subject,
                &["devices", "format", "mode", "cadence", "trigger"],
            ),
            Self::Aim => doctor(subject, &["light", "contrast"]),
            Self::Exposure => doctor(subject, &["light", "exposure"]),
            Self::Timing => timing(subject, kept),
            Self::Pose(..) if kept.measured.is_none() && !subject.calibrated => Outcome::failed(
                "a pose needs the head's delay and response",
                "do the step timing first",
            ),
            Self::Pose(board, number) => match kept.take_pose(subject, board, *number) {
                Ok((outcome, frame)) => {
                    white = frame;
                    outcome
                }
                Err(error) => Failure::from(error).into(),
            },
            Self::Forget(number) => kept.forget(*number),
            Self::Solve(solving) => {
                (subject.progress)(0.1, "adjusting the models");
                kept.solve(subject.before.as_ref(), *solving)
            }
            Self::Plane => kept.complete(subject).unwrap_or_else(Outcome::from),
        };
        // The plane was measured with other models.
        if matches!(self, Self::Solve(_)) && outcome.passed {
            kept.steps.remove(&Name::Plane);
        }
        if matches!(self, Self::Pose(..) | Self::Forget(_)) {
            // Models are those of all poses that can be used, or there are none.
            let now: Vec<SeenPose> = kept.usable(None).collect();
            if now != poses {
                kept.models = None;
            }
        }
        match (self, &kept.models) {
            (Self::Pose(..) | Self::Forget(_), None) if outcome.passed => {
                kept.steps.remove(&Name::Geometry);
            }
            (Self::Pose(..) | Self::Forget(_), Some(models)) if outcome.passed => {
                let outcome = models.found(kept.head);
                kept.steps.insert(Name::Geometry, outcome);
            }
            _ => drop(kept.steps.insert(self.name(), outcome)),
        }
        white
    }
}

fn timing(subject: &mut Subject<'_>, kept: &mut Commissioning) -> Outcome {
    let response = kept.measured.as_ref().map(|known| known.response.clone());
    let before = subject
        .before
        .as_ref()
        .and_then(|file| file.response.clone());
    let mut notes = Vec::new();
    let measured = characterise(
        subject.head,
        subject.calibration,
        response.or(before),
        &mut notes,
        subject.progress,
    );
    match measured {
        Err(failure) => failure.into(),
        Ok(measured) => {
            let outcome = characterised(&measured, notes);
            kept.measured = Some(measured);
            outcome
        }
    }
}

fn characterised(measured: &Characteristics, notes: Vec<String>) -> Outcome {
    let Characteristics {
        timing,
        noise,
        response,
        contrast,
    } = measured;
    let delay_ms = timing.flip_to_light_ns as f64 * 1e-6;
    let off_percent = off_proportion(response) / 2.55;
    let mut said = vec![
        format!("delay: light comes {delay_ms:.3} ms after its flip"),
        format!(
            "response: off proportion by {off_percent:.1} % of white at most; patterns are corrected for it"
        ),
        format!("noise: {:.2} counts at half of white", noise.counts),
        format!("contrast: {}", contrast.words()),
    ];
    said.extend(notes);
    let figures = json!({
        "delay_ms": delay_ms, "stamp": timing.stamp, "nonlinear_percent": off_percent, "noise_counts": noise.counts, "contrast": by_pitch(contrast),
    });
    Outcome {
        said,
        ..Outcome::passed("", figures)
    }
}
