//! The maps of a part as NPZ, as NumPy opens it: organised arrays of the frame's size.

use crate::storage::archive::stored;
use hal::npy;
use serde_json::Value;
use std::io::Write;
use zip::ZipWriter;
use zip::result::ZipError;

/// Maps of one frame, row-major in rows of `width`, NaN where there is no value.
pub struct OrganisedMaps {
    /// Pixels per row.
    pub width: usize,
    /// x, y and z in mm.
    pub points: [Vec<f32>; 3],
    /// σ_z in mm.
    pub sigma: Vec<f32>,
    /// Deviation from golden in mm.
    pub deviation: Vec<f32>,
    /// Modulation in counts.
    pub modulation: Vec<f32>,
    /// What they are of.
    pub meta: Value,
}

/// The unit of each array.
pub fn units() -> Value {
    serde_json::json!({
        "x": "mm", "y": "mm", "z": "mm", "sigma": "mm", "deviation": "mm", "modulation": "counts",
    })
}

impl OrganisedMaps {
    /// Writes the file, array by array.
    ///
    /// # Errors
    /// Whatever `out` answers.
    pub fn write(&self, out: impl Write) -> Result<(), ZipError> {
        let mut zip = ZipWriter::new_stream(out);
        zip.start_file("meta.npy", stored())?;
        zip.write_all(&npy::write_text(&self.meta.to_string()))?;
        let [x, y, z] = &self.points;
        for (name, values) in [
            ("x", x),
            ("y", y),
            ("z", z),
            ("sigma", &self.sigma),
            ("deviation", &self.deviation),
            ("modulation", &self.modulation),
        ] {
            zip.start_file(format!("{name}.npy"), stored())?;
            npy::write_to(&mut zip, self.width, values)?;
        }
        zip.finish().map(drop)
    }
}
