//! Small exact arithmetic.

pub mod solve;
