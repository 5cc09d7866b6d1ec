//! `fringed calibrate --board … --poses …`: the models of camera and projector from recordings of a
//! checkerboard.

use super::super::names;
use super::super::numbers::number;
use super::super::options::Measuring;
use super::report::poses::Report;
use super::{FULL, before};
use crate::error::{Exit, Failure, Result};
use crate::head::board;
use crate::head::calibration::file::CalibrationFile;
use crate::head::calibration::geometry::{MAX_POSES, MAX_SIGMA_PPM};
use crate::head::calibration::place::Place;
use crate::head::geometry::{CELLS, Geometry, SeenPose};
use crate::head::scale::{MAX_LENGTH_MM, MIN_LENGTH_MM, Scale};
use crate::output::residuals::{arrows_png, coverage_png};
use crate::storage::archive::Unpacked;
use crate::storage::folder::OutputFolder;
use crate::storage::state::StateFolder;
use algo::calibration::{Arrow, Board};
use hal::replay::Recording;
use rayon::prelude::*;
use std::path::{Path, PathBuf};

/// Models from recordings of a board.
#[derive(Debug, clap::Args)]
pub struct Poses {
    /// Make the models from recordings of this board: checker:COLUMNSxROWS:MM, counted in inner
    /// corners, MM the side of a square.
    #[arg(long, value_name = "BOARD", value_parser = board::parse)]
    board: Option<Board>,
    /// Recordings of the board, each with vertical and horizontal fringes; in the last the board
    /// lies in the plane z = 0.
    #[arg(long, value_name = "RECORDING", num_args = 1..)]
    poses: Vec<PathBuf>,
    /// Write the calibration to this file instead of the station's.
    #[arg(long, value_name = "FILE", value_parser = names::file("json"))]
    pub out: Option<PathBuf>,
    /// Write pictures to this folder: the residuals of camera and projector as arrows × 200, and
    /// where in the frame corners were seen.
    #[arg(long, value_name = "DIR", value_parser = names::folder())]
    pictures: Option<PathBuf>,
    /// σ of the board's scale in parts per million, as its maker or a ruler gives it; counts
    /// towards σ of heights and lengths.
    #[arg(long, value_name = "PPM", value_parser = number(0.0, MAX_SIGMA_PPM))]
    board_sigma_ppm: Option<f64>,
    /// Length on the board from its first to its last inner corner along the longer side, as
    /// measured with a ruler.
    #[arg(long, value_name = "MM", value_parser = number(MIN_LENGTH_MM, MAX_LENGTH_MM))]
    check_length: Option<f64>,
}

impl Poses {
    /// Whether the models are to come from a board.
    pub fn given(&self) -> bool {
        let beside = [self.board_sigma_ppm, self.check_length];
        let named = self.board.is_some() || !self.poses.is_empty() || self.pictures.is_some();
        named || beside.iter().any(Option::is_some)
    }

    /// Makes the models, writes the calibration and prints the report.
    ///
    /// # Errors
    /// If options are missing (64), a recording is missing (66), a pose cannot be used or the poses
    /// do not fit (65), or the calibration cannot be written (73). The calibration before is then
    /// unchanged.
    pub fn run(&self, options: &Measuring) -> Result<()> {
        let Some(board) = self.board.as_ref().filter(|_| !self.poses.is_empty()) else {
            let words = "calibrate: models are made of a board in several poses: name both with --board and --poses, or leave out --pictures, --check-length and --board-sigma-ppm";
            return Exit::Usage.fail(words);
        };
        let config = options.files.configuration()?;
        // The station's calibration is locked until it is written.
        let state = match self.out {
            Some(_) => None,
            None => Some(StateFolder::open(&options.files.state_folder()?)?),
        };
        let head = state.as_ref().map(|state| config.head_in(state.path()));
        let stored = head.as_ref().and_then(|head| head.calibration.as_deref());
        let place = Place::at(self.out.as_deref().or(stored).unwrap_or(Path::new("")));
        let mut notes = Vec::new();
        let before = before(&place, &mut notes);
        Scale::check_length(board, self.check_length).map_err(|error| content(&error))?;
        let progress = options.output.progress();
        progress.tell(0.0, "looking for the board");
        let pool = options.threads.pool(config.threads)?;
        let seen = pool.install(|| self.seen(board));
        progress.clear();
        let poses = seen?;
        let geometry = Geometry::of(board, self.board_sigma_ppm.unwrap_or(0.0), &poses)
            .map_err(|error| content(&error))?;
        let head = &poses[0];
        if let Some(folder) = &self.pictures {
            draw(&OutputFolder::create(folder)?, head, &geometry)?;
        }
        let same = before.as_ref().filter(|before| before.sizes() == head.head);
        let scale =
            Scale::of(self.check_length, same, &geometry.file).map_err(|error| content(&error))?;
        if same.is_some_and(|before| before.reference.is_some()) {
            notes.push("the reference plane was measured with other models: run `fringed calibrate` with a plate".into());
        }
        notes.extend(geometry.ground.remedy());
        let sealed = file(head, board, &geometry, same).sealed();
        let (file, bytes) = sealed.map_err(|error| content(&error))?;
        place.save(&bytes, &[], FULL)?;
        let report = Report {
            file: &file,
            geometry: &geometry,
            seen: &poses,
            scale,
            before: before.as_ref().map(|file| file.fingerprint.as_str()),
            place: place.path(),
            notes: &notes,
        };
        options.output.answer(&report.json(), || report.table())
    }

    /// The board in each recording.
    fn seen(&self, board: &Board) -> Result<Vec<SeenPose>> {
        if self.poses.len() > MAX_POSES {
            let words = format!("{} poses: at most {MAX_POSES} are used", self.poses.len());
            return Err(content(&words));
        }
        let seen = |path: &PathBuf| {
            let unpacked = Unpacked::of(path)?;
            let recording = Recording::open(unpacked.folder())?;
            let name = path.file_name().map(|name| name.to_string_lossy());
            let name = name.unwrap_or_else(|| path.to_string_lossy());
            SeenPose::of(&recording, &name, board)
                .map_err(|error| content(&format!("{}: {error}", path.display())))
        };
        // The first pose that fails is named, in whatever order they end.
        let each: Vec<Result<SeenPose>> = self.poses.par_iter().map(seen).collect();
        each.into_iter().collect()
    }
}

fn content(words: &str) -> Failure {
    Failure::new(Exit::Content, format!("calibrate: {words}"))
}

/// Draws residuals and coverage.
fn draw(folder: &OutputFolder, head: &SeenPose, geometry: &Geometry) -> Result<()> {
    let [width, height, _, columns, rows] = head.head.map(|size| size as usize);
    let frame = (width, height);
    let of = |device: usize| -> Vec<&[Arrow]> {
        let poses = geometry.arrows.iter();
        poses.map(|pose| pose[device].as_slice()).collect()
    };
    let [camera, projector] = [of(0), of(1)];
    let drawn = [
        ("camera.png", arrows_png("camera", frame, &camera)),
        (
            "projector.png",
            arrows_png("projector", (columns, rows), &projector),
        ),
        ("coverage.png", coverage_png(frame, CELLS, &camera)),
    ];
    drawn
        .iter()
        .try_for_each(|(name, bytes)| folder.write(name, bytes))
}

/// The calibration with these models. What the one before has measured on the head stays, without
/// the reference plane.
fn file(
    head: &SeenPose,
    board: &Board,
    geometry: &Geometry,
    before: Option<&CalibrationFile>,
) -> CalibrationFile {
    let from = format!(
        "{} poses of {}",
        geometry.file.poses.len(),
        board::name(board)
    );
    let (camera, projector) = (&geometry.camera, &geometry.projector);
    CalibrationFile {
        timing: before.and_then(|file| file.timing.clone()),
        noise: before.and_then(|file| file.noise.clone()),
        response: before.and_then(|file| file.response.clone()),
        contrast: before.and_then(|file| file.contrast.clone()),
        geometry: Some(geometry.file.clone()),
        ..CalibrationFile::of_models(head.head[2] as u8, camera, projector, from)
    }
}
