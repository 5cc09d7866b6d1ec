//! What is known of a part after one cycle.

use super::contours::FoundFeature;
use crate::inspect::align::Placed;
use crate::inspect::gauge::{MAX_PLACES, Reading};
use crate::inspect::strips::accumulate::{MAX_FEATURES, MAX_GAUGES};

/// Everything that is known of a part after one cycle.
#[derive(Clone, Debug, PartialEq)]
pub struct Findings {
    /// Per gauge; `None` where there was nothing to measure.
    pub readings: heapless::Vec<Option<Reading>, MAX_GAUGES>,
    /// Per gauge without a value, why.
    pub missing: heapless::Vec<Option<Missing>, MAX_GAUGES>,
    /// The planes and contours that gauges need.
    pub features: heapless::Vec<FoundFeature, MAX_FEATURES>,
    /// Pixels with a height.
    pub resolved: u64,
    /// Share of the compared surface inside the window that has a height.
    pub coverage: f64,
    /// RMS of σ_z over the compared pixels, mm; 0 if there are none.
    pub height_noise_mm: f64,
    /// RMS of the taught σ_z over the pixels with a height, mm; 0 if there are none.
    pub taught_noise_mm: f64,
    /// Share of the pixels with enough light whose levels contradict each other.
    pub contradicting: f64,
    /// How the part lies; none if it was not aligned.
    pub placed: Option<Placed>,
    /// What was not computed.
    pub skipped: Skipped,
}

/// Why a gauge has no value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Missing {
    /// There was nothing to measure.
    Nothing,
    /// Of cells: which share of each of its features as taught was measured.
    Cells([f64; MAX_PLACES]),
    /// One of [`Findings::features`] was not found.
    Feature(usize),
    /// The value depends on how the part lies along a direction that its shape leaves open.
    Open,
}

/// What was not computed, or not by the fast way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Skipped {
    /// Pixels outside of every gauge's region and smoothing.
    pub outside: u64,
    /// Pixels without a known phase to unwrap about.
    pub unexpected: u64,
    /// Pixels that the pattern's light does not reach, without finer levels.
    pub dark: u64,
    /// Heights too far from golden for the cubics, triangulated exactly.
    pub exact: u64,
}
