//! Stage 3: the part's motion is taken back.

pub mod coordinates;
pub mod displaced;
pub mod pose;
