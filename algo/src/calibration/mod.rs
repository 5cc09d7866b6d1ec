//! Calibration of the geometry: from pictures and phases of a checkerboard in several poses to the
//! models of camera and projector.
//!
//! `look` judges one pose: `board` finds the board (places that look like corners: `candidates`;
//! each corner to a few hundredths of a pixel: `corner`), and projector points are fitted inside
//! its squares. `solve` takes all poses: first values (`initial`), then one adjustment (`adjust`)
//! of the whole `rig`. `uncertainty` gives σ.

mod adjust;
mod board;
mod candidates;
mod corner;
mod initial;
mod look;
mod rig;
mod solve;
mod uncertainty;

pub use adjust::{Adjusted, Arrow, Residuals, Undetermined};
pub use board::{Board, BoardError, FoundBoard};
pub use candidates::GreyPicture;
pub use corner::Corner;
pub use look::{BoardNode, BoardView, FringeMaps, PoseError, look};
pub use rig::{Pose, Rig, Standing};
pub use solve::{CalibrationError, calibrate, estimate};
pub use uncertainty::{LENGTH, MeasuredBoard, Prediction};

#[cfg(test)]
mod tests;
