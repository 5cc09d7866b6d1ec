//! The geometry of a head from recordings of a checkerboard: one pose at a time, then all together.

use super::board::Ground;
use super::calibration::geometry::{BoardFile, GeometryFile, PoseFile};
use super::channel::Channel;
use super::code::CodeAlone;
use super::seam;
use crate::error::{Exit, Failure, Result};
use algo::calibration::{
    Adjusted, Arrow, Board, BoardView, CalibrationError, FoundBoard, FringeMaps, GreyPicture,
    MeasuredBoard, Prediction, Residuals, calibrate, look,
};
use algo::geometry::Pinhole;
use algo::phase::LeastModulation;
use algo::pipeline::PhaseMap;
use hal::replay::Recording;
use hal::replay::recording::PatternSpec;

/// Columns and rows of the frame that are looked at for corners.
pub const CELLS: (usize, usize) = (8, 6);
/// Least and largest width of what a camera sees of a board's plane, mm. No head has less, and a
/// board whose size is stated in metres is a thousand times as large.
const VIEW_MM: (f64, f64) = (5.0, 1e5);

/// One pose of the board, as a head saw it.
#[derive(Clone, Debug, PartialEq)]
pub struct SeenPose {
    /// Name of its recording.
    pub recording: String,
    /// What tells its head apart, as [`Calibration::sizes`](super::calibration::Calibration::sizes).
    pub head: [u32; 5],
    /// Corners and projector points.
    pub view: BoardView,
}

impl SeenPose {
    /// Finds the board in a recording with vertical and horizontal fringes, or Gray codes alone.
    ///
    /// # Errors
    /// What the recording lacks, or why the pose cannot be used (65).
    pub fn of(recording: &Recording, name: &str, board: &Board) -> Result<Self> {
        let fringes = |vertical: bool| {
            let wanted = |spec: &PatternSpec| match spec {
                PatternSpec::Vertical { fringes } if vertical => Some(*fringes),
                PatternSpec::Horizontal { fringes } if !vertical => Some(*fringes),
                _ => None,
            };
            let mut patterns = recording.patterns.iter().enumerate();
            let found = patterns.find_map(|(at, spec)| Some((at, wanted(spec)?)));
            let direction = if vertical { "vertical" } else { "horizontal" };
            found.ok_or_else(|| {
                Failure::because(
                    Exit::Content,
                    format!("it has no {direction} fringes"),
                    "both directions are needed, each with all of its levels",
                )
            })
        };
        let (vertical, horizontal) = (fringes(true)?, fringes(false)?);
        let mut levels = Vec::new();
        let mut decoded = |pattern| decoded(recording, pattern, &mut levels);
        let (vertical_map, horizontal_map) = (decoded(vertical.0)?, decoded(horizontal.0)?);
        let projector = &recording.projector;
        let raster = (projector.width, projector.height);
        let fringes = FringeMaps {
            vertical: &vertical_map,
            horizontal: &horizontal_map,
            pitch: (
                f64::from(raster.0) / vertical.1,
                f64::from(raster.1) / horizontal.1,
            ),
        };
        let view = look(board, &levels, &fringes)
            .map_err(|error| Failure::because(Exit::Content, error, error.remedy()))?;
        sized(board, &view.found, recording.width)?;
        let bits = u32::from(recording.bit_depth);
        Ok(Self {
            recording: name.to_owned(),
            head: [recording.width, recording.height, bits, raster.0, raster.1],
            view,
        })
    }

    /// The first of some poses in which the board lies where it lies in this pose.
    pub fn again_in<'a>(&self, others: impl IntoIterator<Item = &'a Self>) -> Option<&'a Self> {
        let same = |other: &&Self| self.view.found.lies_as_in(&other.view.found);
        others.into_iter().find(same)
    }
}

/// What is wrong with a pose in which the board lies where it lies in another one.
pub fn same_place(other: &str) -> String {
    format!("the board lies where it lies in {other}")
}

/// The absolute phases of one pattern of a recording, and the offset of each of its levels, or of
/// its code.
fn decoded(
    recording: &Recording,
    pattern: usize,
    levels: &mut Vec<GreyPicture>,
) -> Result<PhaseMap> {
    if let Some(code) = CodeAlone::of(recording, pattern)? {
        levels.push(GreyPicture::mean(&code.even()));
        return Ok(code.phases(LeastModulation::default())?);
    }
    // Not the least of the camera's noise: in black squares the light of bright ones around them
    // would have a phase, which is not the place's.
    let channel = Channel::new(recording, pattern, LeastModulation::default())?;
    let none = Err("the models are to be made".into());
    let unwrapping = channel.unwrapping(None, &none)?;
    if unwrapping.missing().is_some() {
        return Exit::Content.fail(format!(
            "levels of ratios {:?} have no absolute phase by themselves: take geometric ones, the coarsest of at most one fringe, \
             levels with a chain of beats, or a Gray code",
            channel.ratios()
        ));
    }
    let scan = &channel.scan;
    for level in scan.sequence.levels() {
        let frames = level.frames.iter().map(|&at| scan.frames[usize::from(at)]);
        levels.push(GreyPicture::mean(&frames.collect::<Vec<_>>()));
    }
    Ok(channel.decode(&unwrapping)?.absolute)
}

/// Checks that a board of such squares can lie in front of a head.
///
/// # Errors
/// By their size and their picture, the camera sees less than a head can, or more.
fn sized(board: &Board, found: &FoundBoard, columns: u32) -> Result<()> {
    let square = board.square;
    let across = square * f64::from(columns) / found.step;
    let (distance, unit, factor) = match across {
        across if across < VIEW_MM.0 => ("near", "metres", 1e3),
        across if across > VIEW_MM.1 => ("far", "micrometres", 1e-3),
        _ => return Ok(()),
    };
    Err(Failure::because(
        Exit::Content,
        format!(
            "squares of {square} mm would lie so {distance} that the camera's picture is {across:.2} mm wide there"
        ),
        format!(
            "state the side of a square in mm, {} if {square} is in {unit}",
            square * factor
        ),
    ))
}

/// Models of camera and projector from poses of a board.
#[derive(Clone, Debug)]
pub struct Geometry {
    /// The camera, with the board's last pose as z = 0.
    pub camera: Pinhole,
    /// The projector.
    pub projector: Pinhole,
    /// What calibration.json keeps.
    pub file: GeometryFile,
    /// Predicted errors of measurements.
    pub prediction: Prediction,
    /// The board in each pose, as the calibrated head measures it.
    pub measured: Vec<Option<MeasuredBoard>>,
    /// The residuals of each pose: of its corners in the camera, and of its points in the
    /// projector.
    pub arrows: Vec<[Vec<Arrow>; 2]>,
    /// The last pose, which is z = 0.
    pub ground: Ground,
    /// Largest angle between the board in two poses, degrees.
    pub tilt_degrees: f64,
    /// Share of the camera's frame in which there were corners.
    pub frame_covered: f64,
}

impl Geometry {
    /// Adjusts all poses together. `sigma_ppm` is σ of the board's scale.
    ///
    /// # Errors
    /// The poses are of different heads, do not determine
    /// the models, or do not fit each other.
    pub fn of(board: &Board, sigma_ppm: f64, poses: &[SeenPose]) -> Result<Self> {
        let Some(first) = poses.first() else {
            return Exit::Content.fail(CalibrationError::Few { given: 0 });
        };
        let other = |pose: &&SeenPose| pose.head != first.head;
        if let Some(other) = poses.iter().find(other) {
            return Exit::Content.fail(format!(
                "{}: its frames or its projector's raster have another size than those of {}: calibrate with recordings of one head",
                other.recording, first.recording
            ));
        }
        let places = poses.iter().enumerate();
        let again = places.filter_map(|(at, pose)| Some((pose.again_in(&poses[..at])?, pose)));
        if let Some((before, pose)) = again.into_iter().next() {
            return Exit::Content.fail(format!(
                "{}: {}: leave it out, or take it again with the board elsewhere and tilted",
                pose.recording,
                same_place(&before.recording)
            ));
        }
        let [width, height, _, columns, rows] = first.head.map(|size| size as usize);
        let (frame, raster) = ((width, height), (columns, rows));
        let views: Vec<BoardView> = poses.iter().map(|pose| pose.view.clone()).collect();
        let blame = |error: CalibrationError| match error.pose() {
            Some(pose) => {
                Failure::new(Exit::Content, format!("{}: {error}", poses[pose].recording))
            }
            None => Failure::new(Exit::Content, error),
        };
        let adjusted = calibrate(board, frame, &views).map_err(blame)?;
        let last = poses.len() - 1;
        let (camera, projector) = adjusted.rig.models(last);
        let checked = |device, model, (columns, rows)| {
            let checked = Pinhole::new(model, columns, rows);
            checked.map_err(|error| seam::absurd(device, &error))
        };
        let camera = checked("camera", camera, frame)?;
        let projector = checked("projector", projector, raster)?;
        let baseline = (projector.centre() - camera.centre()).length();
        let Some(prediction) = adjusted.prediction(frame, raster, sigma_ppm * 1e-6) else {
            return Exit::Content.fail("camera and projector see no part of the volume of all poses together: place the board where both see it");
        };
        let file = file(board, sigma_ppm, poses, &adjusted, &prediction, baseline);
        Ok(Self {
            ground: Ground {
                pose: poses[last].recording.clone(),
                standing: adjusted.rig.standing(last),
            },
            camera,
            projector,
            file,
            prediction,
            measured: views
                .iter()
                .enumerate()
                .map(|(at, view)| adjusted.measured_board(at, view))
                .collect(),
            arrows: views
                .iter()
                .enumerate()
                .map(|(at, view)| adjusted.arrows(at, view))
                .collect(),
            tilt_degrees: adjusted.largest_tilt().to_degrees(),
            frame_covered: covered(
                frame,
                views
                    .iter()
                    .flat_map(|view| view.found.corners.iter().flatten())
                    .map(|corner| (corner.u, corner.v)),
            ),
        })
    }
}

fn file(
    board: &Board,
    sigma_ppm: f64,
    poses: &[SeenPose],
    adjusted: &Adjusted,
    prediction: &Prediction,
    baseline: f64,
) -> GeometryFile {
    let all = |device: usize| {
        let each = adjusted.residuals.iter().map(|pose| pose[device]);
        each.fold(Residuals::default(), |sum, pose| sum.and(&pose))
            .rms()
    };
    let pose = |(at, pose): (usize, &SeenPose)| PoseFile {
        recording: pose.recording.clone(),
        corners: pose.view.found.located(),
        camera_px: adjusted.residuals[at][0].rms(),
        projector_px: adjusted.residuals[at][1].rms(),
        tilt_degrees: adjusted.rig.tilt(at).to_degrees(),
        distance_mm: adjusted.rig.poses[at].shift.length(),
    };
    GeometryFile {
        board: BoardFile {
            columns: board.columns,
            rows: board.rows,
            square_mm: board.square,
            sigma_ppm,
            bow_mm: adjusted.rig.bow,
        },
        baseline_mm: baseline,
        camera_px: all(0),
        projector_px: all(1),
        height_sigma_mm: prediction.height,
        length_sigma_mm: prediction.length,
        poses: poses.iter().enumerate().map(pose).collect(),
    }
}

/// Share of the cells of the frame in which a corner was seen.
pub fn covered((width, height): (usize, usize), corners: impl Iterator<Item = (f64, f64)>) -> f64 {
    let mut seen = [false; CELLS.0 * CELLS.1];
    for (u, v) in corners {
        let cell = |at: f64, size: usize, cells: usize| {
            let cell = at / size.max(1) as f64 * cells as f64;
            (cell.max(0.0) as usize).min(cells - 1)
        };
        let row = cell(v, height, CELLS.1);
        seen[row * CELLS.0 + cell(u, width, CELLS.0)] = true;
    }
    seen.iter().filter(|seen| **seen).count() as f64 / seen.len() as f64
}
