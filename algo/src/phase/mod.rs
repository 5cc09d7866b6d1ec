//! From the samples of a pixel to its absolute phase, its modulation and whether to trust it.
//!
//! A level is decoded when its frames have arrived, while those of the next are being exposed;
//! after the last frame only the finest level is left. The stages, from the call to the
//! instructions; each calls the ones below it:
//!
//! | stage | files |
//! |---|---|
//! | plan: the levels, their unwrapping, the check that frames fit | `decode`: `level`, `geometric` or `about` |
//! | row: sample type, the rows of a level's frames, what has arrived | `rows`, `arrived` |
//! | kernel: the blocks of a row, compiled for each back-end | `kernel`: one file for geometric levels, one for levels about a map |
//! | block, demodulated: samples → S and C → wrapped phase and modulation | `samples`, `terms`, `fold` |
//! | block, unwrapped: wrapped phases → absolute phase | `unwrap_step`, and again `geometric` or `about` |
//! | block, judged: the first reason to reject a pixel | `quality` |
//! | vector instructions | `simd` |
//!
//! Plans are made once and hold numbers; before a row they are spread over all lanes of a back-end
//! (`…Lanes`). A block is `Lanes::PIXELS` neighbouring pixels. Every step of a block
//! is an inlined function of `v: impl Lanes`, without closures, because those would be compiled
//! without the back-end's instructions.

mod about;
mod arrived;
mod clipped;
mod decode;
mod fold;
mod geometric;
mod kernel;
mod level;
mod light_edge;
mod quality;
mod rows;
mod samples;
mod terms;
mod unwrap_step;

pub use crate::trust::{LeastModulation, NOISE_OVER_LEAST, Trust};
pub use arrived::Arrived;
pub use decode::{DecodeError, Decoder, PhaseRow};

#[cfg(test)]
mod tests;
