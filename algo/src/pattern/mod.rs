//! What is projected: phase functions, their grey rasters, and sequences of levels and shifts.

mod encode;
mod function;
mod interpolate;
mod sequence;
pub(crate) mod split;
mod waveform;

pub use encode::{Encoder, GreyRaster, GreyResponse, ResponseError};
pub use function::{MAX_TURNS, PhaseFunction, PhaseFunctionError, PhaseRange};
pub use sequence::{
    Level, MAX_DENSE_N, MAX_FRAMES, MAX_LEVEL_FACTOR, MAX_LEVELS, MAX_SHIFTS, Sequence,
    SequenceError, Unwrapping,
};
pub use split::{Slips, Split};
pub use waveform::{MAX_ORDER, Shot, Waveform, Waveforms};
