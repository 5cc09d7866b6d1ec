//! What is known of a head: geometry, noise, grey response; how it is measured, imported and kept.

pub mod bounds;
mod current;
pub mod file;
pub mod opencv;
pub mod place;

pub use current::Current;

use crate::head::seam;
use crate::storage::hex;
use algo::geometry::{ModelError, Pinhole};
use algo::pattern::GreyResponse;
use hal::model::DeviceModel;
use hal::replay::Recording;
use sha2::{Digest, Sha256};
use sim::{Scenario, Stage};

/// The calibration of a head.
#[derive(Clone, Debug)]
pub struct Calibration {
    /// Columns, rows and bits of the camera's frames.
    pub camera: (u32, u32, u8),
    /// The camera's geometry.
    pub camera_model: DeviceModel,
    /// Columns and rows of the projector's raster.
    pub projector: (u32, u32),
    /// The projector's geometry.
    pub projector_model: DeviceModel,
    /// σ of one sample in counts.
    pub noise_counts: f64,
    /// The projector's measured grey response, where it is not linear.
    pub response: Option<GreyResponse>,
}

impl Calibration {
    /// The exact calibration of a simulated head.
    pub fn of_stage(stage: &Stage) -> Self {
        Self::of_scenario(stage.scenario())
    }

    /// The same, of a head that need not be there.
    pub fn of_scenario(scenario: &Scenario) -> Self {
        let (camera, projector) = (&scenario.rig.camera, &scenario.rig.projector);
        Self {
            camera: (camera.width, camera.height, scenario.bit_depth),
            camera_model: camera.model(),
            projector: (projector.width, projector.height),
            projector_model: projector.model(),
            noise_counts: scenario.noise_sigma_counts(),
            response: None,
        }
    }

    /// What a recording says of the head that took it, with the noise of a sample in counts.
    ///
    /// # Errors
    /// The word for what it lacks.
    pub fn of(recording: &Recording, noise_counts: f64) -> Result<Self, &'static str> {
        let projector = &recording.projector;
        Ok(Self {
            camera: (recording.width, recording.height, recording.bit_depth),
            camera_model: recording.camera_model.clone().ok_or("camera model")?,
            projector: (projector.width, projector.height),
            projector_model: projector.model.clone().ok_or("projector model")?,
            noise_counts,
            response: None,
        })
    }

    /// A strong hash over everything that heights depend on: a recipe made for another calibration
    /// is refused by it.
    pub fn fingerprint(&self) -> String {
        let mut hash = Sha256::new();
        let (width, height, bits) = self.camera;
        for number in [
            width,
            height,
            u32::from(bits),
            self.projector.0,
            self.projector.1,
        ] {
            hash.update(number.to_le_bytes());
        }
        for model in [&self.camera_model, &self.projector_model] {
            let numbers = [model.fx, model.fy, model.cx, model.cy].into_iter();
            let numbers = numbers
                .chain(model.distortion)
                .chain(model.rotation)
                .chain(model.translation_mm);
            for number in numbers {
                hash.update(number.to_le_bytes());
            }
        }
        // What is linear by itself is projected as it was before anybody measured it.
        if let Some(response) = &self.response {
            let levels: Vec<u8> = (0..=u8::MAX)
                .map(|level| response.level_for(level))
                .collect();
            hash.update(levels);
        }
        hex(&hash.finalize())
    }

    /// Camera and projector, checked.
    ///
    /// # Errors
    /// If a model is absurd; the message names the device.
    pub fn devices(&self) -> Result<(Pinhole, Pinhole), String> {
        let checked = |name: &str, model: &DeviceModel, width: u32, height: u32| {
            Pinhole::new(seam::pinhole_model(model), width as usize, height as usize)
                .map_err(|error: ModelError| format!("the {name}'s calibration: {error}"))
        };
        Ok((
            checked("camera", &self.camera_model, self.camera.0, self.camera.1)?,
            checked(
                "projector",
                &self.projector_model,
                self.projector.0,
                self.projector.1,
            )?,
        ))
    }
}
