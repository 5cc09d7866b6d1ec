//! Wrapped phase and modulation, which pixels to trust, and the absolute phase.

mod decode;
mod demodulate;
mod trust;
mod unwrap;

pub use decode::{DecodeError, Decoder, PhaseRow, Scratch};
pub use demodulate::FULL_TRUST_STEPS;
pub use trust::{MIN_MODULATION_8_BIT, Trust};
