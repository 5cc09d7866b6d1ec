//! Stage 4: what the rows of a strip add up to, and what is planned of the gauges for it.

pub mod counts;
pub mod coverage;
pub mod gauges;
pub mod sections;
pub mod squares;
pub mod sums;
