//! What is projected: phase functions, their grey rasters, and sequences of levels and shifts.

mod chance;
mod encode;
mod function;
mod interpolate;
mod sequence;
mod shot;
pub(crate) mod slips;
mod split;
mod waveform;

pub use encode::{Encoder, GreyRaster, GreyResponse, ResponseError};
pub use function::{MAX_TURNS, PhaseFunction, PhaseFunctionError, PhaseRange};
pub use sequence::{
    Level, MAX_DENSE_N, MAX_FRAMES, MAX_LEVEL_FACTOR, MAX_LEVELS, MAX_SHIFTS, Sequence,
    SequenceError, Unwrapping,
};
pub use shot::Shot;
pub use slips::Slips;
pub use split::Split;
pub use waveform::{MAX_ORDER, Waveform, Waveforms};
