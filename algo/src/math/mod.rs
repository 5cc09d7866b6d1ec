//! Small exact arithmetic.

pub(crate) mod nearest;
pub mod solve;
