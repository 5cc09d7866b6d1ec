//! A scenario: rig, lighting, optics, noise and part of a simulated head, from TOML or built in
//! code.
//!
//! The defaults are the study's rig and lighting (docs/measurement.md, *The study's head and
//! parts*) with the sheet-metal part.

use std::time::Duration;

use serde::{Deserialize, Deserializer};

use super::material::{Lighting, Material, Print};
use super::optics::{Lens, turn, turned};
use super::parts::Part;
use super::placement::{Ground, Placement};
use super::timing::Timing;
use super::unfit::{MAX_RAYS, Unfit};
use super::unsteady::Unsteady;
use hal::bounded;
use hal::bounds::{Bound, Fields, shortened};
use hal::model::DeviceModel;
use hal::virtual_head::{Faults, Mechanics};

/// Column and row of the green pixel that is read of each 2×2 pixels of a colour sensor.
const GREEN: (u32, u32) = (1, 0);

bounded! {
    /// A whole simulated head. Keys that are missing in the TOML have their default values.
    pub struct Scenario: Default {
        /// Whether the pose and lens of both devices and their times are known from the start; a
        /// head without a calibration is commissioned first.
        pub calibrated: bool => true,
        /// Camera bits, 8, 10 or 12.
        pub bit_depth: u8 => 8,
        /// Whether the camera has a colour sensor (RGGB); one of its green planes is read, so frames
        /// have half its columns and rows.
        pub colour: bool,
        /// Rays per pixel along each side, 1…16.
        pub sub_rays: u32 = 1..=16 => 4,
        /// Refresh rate of the projector, 1…1000 Hz.
        pub refresh_hz: f64 = 1.0..=1000.0 => 60.0,
        /// What the part is made of. If it is not given, `light` says how the part reflects.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub material: Option<Material>,
        /// What is printed on the part; nothing if it is not given.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub print: Option<Print> = Fields,
        /// Whether light by way of one other surface of part and surroundings is added, 0 or 1.
        pub bounces: u32 = 0..=1,
        /// Camera and projector.
        pub rig: Rig = Fields,
        /// Ambient light, and how much light the part reflects.
        pub light: Lighting = Fields,
        /// How the light changes in time.
        pub unsteady: Unsteady = Fields,
        /// Noise of the camera.
        pub noise: Noise = Fields,
        /// Blur, response and exposure.
        pub optics: Optics = Fields,
        /// What is measured.
        pub part: Part,
        /// What it lies on; nothing if it is not given.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub floor: Option<Ground> = Fields,
        /// How the part lies.
        pub placement: Placement = Fields,
        /// Exposure, readout and delays.
        pub timing: Timing = Fields,
        /// What goes wrong with flips, triggers and frames.
        pub faults: Faults = Fields,
    }

    /// The two devices. Each looks at the world's origin from the xz plane; its image x runs
    /// along +x, its image y along −y.
    pub struct Rig: Default {
        /// The camera.
        #[serde(deserialize_with = "camera_from")]
        pub camera: RigDevice = Fields => RigDevice {
            width: 512,
            height: 512,
            fov_deg: [20.0, 20.0],
            angle_deg: 20.0,
            distance_mm: 600.0,
            distortion: [-0.12, 0.15, 2e-4, -3e-4, 0.0],
            knocked_deg: [0.0; 3],
        },
        /// The projector.
        #[serde(deserialize_with = "projector_from")]
        pub projector: RigDevice = Fields => RigDevice {
            width: 1024,
            height: 768,
            fov_deg: [43.6, 33.4],
            angle_deg: -7.0,
            distance_mm: 600.0,
            distortion: [-0.05, 0.03, -3e-4, 2e-4, 0.0],
            knocked_deg: [0.0; 3],
        },
    }

    /// One device of the rig.
    pub struct RigDevice {
        /// Columns.
        pub width: u32 = 1..=4096,
        /// Rows.
        pub height: u32 = 1..=4096,
        /// Full angles of view, horizontal and vertical, degrees.
        pub fov_deg: [f64; 2] = 1.0..=120.0,
        /// Direction from the origin to the device, degrees from +z towards +x.
        pub angle_deg: f64 = -80.0..=80.0,
        /// Distance from the origin, mm.
        pub distance_mm: f64 = 10.0..=100_000.0,
        /// Brown distortion k1, k2, p1, p2, k3.
        pub distortion: [f64; 5] = -1.0..=1.0,
        /// By how much it was turned about its own x, y and z since its models were made, degrees.
        pub knocked_deg: [f64; 3] = -10.0..=10.0,
    }

    /// Noise of the camera. The defaults are what public photon models state of cameras with Sony's
    /// IMX296: saturation capacity 10 636 e⁻, temporal dark noise 4.81 e⁻ (with an ADC of 10 bits).
    /// No data sheet says so, and the spread of responses is an assumption: a head's calibration
    /// measures its own noise.
    #[derive(Copy)]
    pub struct Noise: Default {
        /// Electrons of a sample at full scale, with gain 1, 100…10 000 000.
        pub full_well_e: f64 = 100.0..=1e7 => 10_636.0,
        /// σ of the read noise, electrons, 0…1000.
        pub read_noise_e: f64 = 0.0..=1000.0 => 4.81,
        /// σ of the pixels' response (photo-response non-uniformity), as a share, 0…0.1.
        pub prnu: f64 = 0.0..=0.1 => 0.005,
        /// If given, the sensor has no other noise than a uniform one of this half-width, in counts
        /// of 8 bits; cameras with more bits have the same share of full scale.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub noise_counts: Option<f64> = 0.0..=255.0,
        /// Seed; frame n of a head has the same noise whenever the seed is the same.
        pub seed: u64 => 1,
    }

    /// Blur, response and gain between raster and samples.
    pub struct Optics: Default {
        /// σ of the Gaussian with which the projector's lens blurs its square pixels, projector
        /// pixels, 0…20.
        pub projector_blur_px: f64 = 0.0..=20.0 => 0.5,
        /// σ of the camera's Gaussian blur, camera pixels, 0…20.
        pub camera_blur_px: f64 = 0.0..=20.0,
        /// Exponent of the projector's response: light = (grey / 255)^gamma, 0.1…10.
        pub gamma: f64 = 0.1..=10.0 => 1.0,
        /// The camera's gain: counts at full scale for 1 / gain of the light, 0…100.
        pub gain: f64 = 0.0..=100.0 => 1.0,
        /// Share of full scale at which the camera clips, 0.1…1.
        pub clips_at: f64 = 0.1..=1.0 => 1.0,
        /// Share of full scale from which it makes a quarter of the counts of the same light, 0.1…1.
        pub knee_at: f64 = 0.1..=1.0 => 1.0,
        /// By how much more light than its grey asks for a picture gets whose mean light is almost
        /// 0, as a share, −1…10; one of mean 1 gets none, and others in proportion. So do
        /// projectors that adapt their LEDs to the content of a picture.
        pub content_gain: f64 = -1.0..=10.0,
    }
}

impl Noise {
    /// The half-width of the paper's uniform noise: 2.5 % of full scale.
    pub const PAPER: f64 = 0.025 * 255.0;

    /// Variance of a sample in counts²: of read noise, and per count of shot noise. `counts` is
    /// what a full well is converted to.
    pub(super) fn variance(&self, counts: f64) -> [f64; 2] {
        let per_electron = counts / self.full_well_e;
        [(self.read_noise_e * per_electron).powi(2), per_electron]
    }
}

impl RigDevice {
    /// The geometry with which frames are made: that of the models, turned by what has knocked the
    /// device since.
    pub(crate) fn lens(&self) -> Lens {
        let model = self.model();
        let knock = turn(self.knocked_deg);
        // X_device = K (R X + t).
        let columns = [0, 1, 2].map(|at| {
            let r = &model.rotation;
            turned(&knock, [r[at], r[at + 3], r[at + 6]])
        });
        Lens::new(DeviceModel {
            rotation: std::array::from_fn(|at| columns[at % 3][at / 3]),
            translation_mm: turned(&knock, model.translation_mm),
            ..model
        })
    }

    /// The exact geometry of this device when its models were made, in the form of files.
    #[must_use]
    pub fn model(&self) -> DeviceModel {
        let (sin, cos) = self.angle_deg.to_radians().sin_cos();
        let focal =
            |pixels: u32, fov: f64| f64::from(pixels) / 2.0 / (fov.to_radians() / 2.0).tan();
        let centre = |pixels: u32| (f64::from(pixels) - 1.0) / 2.0;
        DeviceModel {
            fx: focal(self.width, self.fov_deg[0]),
            fy: focal(self.height, self.fov_deg[1]),
            cx: centre(self.width),
            cy: centre(self.height),
            distortion: self.distortion,
            rotation: [cos, 0.0, -sin, 0.0, -1.0, 0.0, -sin, 0.0, -cos],
            // The device is at distance · (sin, 0, cos) and looks at the origin along its own z
            // axis.
            translation_mm: [0.0, 0.0, self.distance_mm],
        }
    }
}

/// A device in a file: every key may be left out.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct DeviceFile {
    width: Option<u32>,
    height: Option<u32>,
    fov_deg: Option<[f64; 2]>,
    angle_deg: Option<f64>,
    distance_mm: Option<f64>,
    distortion: Option<[f64; 5]>,
    knocked_deg: Option<[f64; 3]>,
}

impl DeviceFile {
    fn over(self, base: RigDevice) -> RigDevice {
        RigDevice {
            width: self.width.unwrap_or(base.width),
            height: self.height.unwrap_or(base.height),
            fov_deg: self.fov_deg.unwrap_or(base.fov_deg),
            angle_deg: self.angle_deg.unwrap_or(base.angle_deg),
            distance_mm: self.distance_mm.unwrap_or(base.distance_mm),
            distortion: self.distortion.unwrap_or(base.distortion),
            knocked_deg: self.knocked_deg.unwrap_or(base.knocked_deg),
        }
    }
}

fn camera_from<'de, D: Deserializer<'de>>(deserializer: D) -> Result<RigDevice, D::Error> {
    DeviceFile::deserialize(deserializer).map(|file| file.over(Rig::default().camera))
}

fn projector_from<'de, D: Deserializer<'de>>(deserializer: D) -> Result<RigDevice, D::Error> {
    DeviceFile::deserialize(deserializer).map(|file| file.over(Rig::default().projector))
}

/// A scenario that cannot be simulated; the message names the file, the key and the remedy.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("read scenario {place}: {problem}")]
pub struct ScenarioError {
    /// The file, as the caller named it.
    pub place: String,
    /// The key, what is wrong with it and what to write.
    pub problem: String,
}

impl Scenario {
    /// Reads and checks a scenario; `place` is its file, for messages.
    ///
    /// # Errors
    /// [`ScenarioError`] for text that is not TOML, an unknown key, or a value out of its range.
    pub fn from_toml(text: &str, place: &str) -> Result<Self, ScenarioError> {
        let failed = |problem: String| ScenarioError {
            place: place.to_owned(),
            problem: shortened(&problem),
        };
        let scenario: Self = toml::from_str(text).map_err(|error| failed(error.to_string()))?;
        scenario.check().map_err(|unfit| failed(unfit.into()))?;
        Ok(scenario)
    }

    /// Checks every value.
    ///
    /// # Errors
    /// [`Unfit`] for the first value that is wrong.
    pub fn check(&self) -> Result<(), Unfit> {
        if ![8, 10, 12].contains(&self.bit_depth) {
            return Err(Unfit::BitDepth(self.bit_depth));
        }
        Fields.check("", self)?;
        let RigDevice { width, height, .. } = self.rig.camera;
        if self.colour && width.min(height) < 2 {
            return Err(Unfit::NoGreenPlane { width, height });
        }
        let sub_rays = self.sub_rays;
        let rays = u64::from(width) * u64::from(height) * u64::from(sub_rays).pow(2);
        if rays > MAX_RAYS {
            return Err(Unfit::TooManyRays {
                width,
                height,
                sub_rays,
                rays,
            });
        }
        self.timing.check(self.refresh())?;
        self.part.check()
    }

    /// Time from one refresh of the projector to the next.
    #[must_use]
    pub fn refresh(&self) -> Duration {
        Duration::from_secs_f64(1.0 / self.refresh_hz)
    }

    /// The times and faults in the form of the virtual devices.
    pub(super) fn mechanics(&self) -> Mechanics {
        self.timing.mechanics(self.refresh(), self.faults.clone())
    }

    /// Columns and rows of a frame.
    #[must_use]
    pub fn frame_size(&self) -> (u32, u32) {
        let (camera, cell) = (&self.rig.camera, if self.colour { 2 } else { 1 });
        (camera.width / cell, camera.height / cell)
    }

    /// The exact geometry of the camera's frames.
    #[must_use]
    pub fn camera_model(&self) -> DeviceModel {
        let sensor = self.rig.camera.model();
        match self.colour {
            true => sensor.every_second(GREEN.0, GREEN.1),
            false => sensor,
        }
    }

    /// The values of the pixels in a frame, of the values of all pixels of the sensor, row by row.
    pub(super) fn in_frame<T: Copy>(&self, sensor: &[T]) -> Vec<T> {
        if !self.colour {
            return sensor.to_vec();
        }
        let ((width, height), columns) = (self.frame_size(), self.rig.camera.width);
        let place = |at: u32| (2 * (at / width) + GREEN.1) * columns + 2 * (at % width) + GREEN.0;
        let places = (0..width * height).map(|at| place(at) as usize);
        places.map(|at| sensor[at]).collect()
    }

    /// Standard deviation of one sample in counts of this camera at half of full scale, with
    /// rounding.
    #[must_use]
    pub fn noise_sigma_counts(&self) -> f64 {
        let [read, shot] = self.noise_variance();
        (read + shot * self.full_scale() / 2.0).sqrt()
    }

    /// Variance of one sample in counts² of this camera: without light, with rounding, and what a
    /// count of signal adds.
    #[must_use]
    pub fn noise_variance(&self) -> [f64; 2] {
        let full_scale = self.full_scale();
        let [read, shot] = match self.noise.noise_counts {
            Some(counts) => [(counts * full_scale / 255.0).powi(2) / 3.0, 0.0],
            None => self.noise.variance(self.optics.gain * full_scale),
        };
        [read + 1.0 / 12.0, shot]
    }

    /// The sample from which the camera clips or is not linear; `None`: full scale.
    #[must_use]
    pub fn clips_from(&self) -> Option<u16> {
        let share = self.optics.clips_at.min(self.optics.knee_at);
        (share < 1.0).then(|| (share * self.full_scale()).round() as u16)
    }

    /// The largest sample.
    pub(crate) fn full_scale(&self) -> f64 {
        f64::from((1_u32 << self.bit_depth.min(16)) - 1)
    }
}
