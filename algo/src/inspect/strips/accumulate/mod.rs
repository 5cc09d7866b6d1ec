//! Stage 4: what the rows of a strip add up to, and what is planned of the gauges for it.

mod counts;
pub mod coverage;
mod gauges;
mod sections;
pub mod squares;
mod sums;

pub use counts::TRUSTS;
pub use coverage::Threshold;
pub use gauges::{Gauge, Gauges, MAX_FEATURES, MAX_GAUGES, Patch, Unmeasurable};
pub use sections::{ExpectedSection, SectionSight, Sections};
pub use sums::{StripSums, add_up};
