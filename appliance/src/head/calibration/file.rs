//! `calibration.json`, version 2: its keys, its checks, its fingerprint and its checksum.

use super::CalibrationSigma;
use super::geometry::{GeometryFile, ReferenceFile};
use super::{Calibration, HeightsBy, inverted, size};
use crate::error::{Exit, Failure, Result};
use crate::head::exposing::Exposing;
use crate::head::seam;
use crate::storage::hex;
use crate::system::clock;
use algo::frame::SampleNoise;
use algo::geometry::Pinhole;
use hal::bounded;
use hal::bounds::{
    Bound as _, Fields, LAST_SECOND, Longest, MAX_NAME, MAX_NOISE_COUNTS, MAX_SIDE,
    MIN_NOISE_COUNTS, clipped, fingerprint, length, shortened,
};
use hal::head::{Stamp, Timing};
use hal::model::{DeviceModel, PlaneModel};
use serde::Deserialize;
use sha2::{Digest, Sha256};
use std::time::Duration;

/// The name of the format.
pub const FORMAT: &str = "fringed-calibration";
/// The version that this program writes, and the only one that it reads.
pub const VERSION: u32 = 2;
/// Lowest temperature of a head, °C.
pub const COLDEST_C: f64 = -100.0;
/// Highest temperature of a head, °C.
pub const HOTTEST_C: f64 = 200.0;
/// Longest delay, standard deviation of it, and readout, ns.
const MAX_TIME_NS: u64 = 10_000_000_000;
/// Most refreshes per pattern.
const MAX_REFRESHES: u32 = 1000;
/// Longest list of the files that models came from, characters.
const MAX_SOURCES: usize = 8192;
/// Most levels of noise and pitches of contrast.
const MAX_LEVELS: usize = 256;
/// Stands in place of the checksum while it is computed.
const NO_CHECKSUM: &str = "0000000000000000000000000000000000000000000000000000000000000000";
/// σ of a sample in counts where it was not measured. Nothing is measured with such a calibration
/// ([`CalibrationFile::missing`]).
const NOMINAL_NOISE: f64 = 1.0;

bounded! {
    /// The file. docs/formats.md lists the keys.
    pub struct CalibrationFile {
        /// [`FORMAT`].
        pub format: String,
        /// [`VERSION`].
        pub version: u32,
        /// Fingerprint of everything that heights depend on; recipes carry it.
        pub fingerprint: String,
        /// SHA-256 of the whole file.
        pub checksum: String,
        /// The program that made it.
        pub made_by: String = Longest(MAX_NAME),
        /// When it was made, 0 if the clock was not synchronised.
        pub made_at_unix_s: u64 = 0..=LAST_SECOND,
        /// Temperature of the head, if it was given.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub temperature_c: Option<f64> = COLDEST_C..=HOTTEST_C,
        /// Where the models come from.
        pub models_from: String = Longest(MAX_SOURCES),
        /// The camera.
        pub camera: CalibratedCamera = Fields,
        /// The projector.
        pub projector: CalibratedProjector = Fields,
        /// Flips, light and stamps.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub timing: Option<TimingFile> = Fields,
        /// The camera's noise.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub noise: Option<NoiseFile> = Fields,
        /// The light of each of the 256 grey levels, 0 for black, 255 for white.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub response: Option<Vec<f64>>,
        /// Contrast of fringes against their pitch.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub contrast: Option<ContrastFile> = Fields,
        /// What heights go by.
        pub heights_by: HeightsBy,
        /// The reference phase maps, if a plate was measured.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub reference: Option<ReferenceFile> = Fields,
        /// How the models were made, if they come from poses of a board.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub geometry: Option<GeometryFile>,
    }

    /// Size and geometry of the camera.
    pub struct CalibratedCamera {
        /// Columns.
        pub width: u32 = 1..=MAX_SIDE,
        /// Rows.
        pub height: u32 = 1..=MAX_SIDE,
        /// Bits per sample.
        pub bit_depth: u8 = 8..=16,
        /// Intrinsic numbers and pose.
        pub model: DeviceModel,
    }

    /// Size and geometry of the projector.
    pub struct CalibratedProjector {
        /// Columns.
        pub width: u32 = 1..=MAX_SIDE,
        /// Rows.
        pub height: u32 = 1..=MAX_SIDE,
        /// Intrinsic numbers and pose.
        pub model: DeviceModel,
    }

    /// Timing of flips, light and stamps.
    pub struct TimingFile {
        /// From a flip to its light.
        pub flip_to_light_ns: u64 = 0..=MAX_TIME_NS,
        /// σ of the delay.
        pub sigma_ns: u64 = 0..=MAX_TIME_NS,
        /// What the camera's stamps mark.
        pub stamp: Stamp,
        /// From the moment that they mark to the stamps; of a triggered camera only.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub stamp_late_ns: Option<u64> = 0..=MAX_TIME_NS,
        /// From the end of an exposure to the end of its readout.
        pub readout_ns: u64 = 0..=MAX_TIME_NS,
        /// Refreshes per pattern at which a triggered camera was proven to lose no trigger.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub refreshes: Option<u32> = 1..=MAX_REFRESHES,
    }
}

impl TimingFile {
    /// The head's timing with these times; what is not measured stays as `before`.
    pub fn over(&self, before: Timing) -> Timing {
        Timing {
            flip_to_light: Duration::from_nanos(self.flip_to_light_ns),
            stamp: self.stamp,
            stamp_late: Duration::from_nanos(self.stamp_late_ns.unwrap_or(0)),
            readout: Duration::from_nanos(self.readout_ns),
            hold: self.refreshes.unwrap_or(before.hold),
            ..before
        }
    }
}

bounded! {
    /// The camera's noise.
    pub struct NoiseFile {
        /// σ of one sample at half the light of white, counts.
        pub counts: f64 = MIN_NOISE_COUNTS..=MAX_NOISE_COUNTS,
        /// σ in the dark, counts.
        pub read_counts: f64 = 0.0..=MAX_NOISE_COUNTS,
        /// Shot noise: variance that light adds, counts² per count.
        pub shot: f64 = 0.0..=MAX_NOISE_COUNTS,
        /// The measured levels.
        pub levels: Vec<LevelFile> = Fields,
        /// The sample from which the camera clips or is not linear, counts; left out where that is full scale,
        /// or not known.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub clips_from: Option<u16> = 1..=u16::MAX,
        /// The exposure and gain at which it was measured; `None` where they are not known.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub exposing: Option<Exposing> = Fields,
    }
}

impl NoiseFile {
    /// The noise by the mean signal.
    pub fn by_signal(&self) -> SampleNoise {
        SampleNoise::new(self.read_counts, self.shot)
    }
}

bounded! {
    /// Noise at one level.
    pub struct LevelFile {
        /// Mean sample, counts.
        pub level: f64 = 0.0..=MAX_NOISE_COUNTS,
        /// σ of one sample, counts.
        pub counts: f64 = 0.0..=MAX_NOISE_COUNTS,
    }

    /// Contrast against pitch.
    pub struct ContrastFile {
        /// Median modulation of the coarsest pitch, counts.
        pub modulation_counts: f64 = 0.0..=MAX_NOISE_COUNTS,
        /// Contrast of each pitch, the coarsest first.
        pub pitches: Vec<PitchFile> = Fields,
    }
}

impl ContrastFile {
    /// The contrasts for people.
    pub fn words(&self) -> String {
        let pitches = self.pitches.iter();
        let pitches: Vec<String> = pitches
            .map(|pitch| format!("{:.0} % at {} px", pitch.contrast * 100.0, pitch.pitch_px))
            .collect();
        pitches.join(", ")
    }
}

bounded! {
    /// Contrast of one pitch.
    pub struct PitchFile {
        /// Projector pixels per fringe.
        pub pitch_px: u32 = 1..=MAX_SIDE,
        /// Modulation relative to that of the coarsest.
        pub contrast: f64 = 0.0..=100.0,
    }
}

impl CalibrationFile {
    /// A file that is made now and has models only. It gets its fingerprint and its checksum when
    /// it is [sealed](Self::sealed).
    pub fn of_models(bit_depth: u8, camera: &Pinhole, projector: &Pinhole, from: String) -> Self {
        let ((width, height), (columns, rows)) = (size(camera), size(projector));
        Self {
            format: FORMAT.into(),
            version: VERSION,
            fingerprint: String::new(),
            checksum: String::new(),
            made_by: concat!("fringed ", env!("CARGO_PKG_VERSION")).into(),
            made_at_unix_s: clock::utc_us().unwrap_or(0) / 1_000_000,
            temperature_c: None,
            models_from: from,
            camera: CalibratedCamera {
                width,
                height,
                bit_depth,
                model: seam::device_model(camera),
            },
            projector: CalibratedProjector {
                width: columns,
                height: rows,
                model: seam::device_model(projector),
            },
            timing: None,
            noise: None,
            response: None,
            contrast: None,
            heights_by: HeightsBy::Models,
            reference: None,
            geometry: None,
        }
    }

    /// As [`Calibration::sizes`].
    pub fn sizes(&self) -> [u32; 5] {
        let (camera, projector) = (&self.camera, &self.projector);
        let bits = u32::from(camera.bit_depth);
        [
            camera.width,
            camera.height,
            bits,
            projector.width,
            projector.height,
        ]
    }

    /// Reads and checks the bytes of a file.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn read(bytes: &[u8]) -> Result<Self> {
        #[derive(Deserialize)]
        struct FormatVersion {
            format: String,
            version: u32,
        }
        let wrong = |what: String| Failure::new(Exit::Content, format!("{what}: calibrate anew"));
        let damaged = |error: serde_json::Error| {
            wrong(format!("it is damaged: {}", shortened(&error.to_string())))
        };
        let named: FormatVersion = serde_json::from_slice(bytes).map_err(damaged)?;
        if named.format != FORMAT {
            let found = clipped(&named.format).to_string();
            return Exit::Content.fail(format!("its format is {found:?}, expected {FORMAT:?}"));
        }
        if named.version != VERSION {
            return Err(wrong(format!(
                "it has version {}, this program reads {VERSION}",
                named.version
            )));
        }
        let file: Self = serde_json::from_slice(bytes).map_err(damaged)?;
        if file.checksum != file.checksummed() {
            return Exit::Content.fail(
                "it does not agree with its checksum: it is damaged, or was edited; calibrate anew",
            );
        }
        if file.heights_by == HeightsBy::Measured && file.reference.is_none() {
            return Exit::Content.fail(
                "heights_by is \"measured\", and reference is missing: calibrate anew with a plate",
            );
        }
        if file.calibration()?.fingerprint() != file.fingerprint {
            return Exit::Content
                .fail("its fingerprint is not that of its content: calibrate anew");
        }
        Ok(file)
    }

    /// Checks each value by itself.
    ///
    /// # Errors
    /// In words that name the key, the value and the bounds.
    fn check_bounds(&self) -> Result<(), String> {
        fingerprint("fingerprint", &self.fingerprint)?;
        Fields.check("", self)?;
        if let Some(noise) = &self.noise {
            length("noise.levels", noise.levels.len(), 0, MAX_LEVELS)?;
        }
        if let Some(response) = &self.response {
            length("response", response.len(), 256, 256)?;
        }
        if let Some(contrast) = &self.contrast {
            length("contrast.pitches", contrast.pitches.len(), 0, MAX_LEVELS)?;
        }
        if let Some(geometry) = &self.geometry {
            geometry.check_bounds()?;
        }
        let Some(reference) = &self.reference else {
            return Ok(());
        };
        reference.vertical.check_bounds("reference.vertical")?;
        reference.horizontal.check_bounds("reference.horizontal")
    }

    /// The names of the reference phase maps beside it.
    pub fn maps(&self) -> Vec<&str> {
        let maps = self.reference.as_ref();
        maps.map_or_else(Vec::new, |maps| {
            vec![&*maps.vertical.file, &*maps.horizontal.file]
        })
    }

    /// What the measured reference plane is off the models.
    fn plane(&self) -> Option<PlaneModel> {
        Some(self.reference.as_ref()?.plane.clone())
    }

    /// The calibration.
    ///
    /// # Errors
    /// If a value is out of its bounds, a model is absurd, or the response cannot be inverted.
    pub fn calibration(&self) -> Result<Calibration> {
        self.check_bounds()
            .map_err(|error| Failure::new(Exit::Content, format!("{error}: calibrate anew")))?;
        let (camera, projector) = (&self.camera, &self.projector);
        let nominal = SampleNoise::constant(NOMINAL_NOISE);
        Ok(Calibration {
            noise: self.noise.as_ref().map_or(nominal, NoiseFile::by_signal),
            exposing: self.noise.as_ref().and_then(|noise| noise.exposing),
            contrast: self.contrast.clone(),
            plane: self.plane(),
            heights_by: self.heights_by,
            response: self.response.as_deref().map_or(Ok(None), inverted)?,
            linear: self.response.is_some(),
            sigma: self.geometry.as_ref().map(|geometry| CalibrationSigma {
                height_mm: geometry.height_sigma_mm,
                length_mm: geometry.length_sigma_mm,
            }),
            ..Calibration::new(
                (camera.width, camera.height, camera.bit_depth),
                (projector.width, projector.height),
                (&camera.model, &projector.model),
                self.noise
                    .as_ref()
                    .map_or(NOMINAL_NOISE, |noise| noise.counts),
            )?
        })
    }

    /// What is still to be measured on the head before anything can be measured with it; empty if
    /// nothing is.
    pub fn missing(&self) -> Vec<&'static str> {
        let keys = [
            ("timing", self.timing.is_some()),
            ("noise", self.noise.is_some()),
            ("response", self.response.is_some()),
            ("contrast", self.contrast.is_some()),
        ];
        let missing = keys.into_iter().filter(|(_, there)| !there);
        missing.map(|(key, _)| key).collect()
    }

    /// The head's timing by this calibration; what is not calibrated stays as `before`.
    pub fn timing(&self, before: Timing) -> Timing {
        self.timing
            .as_ref()
            .map_or(before, |timing| timing.over(before))
    }

    /// The file's bytes, with fingerprint and checksum.
    ///
    /// # Errors
    /// If a number in it is not finite or the response cannot be inverted.
    pub fn sealed(mut self) -> Result<(Self, Vec<u8>)> {
        // The bounds ask for a fingerprint's form before there is one.
        self.fingerprint = NO_CHECKSUM.into();
        self.fingerprint = self.calibration()?.fingerprint();
        self.checksum = self.checksummed();
        let mut bytes = serde_json::to_vec_pretty(&self).map_err(Exit::Content.failure())?;
        bytes.push(b'\n');
        // A file that could not be read again is never written.
        let again = Self::read(&bytes)?;
        Ok((again, bytes))
    }

    fn checksummed(&self) -> String {
        let mut bare = self.clone();
        bare.checksum = NO_CHECKSUM.into();
        // Numbers and strings in structs: writing them cannot fail.
        hex(&Sha256::digest(
            serde_json::to_vec(&bare).unwrap_or_default(),
        ))
    }
}
