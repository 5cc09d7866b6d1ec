//! What a height map says about a part: regions, gauges and the comparison with the golden map.

mod deviation;
mod openings;
mod region;

pub use deviation::{Comparison, Golden, Reading};
pub use openings::{Opening, openings};
pub use region::{Region, RegionError, polygon_spans};
