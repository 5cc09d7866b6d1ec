//! The calibration of a head: geometry, noise and grey response; its file and where it is stored; models imported from OpenCV.

pub mod bounds;
mod current;
pub mod file;
pub mod geometry;
pub mod opencv;
pub mod place;

pub use current::Current;

use crate::head::seam;
use crate::storage::hex;
use algo::geometry::Pinhole;
use algo::pattern::GreyResponse;
use hal::model::DeviceModel;
use hal::replay::Recording;
use hal::replay::recording::RecordedProjector;
use sha2::{Digest, Sha256};
use sim::Scenario;

/// The calibration of a head. Its models are checked: each pixel has one ray.
#[derive(Clone, Debug)]
pub struct Calibration {
    /// The camera's geometry and the size of its frames.
    pub camera: Pinhole,
    /// Bits of a sample.
    pub bit_depth: u8,
    /// The projector's geometry and the size of its raster.
    pub projector: Pinhole,
    /// σ of one sample in counts.
    pub noise_counts: f64,
    /// The projector's measured grey response, where it is not linear.
    pub response: Option<GreyResponse>,
}

impl Calibration {
    /// A head whose camera has frames of `(columns, rows, bits)` and whose projector a raster of `(columns, rows)`; its response
    /// is linear.
    ///
    /// # Errors
    /// In words: the model of the camera or of the projector is absurd, and why.
    pub fn new(
        (width, height, bit_depth): (u32, u32, u8),
        raster: (u32, u32),
        (camera, projector): (&DeviceModel, &DeviceModel),
        noise_counts: f64,
    ) -> Result<Self, String> {
        Ok(Self {
            camera: seam::pinhole("camera", camera, (width, height))?,
            bit_depth,
            projector: seam::pinhole("projector", projector, raster)?,
            noise_counts,
            response: None,
        })
    }

    /// The exact calibration of the head of a scenario, which need not be simulated.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn of_scenario(scenario: &Scenario) -> Result<Self, String> {
        let ((width, height), projector) = (scenario.frame_size(), &scenario.rig.projector);
        Self::new(
            (width, height, scenario.bit_depth),
            (projector.width, projector.height),
            (&scenario.camera_model(), &projector.model()),
            scenario.noise_sigma_counts(),
        )
    }

    /// The calibration of the head that took a recording, from its models, with the noise of a sample in counts.
    ///
    /// # Errors
    /// What is wrong with the recording, as a predicate: "has no camera model".
    pub fn of(recording: &Recording, noise_counts: f64) -> Result<Self, String> {
        let projector = &recording.projector;
        let camera = recording.camera_model.as_ref();
        let models = (
            camera.ok_or("has no camera model")?,
            projector.model.as_ref().ok_or("has no projector model")?,
        );
        Self::new(
            (recording.width, recording.height, recording.bit_depth),
            (projector.width, projector.height),
            models,
            noise_counts,
        )
        .map_err(|error| format!("has an absurd model: {error}"))
    }

    /// A recording of this head, without patterns and frames.
    pub fn recording(&self) -> Recording {
        let (width, height, bit_depth) = self.frames();
        let (columns, rows) = self.raster();
        Recording {
            width,
            height,
            bit_depth,
            description: String::new(),
            source: String::new(),
            camera_model: Some(seam::device_model(&self.camera)),
            noise_counts: Some(self.noise_counts),
            projector: RecordedProjector {
                width: columns,
                height: rows,
                model: Some(seam::device_model(&self.projector)),
            },
            patterns: Vec::new(),
            frames: Vec::new(),
            codes: Vec::new(),
            white: None,
            black: None,
            range_mm: None,
            exposure_us: None,
            part_id: None,
            recipe: None,
            truth_height: None,
            truth_class: None,
        }
    }

    /// Columns, rows and bits of the camera's frames.
    pub fn frames(&self) -> (u32, u32, u8) {
        let (width, height) = size(&self.camera);
        (width, height, self.bit_depth)
    }

    /// Columns and rows of the projector's raster.
    pub fn raster(&self) -> (u32, u32) {
        size(&self.projector)
    }

    /// SHA-256 over everything that heights depend on, so that a recipe made for another calibration is refused.
    pub fn fingerprint(&self) -> String {
        let mut hash = Sha256::new();
        let (width, height, bits) = self.frames();
        let (columns, rows) = self.raster();
        for number in [width, height, u32::from(bits), columns, rows] {
            hash.update(number.to_le_bytes());
        }
        for model in [self.camera.model(), self.projector.model()] {
            let numbers = [model.fx, model.fy, model.cx, model.cy].into_iter();
            let numbers = numbers
                .chain(model.distortion)
                .chain(model.rotation)
                .chain(model.translation);
            for number in numbers {
                hash.update(number.to_le_bytes());
            }
        }
        // A linear response changes nothing that is projected, so it leaves the fingerprint as it was.
        if let Some(response) = &self.response {
            let levels: Vec<u8> = (0..=u8::MAX)
                .map(|level| response.level_for(level))
                .collect();
            hash.update(levels);
        }
        hex(&hash.finalize())
    }
}

/// Columns and rows of a device; they were given as `u32`.
fn size(device: &Pinhole) -> (u32, u32) {
    (device.width() as u32, device.height() as u32)
}
