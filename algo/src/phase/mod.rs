//! Wrapped phase and modulation, which pixels to trust, and the absolute phase.

mod about;
mod angle;
mod block;
mod decode;
mod fold;
mod geometric;
mod level;
mod mean;
mod narrow;
mod step;
mod unwrap;
mod wrapped;

pub use crate::trust::{MIN_MODULATION_8_BIT, Trust};
pub use decode::{DecodeError, Decoder, PhaseRow};
pub use level::FULL_TRUST_STEPS;
pub use wrapped::Wrapped;

#[cfg(test)]
mod tests;
