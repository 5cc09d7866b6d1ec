//! The report of a calibration from poses of a board, as a table and as JSON.

use crate::head::calibration::file::CalibrationFile;
use crate::head::geometry::{Geometry, SeenPose};
use crate::head::scale::Scale;
use serde_json::{Value, json};
use std::fmt::Write as _;
use std::path::Path;

/// A calibration from poses that was written.
pub(in crate::cli::calibrate) struct Report<'a> {
    pub file: &'a CalibrationFile,
    pub geometry: &'a Geometry,
    pub seen: &'a [SeenPose],
    pub scale: Scale,
    /// Fingerprint of the calibration before.
    pub before: Option<&'a str>,
    pub place: &'a Path,
    pub notes: &'a [String],
}

impl Report<'_> {
    pub fn json(&self) -> Value {
        let geometry = self.geometry;
        let poses = geometry.file.poses.iter().enumerate().map(|(at, pose)| {
            let measured = &geometry.measured[at];
            json!({
                "recording": pose.recording, "corners": pose.corners, "points": self.seen[at].view.nodes.len(),
                "blur_px": self.seen[at].view.found.blur(),
                "camera_px": pose.camera_px, "projector_px": pose.projector_px,
                "tilt_degrees": pose.tilt_degrees, "distance_mm": pose.distance_mm,
                "pitch_mm": measured.map(|board| [board.pitch.0, board.pitch.1]),
                "flatness_mm": measured.map(|board| board.flatness),
            })
        });
        let corner = |at: usize| {
            let corner = geometry.prediction.volume[at];
            [corner.x, corner.y, corner.z]
        };
        json!({
            "calibration": self.file, "file": self.place.display().to_string(), "fingerprint_before": self.before,
            "camera_px": geometry.file.camera_px, "projector_px": geometry.file.projector_px,
            "poses": poses.collect::<Vec<_>>(),
            "coverage": {
                "frame": geometry.frame_covered, "tilt_degrees": geometry.tilt_degrees, "volume_mm": [corner(0), corner(1)],
            },
            "sigma": {
                "height_mm": geometry.prediction.height, "worst_height_mm": geometry.prediction.worst_height,
                "length_100_mm": geometry.prediction.length,
            },
            "scale": self.scale, "missing": self.file.missing(), "notes": self.notes,
        })
    }

    pub fn table(&self) -> String {
        let (geometry, file) = (self.geometry, &self.geometry.file);
        let mut lines = String::new();
        // Writing to a string cannot fail.
        let _ = writeln!(
            lines,
            "pose                  corners  camera px  projector px   tilt  distance  pitch of corners  flatness"
        );
        for (pose, measured) in file.poses.iter().zip(&geometry.measured) {
            let board = measured.map_or(String::new(), |board| {
                let (x, y) = board.pitch;
                let pitch = format!("{x:.3} × {y:.3}");
                format!("{pitch:>18}{:7.3} mm", board.flatness)
            });
            let _ = writeln!(
                lines,
                "{:22}{:7}{:11.3}{:14.3}{:6.0}°{:7.0} mm{board}",
                pose.recording,
                pose.corners,
                pose.camera_px,
                pose.projector_px,
                pose.tilt_degrees,
                pose.distance_mm,
            );
        }
        let mut line = |name: &str, found: String| {
            let _ = writeln!(lines, "{name:9} {found}");
        };
        line(
            "residuals",
            format!(
                "camera {:.3} px, projector {:.3} px RMS",
                file.camera_px, file.projector_px
            ),
        );
        let [low, high] = geometry.prediction.volume;
        line(
            "coverage",
            format!(
                "corners in {:.0} % of the frame, tilts up to {:.0}° apart, volume {:.0} × {:.0} × {:.0} mm",
                geometry.frame_covered * 100.0,
                geometry.tilt_degrees,
                high.x - low.x,
                high.y - low.y,
                high.z - low.z
            ),
        );
        let prediction = &geometry.prediction;
        line(
            "σ",
            format!(
                "{:.4} mm of heights ({:.4} at worst), {:.4} mm of a length of 100 mm{}",
                prediction.height,
                prediction.worst_height,
                prediction.length,
                if file.board.sigma_ppm > 0.0 {
                    ""
                } else {
                    ", if the board's size is exact"
                }
            ),
        );
        let bow = file.board.bow_mm;
        if bow != [0.0; 3] {
            let found = format!(
                "{:.3}, {:.3}, {:.3} mm with x², y², xy",
                bow[0], bow[1], bow[2]
            );
            line("bow", found);
        }
        line("plane", geometry.ground.words());
        line("baseline", format!("{:.2} mm", file.baseline_mm));
        line(
            "scale",
            match self.scale {
                Scale::Unchecked => "unchecked: a wrong size of squares scales everything alike; state a length on the board with --check-length".into(),
                Scale::Length => "agrees with --check-length within 1 %".into(),
                Scale::Baseline => "the baseline agrees with the calibration before within 1 %".into(),
            },
        );
        let missing = self.file.missing();
        if !missing.is_empty() {
            line(
                "missing",
                format!(
                    "{}: measured on the head by `fringed calibrate`",
                    missing.join(", ")
                ),
            );
        }
        for note in self.notes {
            line("note", note.clone());
        }
        line("written", self.place.display().to_string());
        lines
    }
}
