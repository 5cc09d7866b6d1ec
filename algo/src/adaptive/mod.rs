//! Patterns made for a part: curved fringes of varying pitch.
//!
//! [`paper`] is the method of Peng & Gupta (2008), eqs. 2–9, unchanged: the baseline. [`noise`] has
//! less error: on every part of the surface it takes the local frequency that gives the least error
//! with the light of the part and the contrast that projector and camera have. Both compute a field
//! of frequencies over the projector's raster ([`Field`]) from the projector point of each camera
//! pixel ([`ProjectorMap`]) and integrate it to a phase function.

pub mod amplitude;
mod blur;
mod field;
mod map;
pub mod noise;
pub mod paper;
mod placement;

pub use blur::{Blur, FringeOptics, Spread, contrast, replicas};
pub use field::Field;
pub use map::ProjectorMap;
pub use placement::phase_reach;

use crate::pattern::PhaseFunctionError;

/// A part for which no pattern can be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum AdaptError {
    /// No pixel of the part is known.
    #[error(
        "the preliminary measurement resolved no pixel: is the part in place and the light on?"
    )]
    Empty,
    /// The computed pattern cannot be shown.
    #[error("{0}")]
    Pattern(PhaseFunctionError),
}
