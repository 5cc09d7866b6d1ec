//! The step `geometry`: poses of a board, one at a time, and the models made of them.

use super::file::{Commissioning, MAX_POSES, Models};
use super::outcome::Outcome;
use super::pose::{PoseFile, pose_name};
use super::{PLANE, Subject};
use crate::error::{Exit, Failure, Result};
use crate::head::board;
use crate::head::calibration::file::CalibrationFile;
use crate::head::calibration::geometry::MAX_SIGMA_PPM;
use crate::head::capture::Shown;
use crate::head::geometry::{Geometry, SeenPose, same_place};
use crate::head::scale::{MAX_LENGTH_MM, MIN_LENGTH_MM, Scale};
use crate::head::scan::take_loaded;
use crate::head::seam;
use algo::calibration::{Board, GreyPicture};
use hal::bounded;
use hal::bounds::{Bound as _, Fields, OutOfBounds};
use hal::error::Error;
use serde_json::json;
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
pub enum Poses {
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
) -> Result<Option<Outcome>> {
    let before: Vec<SeenPose> = kept.usable(None).collect();
    let refused = match subject.poses {
        Some(Poses::Pose(board, number)) => kept.take_pose(subject, &board, number)?,
        Some(Poses::Forget(None)) => {
            kept.poses.clear();
            None
        }
        Some(Poses::Forget(Some(number))) => {
            kept.poses.remove(&number);
            None
        }
        Some(Poses::Solve(solving)) => return kept.solve(subject, solving).map(Some),
        None => return kept.solve(subject, Solving::default()).map(Some),
    };
    // Models are those of all poses that can be used, or there are none.
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
    ) -> Result<Option<Outcome>> {
        if self.measured.is_none() && !subject.calibrated {
            return Err(Failure::because(
                Exit::Content,
                "a pose needs the head's delay and response",
                "do the step timing first",
            ));
        }
        let unfit = |words: String| Error::unsupported(words, "use a projector of more pixels");
        let shown = Shown::pose(subject.calibration).map_err(unfit)?;
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
            Ok(pose) => PoseFile::of(Some(&pose.view.found), &pose.view.nodes, None),
            Err(failure) => {
                // What there is of the board is shown with the reason.
                let white = recording.white.as_ref();
                let view = white.and_then(|white| seam::view(white).ok());
                let found = view.and_then(|view| board.find(&GreyPicture::mean(&[view])).ok());
                PoseFile::of(found.as_ref(), &[], Some(failure.to_string()))
            }
        };
        let figures = json!({
            "pose": number, "corners": pose.located(), "of": board.columns * board.rows,
        });
        let name = board::name(board);
        let other = self.board.as_ref() != Some(&name);
        // Poses of another board are forgotten when there is one of this board.
        if !other || seen.is_ok() || self.poses.is_empty() {
            if other {
                self.poses.clear();
                self.board = Some(name);
            }
            self.poses.insert(number, pose);
            subject.white = recording.white;
        }
        Ok(seen.err().map(|failure| Outcome {
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
    fn solve(&mut self, subject: &Subject<'_>, solving: Solving) -> Result<Outcome> {
        (subject.progress)(0.1, "adjusting the models");
        let models = self
            .solved(subject.before.as_ref(), solving)
            .map_err(Exit::Content.failure())?;
        let outcome = models.found(self.head);
        self.models = Some(models);
        // The plane was measured with other models.
        self.steps.remove(PLANE);
        Ok(outcome)
    }

    fn solved(&self, before: Option<&CalibrationFile>, solving: Solving) -> Result<Models, String> {
        let Some(name) = &self.board else {
            return Err("no pose was taken: take at least 3, better 10".into());
        };
        let board = board::parse(name)?;
        Scale::check_length(&board, solving.check_length_mm)?;
        let poses: Vec<SeenPose> = self.usable(None).take(MAX_POSES).collect();
        let geometry = Geometry::of(&board, solving.board_sigma_ppm, &poses)?;
        let scale = Scale::of(solving.check_length_mm, before, &geometry.file)?;
        Ok(Models {
            camera: seam::device_model(&geometry.camera),
            projector: seam::device_model(&geometry.projector),
            geometry: geometry.file,
            frame_covered: geometry.frame_covered,
            tilt_degrees: geometry.tilt_degrees,
            scale,
        })
    }
}
