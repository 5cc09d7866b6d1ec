//! Rounding to whole numbers, and least squares for a few unknowns.

pub(crate) mod nearest;
pub mod solve;
