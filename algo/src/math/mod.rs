//! Integer trigonometry and small exact arithmetic.

pub mod atan;
pub mod solve;
