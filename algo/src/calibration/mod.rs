//! Calibration of the geometry: from pictures and phases of a checkerboard in several poses to the
//! models of camera and projector.
//!
//! `look` judges one pose (corners: `candidates`, `grid`, `corner`; projector points: `nodes`),
//! `solve` all of them (`initial`, `adjust`), `predict` gives σ.

mod adjust;
mod arrows;
mod board;
mod candidates;
mod corner;
mod grid;
mod initial;
mod lengths;
mod look;
mod nodes;
mod picture;
mod pose;
mod predict;
mod print;
mod rig;
mod solve;
mod standing;

pub use adjust::{Adjusted, Residuals, Undetermined, View};
pub use arrows::Arrow;
pub use board::{Board, BoardError, FoundBoard};
pub use corner::Corner;
pub use lengths::MeasuredBoard;
pub use look::{PoseError, look};
pub use nodes::{Fringes, Node};
pub use picture::Picture;
pub use pose::Pose;
pub use predict::{LENGTH, Prediction};
pub use rig::Rig;
pub use solve::{CalibrationError, calibrate, estimate};
pub use standing::Standing;

#[cfg(test)]
mod tests;
