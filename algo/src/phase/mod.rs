//! Wrapped phase and modulation, which pixels to trust, and the absolute phase.

mod about;
mod angle;
mod arrived;
mod decode;
mod fold;
mod geometric;
mod kernel;
mod level;
mod narrow;
mod rows;
mod source;
mod unwrap;
mod unwrap_step;

pub use crate::trust::{MIN_MODULATION_8_BIT, Trust};
pub use arrived::Arrived;
pub(crate) use arrived::PlanesMut;
pub use decode::{DecodeError, Decoder, PhaseRow};
pub use level::FULL_TRUST_STEPS;

#[cfg(test)]
mod tests;
