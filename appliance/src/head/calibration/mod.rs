//! The calibration of a head: geometry, noise and grey response; its file and where it is stored;
//! models imported from OpenCV.

pub mod file;
pub mod geometry;
pub mod opencv;
pub mod place;

use crate::error::{Exit, Result};
use crate::head::exposing::Exposing;
use crate::head::seam;
use crate::storage::hex;
use algo::frame::SampleNoise;
use algo::geometry::{HeightRange, Pinhole, RigError, Triangulator};
use algo::pattern::{GreyResponse, PhaseFunction, Waveform, Waveforms};
use algo::phase::LeastModulation;
use file::ContrastFile;
use hal::bounded;
use hal::bounds::MAX_SIGMA_MM;
use hal::frame::FrameFormat;
use hal::model::{DeviceModel, PlaneModel};
use hal::replay::Recording;
use hal::replay::recording::RecordedProjector;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use sim::Scenario;
use std::sync::{Arc, Mutex, PoisonError};

/// What heights go by.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum HeightsBy {
    /// The models of camera and projector.
    Models,
    /// The models, corrected by what the measured reference plane is off them (Peng & Gupta 2008,
    /// eqs. 10–11).
    Measured,
}

/// The calibration of a head. Its models are checked: each pixel has one ray.
#[derive(Clone, Debug)]
pub struct Calibration {
    /// The camera's geometry and the size of its frames.
    pub camera: Pinhole,
    /// Bits of a sample.
    pub bit_depth: u8,
    /// The projector's geometry and the size of its raster.
    pub projector: Pinhole,
    /// What the measured reference plane is off the models, if it was measured.
    pub plane: Option<PlaneModel>,
    /// What heights go by.
    pub heights_by: HeightsBy,
    /// σ of one sample in counts, at half the light of white.
    pub noise_counts: f64,
    /// The noise of one sample by its mean signal.
    pub noise: SampleNoise,
    /// The exposure and gain that the noise belongs to, where they are known.
    pub exposing: Option<Exposing>,
    /// Contrast of fringes against their pitch, if it was measured.
    pub contrast: Option<ContrastFile>,
    /// The projector's measured grey response, where it is not linear.
    pub response: Option<GreyResponse>,
    /// Whether the light is known to be linear in the grey level, by itself or with the inverse of
    /// `response`. Only then may a waveform have harmonics.
    pub linear: bool,
    /// σ of what the models make of a measurement, where they were made from a board.
    pub sigma: Option<CalibrationSigma>,
}

bounded! {
    /// σ of measurements by the uncertainty of the models.
    #[derive(Copy)]
    pub struct CalibrationSigma {
        /// Of a height, mm.
        pub height_mm: f64 = 0.0..=MAX_SIGMA_MM,
        /// Of a length of 100 mm, mm.
        pub length_mm: f64 = 0.0..=MAX_SIGMA_MM,
    }
}

impl Calibration {
    /// A head whose camera has frames of `(columns, rows, bits)` and whose projector a raster of
    /// `(columns, rows)`; its response is not known, and heights go by the models.
    ///
    /// # Errors
    /// The model of the camera or of the projector is absurd.
    pub fn new(
        (width, height, bit_depth): (u32, u32, u8),
        raster: (u32, u32),
        (camera, projector): (&DeviceModel, &DeviceModel),
        noise_counts: f64,
    ) -> Result<Self> {
        Ok(Self {
            camera: seam::pinhole("camera", camera, (width, height))?,
            bit_depth,
            projector: seam::pinhole("projector", projector, raster)?,
            plane: None,
            heights_by: HeightsBy::Models,
            noise_counts,
            noise: SampleNoise::constant(noise_counts),
            exposing: None,
            contrast: None,
            response: None,
            linear: false,
            sigma: None,
        })
    }

    /// The exact calibration of the head of a scenario, which need not be simulated.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn of_scenario(scenario: &Scenario) -> Result<Self> {
        let ((width, height), projector) = (scenario.frame_size(), &scenario.rig.projector);
        let head = Self::new(
            (width, height, scenario.bit_depth),
            (projector.width, projector.height),
            (&scenario.camera_model(), &projector.model()),
            scenario.noise_sigma_counts(),
        )?;
        let [read, shot] = scenario.noise_variance();
        Ok(Self {
            noise: SampleNoise::new(read.sqrt(), shot),
            linear: scenario.optics.gamma == 1.0,
            ..head
        })
    }

    /// Takes the exact noise of a simulated head that is set to this exposure and gain.
    pub fn simulate_noise(&mut self, scenario: &Scenario, exposing: Exposing) {
        let mut set = scenario.clone();
        set.optics.gain = exposing.gain;
        let [read, shot] = set.noise_variance();
        self.noise_counts = set.noise_sigma_counts();
        self.noise = SampleNoise::new(read.sqrt(), shot);
        self.exposing = Some(exposing);
    }

    /// What a level of so many shifts shows on this head: the waveform with the most modulation
    /// where the light is linear, else a sine.
    pub fn waveforms(&self) -> Waveforms {
        match self.linear {
            true => Waveform::brightest,
            false => Waveform::sine,
        }
    }

    /// The least modulation that is trusted on this head.
    pub fn least_modulation(&self) -> LeastModulation {
        LeastModulation::of_noise(self.noise_counts, self.bit_depth)
    }

    /// The least modulation that is trusted on a part that is dark, or dark but for where it mirrors: that
    /// of the noise of samples at an eighth of full scale.
    pub fn least_modulation_of_dark(&self) -> LeastModulation {
        let light = f64::from((1_u32 << self.bit_depth) - 1) / 8.0;
        let noise = self.noise.at(light).min(self.noise_counts);
        LeastModulation::of_noise(noise, self.bit_depth)
    }

    /// The calibration of the head that took a recording, from its models, with the noise of a
    /// sample in counts.
    ///
    /// # Errors
    /// What is wrong with the recording, as a predicate: "has no camera model".
    pub fn of(recording: &Recording, noise_counts: f64) -> Result<Self> {
        let projector = &recording.projector;
        let Some(camera) = &recording.camera_model else {
            return Exit::Content.fail("has no camera model");
        };
        let Some(model) = &projector.model else {
            return Exit::Content.fail("has no projector model");
        };
        let frames = (recording.width, recording.height);
        let by_models = Self::new(
            (frames.0, frames.1, recording.bit_depth),
            (projector.width, projector.height),
            (camera, model),
            noise_counts,
        );
        Ok(Self {
            plane: projector.plane.clone(),
            heights_by: match projector.plane {
                Some(_) => HeightsBy::Measured,
                None => HeightsBy::Models,
            },
            ..by_models.map_err(Exit::Content.because("has an absurd model"))?
        })
    }

    /// A recording of this head, without patterns and frames.
    pub fn recording(&self) -> Recording {
        let (width, height, bit_depth) = self.frames();
        let (columns, rows) = self.raster();
        let projector = RecordedProjector {
            width: columns,
            height: rows,
            model: Some(seam::device_model(&self.projector)),
            plane: self.plane_by().cloned(),
        };
        Recording {
            camera_model: Some(seam::device_model(&self.camera)),
            noise_counts: Some(self.noise_counts),
            ..Recording::new(FrameFormat::packed(width, height, bit_depth), projector)
        }
    }

    /// Turns the phase of a pattern into height; the working range is by default that of
    /// [`Triangulator::new`].
    ///
    /// # Errors
    /// If camera and projector do not look down at the reference plane from two different points,
    /// or the range is unusable.
    pub fn triangulator(
        &self,
        function: PhaseFunction,
        range: Option<HeightRange>,
    ) -> Result<Triangulator, RigError> {
        let (camera, projector) = (self.camera.clone(), self.projector.clone());
        let reference = seam::reference(self.plane_by(), size(&camera));
        Triangulator::new(camera, projector, reference, function, range)
    }

    /// The same head, whose camera has worked out the rays of its pixels ([`Pinhole::with_rays`]).
    #[must_use]
    pub fn with_rays(self) -> Self {
        Self {
            camera: self.camera.with_rays(),
            ..self
        }
    }

    /// What the measured reference plane is off the models, where heights go by it.
    pub fn plane_by(&self) -> Option<&PlaneModel> {
        match self.heights_by {
            HeightsBy::Models => None,
            HeightsBy::Measured => self.plane.as_ref(),
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

    /// What tells heads apart: columns, rows and bits of the camera's frames, columns and rows of
    /// the projector.
    pub fn sizes(&self) -> [u32; 5] {
        let ((width, height), (columns, rows)) = (size(&self.camera), size(&self.projector));
        [width, height, u32::from(self.bit_depth), columns, rows]
    }

    /// Places along each side of the frame in [`Self::grid`].
    pub const GRID: u32 = 16;

    /// Places all over the frame.
    pub fn grid(&self) -> impl Iterator<Item = (f64, f64)> {
        let (width, height) = size(&self.camera);
        let n = Self::GRID;
        let place =
            move |at: u32, pixels: u32| (f64::from(at) + 0.5) / f64::from(n) * f64::from(pixels);
        (0..n * n).map(move |at| (place(at % n, width), place(at / n, height)))
    }

    /// SHA-256 over everything that heights depend on, so that a recipe made for another
    /// calibration is refused.
    pub fn fingerprint(&self) -> String {
        let mut hash = Sha256::new();
        for number in self.sizes() {
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
        if let Some(plane) = self.plane_by() {
            for coefficient in plane.xi.iter().chain(&plane.eta) {
                hash.update(coefficient.to_le_bytes());
            }
        }
        // A linear response changes nothing that is projected, so it leaves the fingerprint as it
        // was.
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

/// Set by the measuring task whenever it opens a head. Cheap to clone.
#[derive(Clone, Debug, Default)]
pub struct Current(Arc<Mutex<Option<Arc<Calibration>>>>);

impl Current {
    /// Sets the calibration of the head that was just opened; `None` if the head has no calibration
    /// that can be trusted.
    pub fn set(&self, calibration: Option<&Calibration>) {
        let calibration = calibration.cloned().map(Arc::new);
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = calibration;
    }

    /// The calibration; `None` before a head is open, and if the head has no calibration that can
    /// be trusted.
    pub fn get(&self) -> Option<Arc<Calibration>> {
        let current = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        current.clone()
    }
}

/// The inverse of a response; none if it is linear already.
///
/// # Errors
/// If it has not 256 levels, or falls.
pub fn inverted(response: &[f64]) -> Result<Option<GreyResponse>> {
    let Ok(levels) = <&[f64; 256]>::try_from(response) else {
        let levels = response.len();
        return Exit::Content.fail(format!("response has {levels} levels, expected 256"));
    };
    let inverse = GreyResponse::new(levels).map_err(Exit::Content.failure())?;
    let linear = (0..=u8::MAX).all(|level| inverse.level_for(level) == level);
    Ok((!linear).then_some(inverse))
}
