//! Bounds of every value of `calibration.json`. Whether the models are usable cameras is checked by the geometry.

use super::file::{CalibrationFile, MapFile};
use hal::bounds::{
    MAX_FRINGES, MAX_NOISE_COUNTS, MAX_SIDE, MIN_NOISE_COUNTS, fingerprint, length, text, within,
};

/// Lowest temperature of a head, °C.
pub const COLDEST_C: f64 = -100.0;
/// Highest temperature of a head, °C.
pub const HOTTEST_C: f64 = 200.0;
/// Longest delay, standard deviation of it, and readout, ns.
const MAX_TIME_NS: u64 = 10_000_000_000;
/// Most refreshes per pattern.
const MAX_REFRESHES: u32 = 1000;
/// Longest name of a program or a file, characters.
const MAX_NAME: usize = 255;
/// Longest list of the files that models came from, characters.
const MAX_SOURCES: usize = 8192;
/// The last second of the year 9999.
const LAST_SECOND: u64 = 253_402_300_799;
/// Most levels of noise and pitches of contrast.
const MAX_LEVELS: usize = 256;

impl CalibrationFile {
    /// Checks each value by itself.
    ///
    /// # Errors
    /// In words that name the key, the value and the bounds.
    pub fn check_bounds(&self) -> Result<(), String> {
        fingerprint("fingerprint", &self.fingerprint)?;
        text("made_by", &self.made_by, MAX_NAME)?;
        within("made_at_unix_s", self.made_at_unix_s, 0, LAST_SECOND)?;
        if let Some(celsius) = self.temperature_c {
            within("temperature_c", celsius, COLDEST_C, HOTTEST_C)?;
        }
        text("models_from", &self.models_from, MAX_SOURCES)?;
        let (camera, projector) = (&self.camera, &self.projector);
        within("camera.width", camera.width, 1, MAX_SIDE)?;
        within("camera.height", camera.height, 1, MAX_SIDE)?;
        within("camera.bit_depth", camera.bit_depth, 8, 16)?;
        within("projector.width", projector.width, 1, MAX_SIDE)?;
        within("projector.height", projector.height, 1, MAX_SIDE)?;
        let most = MAX_NOISE_COUNTS;
        if let Some(timing) = &self.timing {
            for (key, ns) in [
                ("timing.flip_to_light_ns", timing.flip_to_light_ns),
                ("timing.sigma_ns", timing.sigma_ns),
                ("timing.readout_ns", timing.readout_ns),
                ("timing.stamp_late_ns", timing.stamp_late_ns.unwrap_or(0)),
            ] {
                within(key, ns, 0, MAX_TIME_NS)?;
            }
            if let Some(refreshes) = timing.refreshes {
                within("timing.refreshes", refreshes, 1, MAX_REFRESHES)?;
            }
        }
        if let Some(noise) = &self.noise {
            within("noise.counts", noise.counts, MIN_NOISE_COUNTS, most)?;
            within("noise.read_counts", noise.read_counts, 0.0, most)?;
            within("noise.shot", noise.shot, 0.0, most)?;
            length("noise.levels", noise.levels.len(), 0, MAX_LEVELS)?;
            if let Some(exposing) = &noise.exposing {
                exposing.check_bounds("noise.exposing")?;
            }
            for level in &noise.levels {
                within("noise.levels.level", level.level, 0.0, most)?;
                within("noise.levels.counts", level.counts, 0.0, most)?;
            }
        }
        if let Some(response) = &self.response {
            length("response", response.len(), 256, 256)?;
        }
        if let Some(contrast) = &self.contrast {
            let modulation = contrast.modulation_counts;
            within("contrast.modulation_counts", modulation, 0.0, most)?;
            length("contrast.pitches", contrast.pitches.len(), 0, MAX_LEVELS)?;
            for pitch in &contrast.pitches {
                within("contrast.pitches.pitch_px", pitch.pitch_px, 1, MAX_SIDE)?;
                within("contrast.pitches.contrast", pitch.contrast, 0.0, 100.0)?;
            }
        }
        if let Some(geometry) = &self.geometry {
            geometry.check_bounds()?;
        }
        let Some(reference) = &self.reference else {
            return Ok(());
        };
        let (pitch, off) = (reference.pitch_px, reference.models_off_px);
        within("reference.pitch_px", pitch, 1.0, f64::from(MAX_SIDE))?;
        within("reference.models_off_px", off, 0.0, f64::from(MAX_SIDE))?;
        reference.plane.check_bounds("reference.plane")?;
        reference.vertical.check_bounds("reference.vertical")?;
        reference.horizontal.check_bounds("reference.horizontal")
    }
}

impl MapFile {
    fn check_bounds(&self, key: &str) -> Result<(), String> {
        let inner = |name: &str| format!("{key}.{name}");
        text(&inner("file"), &self.file, MAX_NAME)?;
        if self.file.is_empty() || self.file.contains(['/', '\\']) {
            return Err(format!(
                "{key}.file is {:?}: it must be the name of a file beside this one",
                self.file
            ));
        }
        fingerprint(&inner("sha256"), &self.sha256)?;
        let (residual, noise) = (self.residual_turns, self.noise_turns);
        within(&inner("residual_turns"), residual, 0.0, MAX_FRINGES)?;
        within(&inner("noise_turns"), noise, 0.0, MAX_FRINGES)?;
        within(&inner("filled"), self.filled, 0.0, 1.0)
    }
}
