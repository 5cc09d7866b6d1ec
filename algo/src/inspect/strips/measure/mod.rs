//! Stages 1 and 2: the phases of a row, and the heights that follow from them.

mod decode;
mod height;

pub use decode::{Input, PhasePlan};
pub use height::{HeightRow, RecentRows};
