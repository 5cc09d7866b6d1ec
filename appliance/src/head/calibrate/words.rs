//! What was measured, in words.

use super::{Characteristics, off_proportion};
use crate::head::calibration::file::{MapFile, ReferenceFile};
use hal::head::Stamp;

impl Characteristics {
    /// What was found, each with its name.
    pub fn words(&self) -> Vec<(&'static str, String)> {
        let (timing, noise) = (&self.timing, &self.noise);
        let marks = match timing.stamp {
            Stamp::ExposureStart => "start of the exposure",
            Stamp::ExposureEnd => "end of the exposure",
            Stamp::ReadoutEnd => "end of the readout",
        };
        let late = timing.stamp_late_ns;
        let late = late.map_or(String::new(), |ns| format!(", {} µs late", ns / 1000));
        let mut found = vec![("stamps", format!("the camera's mark the {marks}{late}"))];
        found.extend(timing.refreshes.map(|refreshes| {
            let words = format!("no trigger is lost with a pattern in {refreshes} refreshes");
            ("pace", words)
        }));
        let delay = format!(
            "light comes {:.3} ms after its flip (1 σ {:.2} µs)",
            timing.flip_to_light_ns as f64 * 1e-6,
            timing.sigma_ns as f64 * 1e-3
        );
        let response = format!(
            "off proportion by {:.1} of 255 levels at most; patterns are corrected for it",
            off_proportion(&self.response)
        );
        let noise = format!(
            "{:.2} counts at half of white; {:.2} in the dark, and {:.4} counts² per count of light",
            noise.counts, noise.read_counts, noise.shot
        );
        found.extend([
            ("delay", delay),
            ("response", response),
            ("noise", noise),
            ("contrast", self.contrast.words()),
        ]);
        found
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
