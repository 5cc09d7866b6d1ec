//! The models of the head that a recipe was taught with: with them golden is measured anywhere.

use super::Refusal;
use crate::head::calibration::{Calibration, CalibrationSigma, HeightsBy};
use crate::head::seam;
use hal::bounded;
use hal::bounds::Fields;
use hal::model::{DeviceModel, PlaneModel};

bounded! {
    /// The geometry of a head.
    pub struct ModelsFile {
        /// The camera.
        pub camera: DeviceModel,
        /// The projector.
        pub projector: DeviceModel,
        /// What the measured reference plane is off the models; `None` where heights go by the
        /// models.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub plane: Option<PlaneModel> = Fields,
    }
}

impl ModelsFile {
    /// Those of a calibration.
    pub fn of(calibration: &Calibration) -> Self {
        Self {
            camera: seam::device_model(&calibration.camera),
            projector: seam::device_model(&calibration.projector),
            plane: calibration.plane_by().cloned(),
        }
    }

    /// The head as far as it is needed to measure golden: without its grey response. Frames are of
    /// `(columns, rows, bits)`, the raster of `(columns, rows)`.
    ///
    /// # Errors
    /// In words: a model is absurd, and why.
    pub fn head(
        &self,
        frames: (u32, u32, u8),
        raster: (u32, u32),
        noise_counts: f64,
        sigma: Option<CalibrationSigma>,
    ) -> Result<Calibration, Refusal> {
        let models = (&self.camera, &self.projector);
        let by_models = Calibration::new(frames, raster, models, noise_counts)
            .map_err(|error| format!("models: {error}"))?;
        Ok(Calibration {
            plane: self.plane.clone(),
            heights_by: match self.plane {
                Some(_) => HeightsBy::Measured,
                None => HeightsBy::Models,
            },
            sigma,
            ..by_models
        })
    }
}
