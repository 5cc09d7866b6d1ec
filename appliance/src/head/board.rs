//! The checkerboard: its name (`checker:9x13:10` has 9 × 13 inner corners and squares of 10 mm), how the
//! scale that it gives the models is checked, and which pose of it is z = 0.

use super::calibration::file::CalibrationFile;
use super::calibration::geometry::{GeometryFile, MAX_CORNERS, MAX_SQUARE_MM};
use crate::error::{Exit, Result};
use algo::calibration::{Board, Standing};
use algo::geometry::{Pinhole, Vector};
use serde::{Deserialize, Serialize};

/// Shortest length on a board that can be checked, mm.
pub const MIN_LENGTH_MM: f64 = 1e-3;
/// Longest one, mm.
pub const MAX_LENGTH_MM: f64 = 1e5;
/// Largest difference from a stated length, and of the baseline from the calibration before, as a
/// share.
const MOST_SCALE: f64 = 0.01;

/// A board from its name.
///
/// # Errors
/// What a name must be like.
pub fn parse(text: &str) -> Result<Board> {
    let parsed = || {
        let (counts, square) = text.strip_prefix("checker:")?.split_once(':')?;
        let (columns, rows) = counts.split_once('x')?;
        Some(Board {
            columns: columns.parse().ok()?,
            rows: rows.parse().ok()?,
            square: square.parse().ok()?,
        })
    };
    let inside = |board: &Board| {
        let counts = 3..=MAX_CORNERS;
        counts.contains(&board.columns)
            && counts.contains(&board.rows)
            && (1e-3..=MAX_SQUARE_MM).contains(&board.square)
    };
    let Some(board) = parsed().filter(inside) else {
        return Exit::Content.fail(format!(
            "write checker:9x13:10 for 9 × 13 inner corners (3 to {MAX_CORNERS}) and squares of 10 mm"
        ));
    };
    if board.columns == board.rows {
        return Exit::Content.fail("take a board with different numbers of columns and rows: with equal numbers, x and y could be confused");
    }
    Ok(board)
}

/// The name of a board.
pub fn name(board: &Board) -> String {
    format!("checker:{}x{}:{}", board.columns, board.rows, board.square)
}

impl GeometryFile {
    /// Where models come from that were made of these poses.
    pub fn source(&self) -> String {
        let board = Board {
            columns: self.board.columns,
            rows: self.board.rows,
            square: self.board.square_mm,
        };
        format!("{} poses of {}", self.poses.len(), name(&board))
    }
}

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
    /// They differ by more than 1 %.
    pub fn check_length(board: &Board, length: Option<f64>) -> Result<()> {
        let nominal = (board.columns.max(board.rows) - 1) as f64 * board.square;
        match length {
            Some(length) if (length / nominal - 1.0).abs() > MOST_SCALE => {
                Exit::Content.fail(format!(
                    "the board is {length} mm from the first to the last inner corner, and {nominal} mm by its name (--board): state the size of its squares as it is"
                ))
            }
            _ => Ok(()),
        }
    }

    /// How the scale of the models `now` was checked: with a `length` on the board, else with the
    /// calibration `before` of the same head.
    ///
    /// # Errors
    /// The baselines differ by more than 1 %.
    pub fn of(
        length: Option<f64>,
        before: Option<&CalibrationFile>,
        now: &GeometryFile,
    ) -> Result<Self> {
        if length.is_some() {
            return Ok(Self::Length);
        }
        let Some(before) = before else {
            return Ok(Self::Unchecked);
        };
        let then = baseline(before)?;
        if !((now.baseline_mm / then - 1.0).abs() <= MOST_SCALE) {
            let now = now.baseline_mm;
            return Exit::Content.fail(format!(
                "camera and projector are {now:.2} mm apart, and {then:.2} mm in the calibration before: correct the size of the squares in the board's \
                 name (--board), or measure the board and state its length (--check-length) if the head was changed"
            ));
        }
        Ok(Self::Baseline)
    }
}

/// Distance between the centres of camera and projector of a calibration, mm.
fn baseline(file: &CalibrationFile) -> Result<f64> {
    let calibration = file.calibration()?;
    let (camera, projector) = (&calibration.camera, &calibration.projector);
    Ok((projector.centre() - camera.centre()).length())
}

/// The pose that z = 0 goes by.
#[derive(Clone, Debug, PartialEq)]
pub struct Ground {
    /// Its name.
    pub pose: String,
    /// How the board stands in it.
    pub standing: Standing,
}

impl Ground {
    /// The pose with this name, whose board is z = 0 of these models.
    pub fn of(pose: &str, camera: &Pinhole, projector: &Pinhole) -> Self {
        let up = Vector::new(0.0, 0.0, 1.0);
        Self {
            pose: pose.to_owned(),
            standing: Standing::new(up, camera.centre(), projector.centre()),
        }
    }

    /// Where z = 0 is.
    pub fn words(&self) -> String {
        let Standing {
            camera, projector, ..
        } = self.standing;
        format!(
            "z = 0 is the board as it lies in {}, tilted by {:.0}° to the camera and by {:.0}° to the projector",
            self.pose,
            camera.to_degrees(),
            projector.to_degrees()
        )
    }

    /// What to do if the board can hardly have lain flat under the head.
    pub fn remedy(&self) -> Option<String> {
        let aside = self.standing.aside.to_degrees();
        self.standing.is_doubtful().then(|| {
            format!(
                "in {} the board is tilted ({aside:.0}° aside of camera and projector): unless the parts lie like this, lay it flat where they lie, and take that as the last pose",
                self.pose
            )
        })
    }
}
