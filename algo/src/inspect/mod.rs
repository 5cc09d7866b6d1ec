//! What a height map says about a part: regions, gauges and the comparison with the golden map.

mod deviation;
mod openings;
mod region;
mod strips;

pub use deviation::{Comparison, Golden, Reading};
pub use openings::{Opening, openings};
pub use region::{Region, RegionError, polygon_spans};
pub use strips::{Findings, Measure, Production, Skipped, Strip, Taught, TooSmooth};
