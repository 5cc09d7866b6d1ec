//! The key `geometry` of `calibration.json`: the board and the poses that the models were made
//! with, and how well they fit.

use hal::bounded;
use hal::bounds::{Bound, Fields, Longest, MAX_NAME, MAX_SIDE, OutOfBounds, length};

/// Most poses.
pub const MAX_POSES: usize = 64;
/// Most inner corners along a side of the board.
pub const MAX_CORNERS: usize = 100;
/// Largest square of a board, mm.
pub const MAX_SQUARE_MM: f64 = 1000.0;
/// Largest σ of a board's scale, parts per million.
pub const MAX_SIGMA_PPM: f64 = 1e5;
/// Largest length that is stored, mm.
const MAX_MM: f64 = 1e6;

bounded! {
    /// How the models were made.
    pub struct GeometryFile {
        /// The board.
        pub board: BoardFile = Fields,
        /// Distance between the centres of camera and projector, mm.
        pub baseline_mm: f64 = 0.0..=MAX_MM,
        /// RMS of the corners' residuals over all poses, camera px, two-dimensional.
        pub camera_px: f64 = 0.0..=f64::from(MAX_SIDE),
        /// RMS of the residuals of ξ, η over all poses, projector px, two-dimensional.
        pub projector_px: f64 = 0.0..=f64::from(MAX_SIDE),
        /// σ of a height by the uncertainty of the models, RMS over the volume of all poses, mm.
        pub height_sigma_mm: f64 = 0.0..=MAX_MM,
        /// σ of a length of 100 mm by the uncertainty of the models, RMS over the volume of all
        /// poses, mm.
        pub length_sigma_mm: f64 = 0.0..=MAX_MM,
        /// The poses, the last in the plane z = 0.
        pub poses: Vec<PoseFile> = Fields,
    }

    /// A checkerboard.
    pub struct BoardFile {
        /// Inner corners along x.
        pub columns: usize = 2..=MAX_CORNERS,
        /// Inner corners along y.
        pub rows: usize = 2..=MAX_CORNERS,
        /// Side of a square.
        pub square_mm: f64 = 1e-3..=MAX_SQUARE_MM,
        /// σ of the board's scale, parts per million; 0 if none was stated.
        pub sigma_ppm: f64 = 0.0..=MAX_SIGMA_PPM,
        /// The bow that was found: by how much the board's surface deviates from a plane with x²,
        /// y² and xy over its corners, mm.
        pub bow_mm: [f64; 3] = -MAX_MM..=MAX_MM,
    }

    /// One pose of the board.
    pub struct PoseFile {
        /// Name of the recording.
        pub recording: String = Longest(MAX_NAME),
        /// Corners that were located.
        pub corners: usize = 0..=MAX_CORNERS * MAX_CORNERS,
        /// RMS of their residuals, camera px, two-dimensional.
        pub camera_px: f64 = 0.0..=f64::from(MAX_SIDE),
        /// RMS of the residuals of ξ, η, projector px, two-dimensional.
        pub projector_px: f64 = 0.0..=f64::from(MAX_SIDE),
        /// Angle between the board's normal and the camera's axis, degrees.
        pub tilt_degrees: f64 = 0.0..=180.0,
        /// Distance of the board's centre from the camera, mm.
        pub distance_mm: f64 = 0.0..=MAX_MM,
    }
}

impl GeometryFile {
    /// Checks each value by itself.
    ///
    /// # Errors
    /// In words that name the key, the value and the bounds.
    pub fn check_bounds(&self) -> Result<(), OutOfBounds> {
        length("geometry.poses", self.poses.len(), 1, MAX_POSES)?;
        Fields.check("geometry", self)
    }
}
