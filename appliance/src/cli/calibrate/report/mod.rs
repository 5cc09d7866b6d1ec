//! The report of `fringed calibrate`, as a table and as JSON.

pub(super) mod poses;

use crate::head::calibrate::Characteristics;
use crate::head::calibration::file::CalibrationFile;
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
        for (name, found) in Characteristics::of(file)
            .iter()
            .flat_map(Characteristics::words)
        {
            line(name, found);
        }
        if let Some(plane) = &file.reference {
            line("plane", plane.words());
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
