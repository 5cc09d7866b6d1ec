//! The key `geometry` of `calibration.json`: the board and the poses that the models were made with, and how well they fit.

use hal::bounds::{MAX_SIDE, length, text, within};
use serde::{Deserialize, Serialize};

/// Most poses.
pub const MAX_POSES: usize = 64;
/// Most inner corners along a side of the board.
pub const MAX_CORNERS: usize = 100;
/// Largest square of a board, mm.
pub const MAX_SQUARE_MM: f64 = 1000.0;
/// Largest σ of a board's scale, parts per million.
pub const MAX_SIGMA_PPM: f64 = 1e5;
/// Longest name of a recording, characters.
const MAX_NAME: usize = 255;
/// Largest length that is stored, mm.
const MAX_MM: f64 = 1e6;

/// How the models were made.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GeometryFile {
    /// The board.
    pub board: BoardFile,
    /// Distance between the centres of camera and projector, mm.
    pub baseline_mm: f64,
    /// RMS of the corners' residuals over all poses, camera px, two-dimensional.
    pub camera_px: f64,
    /// RMS of the residuals of ξ, η over all poses, projector px, two-dimensional.
    pub projector_px: f64,
    /// σ of a height by the uncertainty of the models, RMS over the volume of all poses, mm.
    pub height_sigma_mm: f64,
    /// σ of a length of 100 mm by the same, mm.
    pub length_sigma_mm: f64,
    /// The poses, the last in the plane z = 0.
    pub poses: Vec<PoseFile>,
}

/// A checkerboard.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BoardFile {
    /// Inner corners along x.
    pub columns: usize,
    /// Inner corners along y.
    pub rows: usize,
    /// Side of a square.
    pub square_mm: f64,
    /// σ of the board's scale, parts per million; 0 if none was stated.
    pub sigma_ppm: f64,
    /// The bow that was found: by how much the board's surface deviates from a plane with x², y² and xy over its corners, mm.
    pub bow_mm: [f64; 3],
}

/// One pose of the board.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PoseFile {
    /// Name of the recording.
    pub recording: String,
    /// Corners that were located.
    pub corners: usize,
    /// RMS of their residuals, camera px, two-dimensional.
    pub camera_px: f64,
    /// RMS of the residuals of ξ, η, projector px, two-dimensional.
    pub projector_px: f64,
    /// Angle between the board's normal and the camera's axis, degrees.
    pub tilt_degrees: f64,
    /// Distance of the board's centre from the camera, mm.
    pub distance_mm: f64,
}

impl GeometryFile {
    /// Checks each value by itself.
    ///
    /// # Errors
    /// In words that name the key, the value and the bounds.
    pub fn check_bounds(&self) -> Result<(), String> {
        let board = &self.board;
        let (most, side) = (MAX_CORNERS, f64::from(MAX_SIDE));
        within("geometry.board.columns", board.columns, 2, most)?;
        within("geometry.board.rows", board.rows, 2, most)?;
        let (square, sigma) = (board.square_mm, board.sigma_ppm);
        within("geometry.board.square_mm", square, 1e-3, MAX_SQUARE_MM)?;
        within("geometry.board.sigma_ppm", sigma, 0.0, MAX_SIGMA_PPM)?;
        for bow in board.bow_mm {
            within("geometry.board.bow_mm", bow, -MAX_MM, MAX_MM)?;
        }
        within("geometry.baseline_mm", self.baseline_mm, 0.0, MAX_MM)?;
        within("geometry.camera_px", self.camera_px, 0.0, side)?;
        within("geometry.projector_px", self.projector_px, 0.0, side)?;
        within(
            "geometry.height_sigma_mm",
            self.height_sigma_mm,
            0.0,
            MAX_MM,
        )?;
        within(
            "geometry.length_sigma_mm",
            self.length_sigma_mm,
            0.0,
            MAX_MM,
        )?;
        length("geometry.poses", self.poses.len(), 1, MAX_POSES)?;
        for pose in &self.poses {
            let all = most * most;
            text("geometry.poses.recording", &pose.recording, MAX_NAME)?;
            within("geometry.poses.corners", pose.corners, 0, all)?;
            within("geometry.poses.camera_px", pose.camera_px, 0.0, side)?;
            within("geometry.poses.projector_px", pose.projector_px, 0.0, side)?;
            within("geometry.poses.tilt_degrees", pose.tilt_degrees, 0.0, 180.0)?;
            within("geometry.poses.distance_mm", pose.distance_mm, 0.0, MAX_MM)?;
        }
        Ok(())
    }
}
