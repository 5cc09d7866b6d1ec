//! The report of `fringed calibrate`, as a table and as JSON.

pub(super) mod poses;

use crate::head::calibrate::off_proportion;
use crate::head::calibration::file::{CalibrationFile, MapFile};
use hal::head::Stamp;
use serde_json::{Value, json};
use std::fmt::Write as _;
use std::path::Path;

/// A calibration that was written.
pub(super) struct Report<'a> {
    pub file: &'a CalibrationFile,
    /// Fingerprint of the calibration before.
    pub before: Option<&'a str>,
    pub place: &'a Path,
    pub notes: &'a [String],
}

impl Report<'_> {
    pub fn json(&self) -> Value {
        json!({
            "calibration": self.file, "file": self.place.display().to_string(), "notes": self.notes,
            "fingerprint_before": self.before,
        })
    }

    pub fn table(&self) -> String {
        let file = self.file;
        let mut lines = String::new();
        let mut line = |name: &str, found: String| {
            // Writing to a string cannot fail.
            let _ = writeln!(lines, "{name:9} {found}");
        };
        line("models", format!("of {}", file.models_from));
        if let Some(timing) = &file.timing {
            let marks = match timing.stamp {
                Stamp::ExposureStart => "start of the exposure",
                Stamp::ExposureEnd => "end of the exposure",
                Stamp::ReadoutEnd => "end of the readout",
            };
            let late = timing
                .stamp_late_ns
                .map(|ns| format!(", {} µs late", ns / 1000));
            let late = late.unwrap_or_default();
            line("stamps", format!("the camera's mark the {marks}{late}"));
            if let Some(refreshes) = timing.refreshes {
                line(
                    "pace",
                    format!("no trigger is lost with a pattern in {refreshes} refreshes"),
                );
            }
            line(
                "delay",
                format!(
                    "light comes {:.3} ms after its flip (1 σ {:.2} µs)",
                    timing.flip_to_light_ns as f64 * 1e-6,
                    timing.sigma_ns as f64 * 1e-3
                ),
            );
        }
        if let Some(response) = &file.response {
            line(
                "response",
                format!(
                    "off proportion by {:.1} of 255 levels at most; patterns are corrected for it",
                    off_proportion(response)
                ),
            );
        }
        if let Some(noise) = &file.noise {
            line(
                "noise",
                format!(
                    "{:.2} counts at half of white; {:.2} in the dark, and {:.4} counts² per count of light",
                    noise.counts, noise.read_counts, noise.shot
                ),
            );
        }
        if let Some(contrast) = &file.contrast {
            line("contrast", contrast.words());
        }
        if let Some(maps) = &file.reference {
            let residual = |name: &str, map: &MapFile| {
                format!(
                    "{name} {:.5} turn (noise {:.4})",
                    map.residual_turns, map.noise_turns
                )
            };
            line(
                "plane",
                format!(
                    "residual {}, {}; the models are off it by {:.3} px",
                    residual("vertical", &maps.vertical),
                    residual("horizontal", &maps.horizontal),
                    maps.models_off_px
                ),
            );
        }
        for note in self.notes {
            line("note", note.clone());
        }
        let digits = |fingerprint: &str| fingerprint.get(..8).unwrap_or_default().to_owned();
        let recipes = match self.before {
            Some(before) if before != file.fingerprint => format!(
                "was {}: recipes made for that one are refused, teach them again",
                digits(before)
            ),
            Some(_) => "as before: recipes stay valid".into(),
            None => "the first one here".into(),
        };
        line(
            "written",
            format!(
                "{}, fingerprint {}, {recipes}",
                self.place.display(),
                digits(&file.fingerprint)
            ),
        );
        lines
    }
}
