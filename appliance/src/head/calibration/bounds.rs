//! Bounds of the lists and texts of `calibration.json`; those of single values stand beside them in
//! [`super::file`]. Whether the models are usable cameras is checked by the geometry.

use super::file::{CalibrationFile, MapFile};
use hal::bounds::{Bound, Fields, fingerprint, length};

/// Most levels of noise and pitches of contrast.
const MAX_LEVELS: usize = 256;

impl CalibrationFile {
    /// Checks each value by itself.
    ///
    /// # Errors
    /// In words that name the key, the value and the bounds.
    pub fn check_bounds(&self) -> Result<(), String> {
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
}

impl MapFile {
    fn check_bounds(&self, key: &str) -> Result<(), String> {
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
