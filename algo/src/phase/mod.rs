//! From the samples of a pixel to its absolute phase, its modulation and whether to trust it.
//!
//! `terms`, `fold`, `angle` and `level` demodulate a level: samples → wrapped phase and modulation.
//! `unwrap_step` is one step of temporal unwrapping; `geometric` and `about` plan its two forms.
//! `kernel` joins them for rows of pixels; `decode` and `rows` are the entry. `arrived` keeps what
//! levels that are decoded on arrival leave for the next.

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
mod samples;
mod source;
mod terms;
mod unwrap;
mod unwrap_step;

pub use crate::trust::{LeastModulation, NOISE_OVER_LEAST, Trust};
pub use arrived::Arrived;
pub use decode::{DecodeError, Decoder, PhaseRow};
pub use level::FULL_TRUST_SHIFTS;

#[cfg(test)]
mod tests;
