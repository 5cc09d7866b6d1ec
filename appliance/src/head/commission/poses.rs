//! The step `geometry`: poses of a board, one at a time, and the models made of them.

use super::file::{Commissioning, MAX_POSES, Models};
use super::outcome::{Outcome, parted};
use super::step::Subject;
use crate::head::board;
use crate::head::calibration::file::CalibrationFile;
use crate::head::capture::Shown;
use crate::head::geometry::{Geometry, SeenPose, same_place};
use crate::head::scale::Scale;
use crate::head::scan::take_loaded;
use crate::head::seam;
use algo::calibration::{Board, Corner, FoundBoard, Node, Picture, View};
use hal::bounds::{MAX_SIDE, length, within};
use hal::error::Error;
use hal::frame::Frame;
use serde::{Deserialize, Serialize};
use serde_json::json;
use std::time::Duration;

/// Longest wait for a frame.
const TIMEOUT: Duration = Duration::from_secs(5);
/// Most nodes of a pose: four in each square.
const MAX_NODES: usize = 1 << 16;

/// One pose, as it is kept: what its frames have shown.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PoseFile {
    /// Column, row and blur of each corner, px; none for one that was not located.
    pub corners: Vec<Option<[f64; 3]>>,
    /// Length of a square's side in the picture, px.
    pub step: f64,
    /// The projector's points on the board: u, v, ξ, η, px, and column and row of their square.
    pub nodes: Vec<[f64; 6]>,
    /// Why it cannot be used; none if it can.
    pub problem: Option<String>,
}

impl PoseFile {
    fn of(found: Option<&FoundBoard>, nodes: &[Node], problem: Option<String>) -> Self {
        let corner = |corner: &Corner| [corner.u, corner.v, corner.blur];
        let node = |node: &Node| {
            let (column, row) = node.square;
            let ((u, v), (xi, eta)) = (node.at, node.lit_by);
            [u, v, xi, eta, column as f64, row as f64]
        };
        let corners = found.map_or(&[][..], |found| &found.corners);
        Self {
            corners: corners
                .iter()
                .map(|found| found.as_ref().map(corner))
                .collect(),
            step: found.map_or(0.0, |found| found.step),
            nodes: nodes.iter().map(node).collect(),
            problem,
        }
    }

    /// Corners that were located.
    pub fn located(&self) -> usize {
        self.corners.iter().flatten().count()
    }

    pub(super) fn check(&self) -> Result<(), String> {
        let side = f64::from(MAX_SIDE);
        length("poses.nodes", self.nodes.len(), 0, MAX_NODES)?;
        within("poses.step", self.step, 0.0, side)?;
        for number in self.corners.iter().flatten().flatten() {
            within("poses.corners", *number, -side, 2.0 * side)?;
        }
        for number in self.nodes.iter().flatten() {
            within("poses.nodes", *number, -side, 2.0 * side)?;
        }
        Ok(())
    }

    fn seen(&self, number: u32, [columns, rows, bits, across, down]: [u32; 5]) -> SeenPose {
        let corner = |[u, v, blur]: [f64; 3]| Corner { u, v, blur };
        let node = |[u, v, xi, eta, column, row]: &[f64; 6]| Node {
            at: (*u, *v),
            lit_by: (*xi, *eta),
            square: (*column as usize, *row as usize),
        };
        SeenPose {
            recording: pose_name(number),
            frames: (columns, rows, bits as u8),
            raster: (across, down),
            view: View {
                found: FoundBoard {
                    corners: self.corners.iter().map(|found| found.map(corner)).collect(),
                    step: self.step,
                },
                nodes: self.nodes.iter().map(node).collect(),
            },
        }
    }
}

/// The name of a pose where recordings have theirs.
pub fn pose_name(number: u32) -> String {
    format!("pose {number}")
}

/// What the user knows of the board.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Solving {
    /// Length from the first to the last inner corner of the longer side, mm, by a ruler.
    pub check_length_mm: Option<f64>,
    /// σ of the board's scale, parts per million.
    pub board_sigma_ppm: f64,
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

    /// Forgets a pose, or all of them.
    pub(super) fn forget(&mut self, number: Option<u32>) -> Outcome {
        match number {
            None => self.poses.clear(),
            Some(number) => drop(self.poses.remove(&number)),
        }
        let left = self.poses.len();
        Outcome::passed(format!("{left} poses are kept"), json!({}))
    }

    /// Takes the frames of a pose, and keeps what they show: the poses of another board are
    /// forgotten then, unless this one cannot be used. Returns the white frame if it is kept.
    ///
    /// # Errors
    /// Of a device.
    pub(super) fn take_pose(
        &mut self,
        subject: &mut Subject<'_>,
        board: &Board,
        number: u32,
    ) -> Result<(Outcome, Option<Frame>), Error> {
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
            Err(problem) => {
                // What there is of the board is shown with the reason.
                let white = recording.white.as_ref();
                let view = white.and_then(|white| seam::view(white).ok());
                let found = view.and_then(|view| board.find(&Picture::mean(&[view])).ok());
                PoseFile::of(found.as_ref(), &[], Some(problem.clone()))
            }
        };
        let (located, of) = (pose.located(), board.columns * board.rows);
        let figures = json!({ "pose": number, "corners": located, "of": of });
        let name = board::name(board);
        let other = self.board.as_ref() != Some(&name);
        // Poses of another board are forgotten when there is one of this board.
        let kept = !other || seen.is_ok() || self.poses.is_empty();
        if kept {
            if other {
                self.poses.clear();
                self.board = Some(name);
            }
            self.poses.insert(number, pose);
        }
        let outcome = match seen {
            Ok(_) => Outcome {
                figures,
                ..Outcome::passed(
                    format!("pose {number}: {located} of {of} corners"),
                    json!({}),
                )
            },
            Err(problem) => Outcome {
                figures,
                ..Outcome::failed(
                    format!("pose {number} cannot be used: {problem}"),
                    parted(&problem).1,
                )
            },
        };
        Ok((outcome, recording.white.filter(|_| kept)))
    }

    /// A pose in which the board lies elsewhere than in all others that can be used.
    ///
    /// # Errors
    /// In words: it did not move.
    fn elsewhere(&self, board: &Board, number: u32, seen: SeenPose) -> Result<SeenPose, String> {
        if self.board.as_ref() != Some(&board::name(board)) {
            return Ok(seen);
        }
        let others: Vec<SeenPose> = self.usable(Some(number)).collect();
        match seen.again_in(&others) {
            None => Ok(seen),
            Some(other) => Err(format!(
                "{}: move and tilt it, then take the pose again",
                same_place(&other.recording)
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
    pub(super) fn solve(&mut self, before: Option<&CalibrationFile>, solving: Solving) -> Outcome {
        match self.solved(before, solving) {
            Err(problem) => Outcome::failed(&problem, &problem),
            Ok(models) => {
                let outcome = models.found(self.head);
                self.models = Some(models);
                outcome
            }
        }
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
