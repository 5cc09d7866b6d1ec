//! The step `geometry`: poses of a board, one at a time, the models made of them, and how the board lies
//! in the poses: its tilts, and whether the last one can be z = 0. It is known about before the models
//! are made, and well by them.

use super::kept::{Commissioning, KeptPose, MAX_POSES, PoseModels, pose_name};
use super::{PLANE, StepOutcome, Subject};
use crate::error::{Exit, Failure, Result};
use crate::head::board::{Ground, MAX_LENGTH_MM, MIN_LENGTH_MM, Scale};
use crate::head::calibration::file::CalibrationFile;
use crate::head::calibration::geometry::MAX_SIGMA_PPM;
use crate::head::geometry::{Geometry, SeenPose, same_place};
use crate::head::rasters::ShownPictures;
use crate::head::scan::take_loaded;
use crate::head::{board, seam};
use algo::calibration::{Board, BoardView, GreyPicture, estimate};
use hal::bounded;
use hal::bounds::{Bound as _, Fields, OutOfBounds};
use hal::error::Error;
use serde_json::json;
use std::collections::BTreeMap;
use std::time::Duration;

/// Longest wait for a frame.
const TIMEOUT: Duration = Duration::from_secs(5);

bounded! {
    /// What the user knows of the board.
    #[derive(Copy)]
    pub struct Solving: Default {
        /// Length from the first to the last inner corner of the longer side, mm, by a ruler.
        pub check_length_mm: Option<f64> = MIN_LENGTH_MM..=MAX_LENGTH_MM,
        /// σ of the board's scale, parts per million.
        pub board_sigma_ppm: f64 = 0.0..=MAX_SIGMA_PPM,
    }
}

impl Solving {
    /// Checks the bounds.
    ///
    /// # Errors
    /// In words that name the key.
    pub fn check(&self) -> Result<(), OutOfBounds> {
        Fields.check("", self)
    }
}

/// What the step does.
#[derive(Clone, Copy, Debug)]
pub enum PoseAction {
    /// A pose of this board is taken under this number.
    Pose(Board, u32),
    /// A pose, or all of them, is forgotten.
    Forget(Option<u32>),
    /// The models are made of the poses.
    Solve(Solving),
}

pub(super) fn measure(
    subject: &mut Subject<'_>,
    kept: &mut Commissioning,
) -> Result<Option<StepOutcome>> {
    let before: Vec<SeenPose> = kept.usable(None).collect();
    let refused = match subject.poses {
        Some(PoseAction::Pose(board, number)) => kept.take_pose(subject, &board, number)?,
        Some(PoseAction::Forget(None)) => {
            kept.poses.clear();
            None
        }
        Some(PoseAction::Forget(Some(number))) => {
            kept.poses.remove(&number);
            None
        }
        Some(PoseAction::Solve(solving)) => return kept.solve(subject, solving).map(Some),
        None => return kept.solve(subject, Solving::default()).map(Some),
    };
    // PoseModels are those of all poses that can be used, or there are none.
    if kept.usable(None).ne(before) {
        kept.models = None;
    }
    Ok(refused.or_else(|| Some(kept.models.as_ref()?.found(kept.head))))
}

impl Commissioning {
    /// The first number without a pose that can be used.
    pub fn free_pose(&self) -> u32 {
        let taken = |number: &u32| {
            let pose = self.poses.get(number);
            pose.is_some_and(|pose| pose.problem.is_none())
        };
        (1..).find(|number| !taken(number)).unwrap_or(1)
    }

    /// Takes the frames of a pose, and keeps what they show: the poses of another board are
    /// forgotten then, unless this one cannot be used, which is the outcome.
    ///
    /// # Errors
    /// Of a device; the head was not measured yet.
    fn take_pose(
        &mut self,
        subject: &mut Subject<'_>,
        board: &Board,
        number: u32,
    ) -> Result<Option<StepOutcome>> {
        if self.measured.is_none() && !subject.calibrated {
            return Err(Failure::because(
                Exit::Content,
                "a pose needs the head's delay and response",
                "do the step timing first",
            ));
        }
        let unfit = |error: Failure| {
            Error::unsupported(error.to_string(), "use a projector of more pixels")
        };
        let shown = ShownPictures::pose(subject.calibration).map_err(unfit)?;
        let rasters = shown.rasters(subject.calibration)?;
        let all = rasters.len();
        subject.head.load(rasters)?;
        let said = |share: f64| (subject.progress)(0.6 * share, "taking the frames");
        let taken = take_loaded(subject.head, all, TIMEOUT, &said)?;
        (subject.progress)(0.6, "looking for the board");
        let recording = shown.recording(subject.calibration, &mut taken.into_iter());
        let seen = SeenPose::of(&recording, &pose_name(number), board)
            .and_then(|seen| self.elsewhere(board, number, seen));
        let pose = match &seen {
            Ok(pose) => KeptPose::of(Some(&pose.view.found), &pose.view.nodes, None),
            Err(failure) => {
                // What there is of the board is shown with the reason.
                let white = recording.white.as_ref();
                let view = white.and_then(|white| seam::view(white).ok());
                let found = view.and_then(|view| board.find(&GreyPicture::mean(&[view])).ok());
                KeptPose::of(found.as_ref(), &[], Some(failure.to_string()))
            }
        };
        let figures = json!({
            "pose": number, "corners": pose.located(), "of": board.columns * board.rows,
        });
        let name = board::name(board);
        let is_another = self.board.as_ref() != Some(&name);
        // PoseAction of another board are forgotten when there is one of this board.
        if !is_another || seen.is_ok() || self.poses.is_empty() {
            if is_another {
                self.poses.clear();
                self.board = Some(name);
            }
            self.poses.insert(number, pose);
            subject.white = recording.white;
        }
        Ok(seen.err().map(|failure| StepOutcome {
            said: vec![format!("pose {number} cannot be used: {failure}")],
            figures,
            ..failure.into()
        }))
    }

    /// A pose in which the board lies elsewhere than in all others that can be used.
    ///
    /// # Errors
    /// It did not move.
    fn elsewhere(&self, board: &Board, number: u32, seen: SeenPose) -> Result<SeenPose> {
        if self.board.as_ref() != Some(&board::name(board)) {
            return Ok(seen);
        }
        let others: Vec<SeenPose> = self.usable(Some(number)).collect();
        match seen.again_in(&others) {
            None => Ok(seen),
            Some(other) => Err(Failure::because(
                Exit::Content,
                same_place(&other.recording),
                "move and tilt it, then take the pose again",
            )),
        }
    }

    /// The poses that can be used, without this one.
    pub(super) fn usable(&self, without: Option<u32>) -> impl Iterator<Item = SeenPose> {
        let usable = self
            .poses
            .iter()
            .filter(move |(number, pose)| pose.problem.is_none() && Some(**number) != without);
        usable.map(|(number, pose)| pose.seen(*number, self.head))
    }

    /// Makes the models of all poses that can be used.
    fn solve(&mut self, subject: &Subject<'_>, solving: Solving) -> Result<StepOutcome> {
        (subject.progress)(0.1, "adjusting the models");
        let models = self.solved(subject.before.as_ref(), solving)?;
        let outcome = models.found(self.head);
        self.models = Some(models);
        // The plane was measured with other models.
        self.steps.remove(PLANE);
        Ok(outcome)
    }

    fn solved(&self, before: Option<&CalibrationFile>, solving: Solving) -> Result<PoseModels> {
        let Some(name) = &self.board else {
            return Exit::Content.fail("no pose was taken: take at least 3, better 10");
        };
        let board = board::parse(name)?;
        let length = solving.check_length_mm;
        Scale::check_length(&board, length)?;
        let poses: Vec<SeenPose> = self.usable(None).take(MAX_POSES).collect();
        let geometry = Geometry::of(&board, solving.board_sigma_ppm, &poses)?;
        let scale = Scale::of(length, before, &geometry.file)?;
        Ok(PoseModels {
            camera: seam::device_model(&geometry.camera),
            projector: seam::device_model(&geometry.projector),
            geometry: geometry.file,
            frame_covered: geometry.frame_covered,
            tilt_degrees: geometry.tilt_degrees,
            scale,
        })
    }
}

/// How the board lies.
#[derive(Clone, Debug, Default)]
pub struct Laid {
    /// Angle between the board's normal and the camera's axis by the name of the pose, degrees.
    pub tilts: BTreeMap<String, f64>,
    /// The pose that z = 0 goes by, if it is known how the board stands in it.
    pub ground: Option<Ground>,
}

impl Commissioning {
    /// How the board lies in the poses that can be used.
    pub fn laid(&self) -> Laid {
        match &self.models {
            Some(models) => {
                let poses = models.geometry.poses.iter();
                Laid {
                    tilts: poses
                        .map(|pose| (pose.recording.clone(), pose.tilt_degrees))
                        .collect(),
                    ground: models.ground(self.head),
                }
            }
            None => self.estimated().unwrap_or_default(),
        }
    }

    fn estimated(&self) -> Option<Laid> {
        let board = board::parse(self.board.as_deref()?).ok()?;
        let [columns, rows, ..] = self.head.map(|size| size as usize);
        let (names, views): (Vec<String>, Vec<BoardView>) = self
            .usable(None)
            .map(|pose| (pose.recording, pose.view))
            .unzip();
        let rig = estimate(&board, (columns, rows), &views)?;
        let last = names.len() - 1;
        Some(Laid {
            ground: Some(Ground {
                pose: names[last].clone(),
                standing: rig.standing(last),
            }),
            tilts: names
                .into_iter()
                .enumerate()
                .map(|(at, name)| (name, rig.tilt(at).to_degrees()))
                .collect(),
        })
    }
}

impl Laid {
    /// The tilt in a pose, degrees.
    pub fn tilt(&self, number: u32) -> Option<f64> {
        self.tilts.get(&pose_name(number)).copied()
    }
}

impl PoseModels {
    /// The pose that z = 0 goes by.
    pub fn ground(&self, [columns, rows, _, across, down]: [u32; 5]) -> Option<Ground> {
        let camera = seam::pinhole("camera", &self.camera, (columns, rows)).ok()?;
        let projector = seam::pinhole("projector", &self.projector, (across, down)).ok()?;
        let last = self.geometry.poses.last()?;
        Some(Ground::of(&last.recording, &camera, &projector))
    }

    /// What the step that made them has found.
    pub(super) fn found(&self, head: [u32; 5]) -> StepOutcome {
        let file = &self.geometry;
        let residuals = format!(
            "residuals camera {:.3} px, projector {:.3} px RMS over {} poses; σ of heights {:.4} mm, of a length of 100 mm {:.4} mm",
            file.camera_px,
            file.projector_px,
            file.poses.len(),
            file.height_sigma_mm,
            file.length_sigma_mm
        );
        let ground = self.ground(head);
        let said = [residuals]
            .into_iter()
            .chain(ground.as_ref().map(Ground::words));
        let figures = json!({
            "camera_px": file.camera_px, "projector_px": file.projector_px, "height_sigma_mm": file.height_sigma_mm,
            "length_sigma_mm": file.length_sigma_mm, "poses": file.poses.len(),
        });
        StepOutcome {
            remedy: ground.as_ref().and_then(Ground::remedy),
            ..StepOutcome::passed(said, figures)
        }
    }
}
