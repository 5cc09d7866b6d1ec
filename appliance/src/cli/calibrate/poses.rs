//! A checkerboard: `fringed board --out board.pdf` draws it to print, and `fringed calibrate --board …
//! --poses …` makes the models of camera and projector from recordings of it.

use super::{FULL, before};
use crate::cli::names;
use crate::cli::numbers::number;
use crate::cli::options::{Measuring, Quiet};
use crate::error::{Exit, Failure, Result};
use crate::head::board;
use crate::head::board::{MAX_LENGTH_MM, MIN_LENGTH_MM, Scale};
use crate::head::calibration::file::CalibrationFile;
use crate::head::calibration::geometry::{MAX_POSES, MAX_SIGMA_PPM};
use crate::head::calibration::place::CalibrationPlace;
use crate::head::geometry::{CELLS, Geometry, SeenPose};
use crate::output::board::sheet;
use crate::output::picture::{arrows_png, coverage_png};
use crate::storage::archive::Unpacked;
use crate::storage::folder::{OutputFolder, write_whole};
use crate::storage::state::StateFolder;
use algo::calibration::{Arrow, Board};
use hal::replay::Recording;
use rayon::prelude::*;
use serde_json::{Value, json};
use std::fmt::{Display, Write as _};
use std::path::{Path, PathBuf};

/// Draw a checkerboard to print.
#[derive(Debug, clap::Args)]
pub struct Print {
    /// The board: checker:COLUMNSxROWS:MM, counted in inner corners, MM the side of a square.
    #[arg(long, value_name = "BOARD", value_parser = board::parse, default_value = "checker:9x13:10")]
    board: Board,
    /// The file.
    #[arg(long, value_name = "FILE", value_parser = names::file("pdf"))]
    out: PathBuf,
    #[command(flatten)]
    quiet: Quiet,
}

impl Print {
    /// Writes the file.
    ///
    /// # Errors
    /// If no paper holds the board (64), or the file cannot be written (73).
    pub fn run(&self) -> Result<()> {
        let place = self.out.display();
        let sheet = sheet(&self.board).map_err(Exit::Usage.because(format!("draw {place}")))?;
        let remedy = "free space, or name another file";
        write_whole(&self.out, &sheet.pdf)
            .map_err(Exit::CannotCreate.advising(format!("write {place}"), remedy))?;
        self.quiet.say(|| {
            format!(
                "{place}: print it on {} at 100 %, glue it on something flat, and measure it",
                sheet.paper
            )
        });
        Ok(())
    }
}

/// Models from recordings of a board.
#[derive(Debug, clap::Args)]
pub struct BoardOptions {
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

impl BoardOptions {
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
        let place = CalibrationPlace::at(self.out.as_deref().or(stored).unwrap_or(Path::new("")));
        let mut notes = Vec::new();
        let before = before(&place, &mut notes);
        Scale::check_length(board, self.check_length).map_err(content)?;
        let progress = options.output.progress();
        progress.tell(0.0, "looking for the board");
        let pool = options.threads.pool(config.threads)?;
        let seen = pool.install(|| self.seen(board));
        progress.clear();
        let poses = seen?;
        let geometry =
            Geometry::of(board, self.board_sigma_ppm.unwrap_or(0.0), &poses).map_err(content)?;
        let head = &poses[0];
        if let Some(folder) = &self.pictures {
            draw(&OutputFolder::create(folder)?, head, &geometry)?;
        }
        let same = before.as_ref().filter(|before| before.sizes() == head.head);
        let scale = Scale::of(self.check_length, same, &geometry.file).map_err(content)?;
        if same.is_some_and(|before| before.reference.is_some()) {
            notes.push("the reference plane was measured with other models: run `fringed calibrate` with a plate".into());
        }
        notes.extend(geometry.ground.remedy());
        let sealed = file(head, &geometry, same).sealed();
        let (file, bytes) = sealed.map_err(content)?;
        place.save(&bytes, &[], FULL)?;
        let report = PosesReport {
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
            return Err(content(words));
        }
        let seen = |path: &PathBuf| {
            let unpacked = Unpacked::of(path)?;
            let recording = Recording::open(unpacked.folder())?;
            let name = path.file_name().map(|name| name.to_string_lossy());
            let name = name.unwrap_or_else(|| path.to_string_lossy());
            SeenPose::of(&recording, &name, board)
                .map_err(|error| content(format!("{}: {error}", path.display())))
        };
        // The first pose that fails is named, whichever thread ends first.
        let each: Vec<Result<SeenPose>> = self.poses.par_iter().map(seen).collect();
        each.into_iter().collect()
    }
}

fn content(words: impl Display) -> Failure {
    Failure::new(Exit::Content, format!("calibrate: {words}"))
}

/// Draws residuals and coverage.
fn draw(folder: &OutputFolder, head: &SeenPose, geometry: &Geometry) -> Result<()> {
    let [width, height, _, columns, rows] = head.head.map(|size| size as usize);
    let frame = (width, height);
    let arrows = |device: usize| -> Vec<&[Arrow]> {
        let poses = geometry.arrows.iter();
        poses.map(|pose| pose[device].as_slice()).collect()
    };
    let [camera, projector] = [arrows(0), arrows(1)];
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
fn file(head: &SeenPose, geometry: &Geometry, before: Option<&CalibrationFile>) -> CalibrationFile {
    let from = geometry.file.source();
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

/// A calibration from poses that was written.
struct PosesReport<'a> {
    pub file: &'a CalibrationFile,
    pub geometry: &'a Geometry,
    pub seen: &'a [SeenPose],
    pub scale: Scale,
    /// Fingerprint of the calibration before.
    pub before: Option<&'a str>,
    pub place: &'a Path,
    pub notes: &'a [String],
}

impl PosesReport<'_> {
    pub fn json(&self) -> Value {
        let geometry = self.geometry;
        let poses = geometry.file.poses.iter().enumerate().map(|(at, pose)| {
            let measured = &geometry.measured[at];
            json!({
                "recording": pose.recording, "corners": pose.corners, "points": self.seen[at].view.nodes.len(),
                "blur_px": self.seen[at].view.found.blur(),
                "camera_px": pose.camera_px, "projector_px": pose.projector_px,
                "tilt_degrees": pose.tilt_degrees, "distance_mm": pose.distance_mm,
                "pitch_mm": measured.map(|board| [board.pitch.0, board.pitch.1]),
                "flatness_mm": measured.map(|board| board.flatness),
            })
        });
        let corner = |end: usize| {
            let corner = geometry.prediction.volume[end];
            [corner.x, corner.y, corner.z]
        };
        json!({
            "calibration": self.file, "file": self.place.display().to_string(), "fingerprint_before": self.before,
            "camera_px": geometry.file.camera_px, "projector_px": geometry.file.projector_px,
            "poses": poses.collect::<Vec<_>>(),
            "coverage": {
                "frame": geometry.frame_covered, "tilt_degrees": geometry.tilt_degrees, "volume_mm": [corner(0), corner(1)],
            },
            "sigma": {
                "height_mm": geometry.prediction.height, "worst_height_mm": geometry.prediction.worst_height,
                "length_100_mm": geometry.prediction.length,
            },
            "scale": self.scale, "missing": self.file.missing(), "notes": self.notes,
        })
    }

    pub fn table(&self) -> String {
        let (geometry, file) = (self.geometry, &self.geometry.file);
        let mut lines = String::new();
        // Writing to a string cannot fail.
        let _ = writeln!(
            lines,
            "pose                  corners  camera px  projector px   tilt  distance  pitch of corners  flatness"
        );
        for (pose, measured) in file.poses.iter().zip(&geometry.measured) {
            let board = measured.map_or(String::new(), |board| {
                let (x, y) = board.pitch;
                let pitch = format!("{x:.3} × {y:.3}");
                format!("{pitch:>18}{:7.3} mm", board.flatness)
            });
            let _ = writeln!(
                lines,
                "{:22}{:7}{:11.3}{:14.3}{:6.0}°{:7.0} mm{board}",
                pose.recording,
                pose.corners,
                pose.camera_px,
                pose.projector_px,
                pose.tilt_degrees,
                pose.distance_mm,
            );
        }
        let mut line = |name: &str, found: String| {
            let _ = writeln!(lines, "{name:9} {found}");
        };
        line(
            "residuals",
            format!(
                "camera {:.3} px, projector {:.3} px RMS",
                file.camera_px, file.projector_px
            ),
        );
        let [low, high] = geometry.prediction.volume;
        line(
            "coverage",
            format!(
                "corners in {:.0} % of the frame, tilts up to {:.0}° apart, volume {:.0} × {:.0} × {:.0} mm",
                geometry.frame_covered * 100.0,
                geometry.tilt_degrees,
                high.x - low.x,
                high.y - low.y,
                high.z - low.z
            ),
        );
        let prediction = &geometry.prediction;
        line(
            "σ",
            format!(
                "{:.4} mm of heights ({:.4} at worst), {:.4} mm of a length of 100 mm{}",
                prediction.height,
                prediction.worst_height,
                prediction.length,
                if file.board.sigma_ppm > 0.0 {
                    ""
                } else {
                    ", if the board's size is exact"
                }
            ),
        );
        let bow = file.board.bow_mm;
        if bow != [0.0; 3] {
            let found = format!(
                "{:.3}, {:.3}, {:.3} mm with x², y², xy",
                bow[0], bow[1], bow[2]
            );
            line("bow", found);
        }
        line("plane", geometry.ground.words());
        line("baseline", format!("{:.2} mm", file.baseline_mm));
        line(
            "scale",
            match self.scale {
                Scale::Unchecked => "unchecked: a wrong size of squares scales everything alike; state a length on the board with --check-length".into(),
                Scale::Length => "agrees with --check-length within 1 %".into(),
                Scale::Baseline => "the baseline agrees with the calibration before within 1 %".into(),
            },
        );
        let missing = self.file.missing();
        if !missing.is_empty() {
            line(
                "missing",
                format!(
                    "{}: measured on the head by `fringed calibrate`",
                    missing.join(", ")
                ),
            );
        }
        for note in self.notes {
            line("note", note.clone());
        }
        line("written", self.place.display().to_string());
        lines
    }
}
