//! How the scale of models is checked: the size of a board's squares leaves no residual.

use super::calibration::file::CalibrationFile;
use super::calibration::geometry::GeometryFile;
use algo::calibration::Board;
use serde::{Deserialize, Serialize};

/// Shortest length on a board that can be checked, mm.
pub const MIN_LENGTH_MM: f64 = 1e-3;
/// Longest one, mm.
pub const MAX_LENGTH_MM: f64 = 1e5;
/// Largest difference from a stated length, and of the baseline from the calibration before, as a
/// share.
const MOST_SCALE: f64 = 0.01;

/// How the scale of the models was checked.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Scale {
    /// The size of the board's squares was not checked.
    Unchecked,
    /// With a length on the board.
    Length,
    /// With the baseline of the calibration before.
    Baseline,
}

impl Scale {
    /// Compares a length on the board, mm, from the first to the last inner corner of its longer
    /// side, with its squares.
    ///
    /// # Errors
    /// In words: they differ by more than 1 %.
    pub fn check_length(board: &Board, length: Option<f64>) -> Result<(), String> {
        let nominal = (board.columns.max(board.rows) - 1) as f64 * board.square;
        match length {
            Some(length) if (length / nominal - 1.0).abs() > MOST_SCALE => Err(format!(
                "the board is {length} mm from the first to the last inner corner, and {nominal} mm by its name (--board): state the size of its squares as it is"
            )),
            _ => Ok(()),
        }
    }

    /// How the scale of the models `now` was checked: with a `length` on the board, else with the
    /// calibration `before` of the same head.
    ///
    /// # Errors
    /// In words: the baselines differ by more than 1 %.
    pub fn of(
        length: Option<f64>,
        before: Option<&CalibrationFile>,
        now: &GeometryFile,
    ) -> Result<Self, String> {
        if length.is_some() {
            return Ok(Self::Length);
        }
        let Some(before) = before else {
            return Ok(Self::Unchecked);
        };
        let then = baseline(before)?;
        if !((now.baseline_mm / then - 1.0).abs() <= MOST_SCALE) {
            return Err(format!(
                "camera and projector are {:.2} mm apart, and {then:.2} mm in the calibration before: correct the size of the squares in the board's \
                 name (--board), or measure the board and state its length (--check-length) if the head was changed",
                now.baseline_mm
            ));
        }
        Ok(Self::Baseline)
    }
}

/// Distance between the centres of camera and projector of a calibration, mm.
fn baseline(file: &CalibrationFile) -> Result<f64, String> {
    let calibration = file.calibration()?;
    let (camera, projector) = (&calibration.camera, &calibration.projector);
    Ok((projector.centre() - camera.centre()).length())
}
