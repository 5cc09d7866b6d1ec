//! The keys `geometry` and `reference` of `calibration.json`: the board and the poses that the models
//! were made with, and the reference phase maps of a plate.

use hal::bounded;
use hal::bounds::{
    Bound, Fields, Longest, MAX_FRINGES, MAX_NAME, MAX_SIDE, OutOfBounds, fingerprint, length,
};
use hal::model::PlaneModel;

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

    /// The reference phase maps of the plane z = 0.
    pub struct ReferenceFile {
        /// Projector pixels per fringe.
        pub pitch_px: f64 = 1.0..=f64::from(MAX_SIDE),
        /// RMS distance of the models from the measured plane, projector pixels.
        pub models_off_px: f64 = 0.0..=f64::from(MAX_SIDE),
        /// The projector points of the plane, as the maps say.
        pub plane: PlaneModel = Fields,
        /// Under vertical fringes.
        pub vertical: MapFile,
        /// Under horizontal fringes.
        pub horizontal: MapFile,
    }

    /// One reference phase map.
    pub struct MapFile {
        /// The array beside this file: f64, turns, the smooth fit over the whole frame.
        pub file: String = Longest(MAX_NAME),
        /// SHA-256 of that file.
        pub sha256: String,
        /// Estimated RMS error of the fit, see [`algo::pipeline::Plate`].
        pub residual_turns: f64 = 0.0..=MAX_FRINGES,
        /// Scatter of the pixels about the fit.
        pub noise_turns: f64 = 0.0..=MAX_FRINGES,
        /// Share of the frame that was fitted.
        pub filled: f64 = 0.0..=1.0,
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

impl ReferenceFile {
    /// How well the maps and the models fit the plate.
    pub fn words(&self) -> String {
        let residual = |name: &str, map: &MapFile| {
            let MapFile {
                residual_turns,
                noise_turns,
                ..
            } = map;
            format!("{name} {residual_turns:.5} turn (noise {noise_turns:.4})")
        };
        format!(
            "residual {}, {}; the models are off it by {:.3} px",
            residual("vertical", &self.vertical),
            residual("horizontal", &self.horizontal),
            self.models_off_px
        )
    }
}

impl MapFile {
    pub(super) fn check_bounds(&self, key: &str) -> Result<(), String> {
        Fields.check(key, self)?;
        if self.file.is_empty() || self.file.contains(['/', '\\']) {
            return Err(format!(
                "{key}.file is {:?}: it must be the name of a file beside this one",
                self.file
            ));
        }
        Ok(fingerprint(&format!("{key}.sha256"), &self.sha256)?)
    }
}
