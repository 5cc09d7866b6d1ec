//! Shapes of contours: each a file with its signed distance, its places, its dimensions, and where
//! it begins on golden, and a row among the kinds of features (`feature/kind.rs`).

pub mod circle;
pub mod line;
mod outline;
pub mod slot;

pub use outline::{
    ContourKind, Covariance, Dimensions, Foot, MAX_PARAMETERS, Marks, Outline, Parameters,
    PlanePlace, Shape, Trace, mean, padded,
};

#[cfg(test)]
mod tests;
