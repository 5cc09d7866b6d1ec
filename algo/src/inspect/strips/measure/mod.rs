//! Stages 1 and 2: the phases of a row, and the heights that follow from them.

pub mod decode;
pub mod height;
