//! The textbook implementation: the whole way from frames to heights in plain `f64` loops, written
//! to be read.
//!
//! It is the independent twin of the fixed-point implementation. It shares no code with the crate
//! that it judges, only the definitions: the keys of a recording (format 1) and the equations of
//! docs/measurement.md. It prefers plain code to fast code.

pub mod decode;
pub mod demodulate;
pub mod device;
pub mod height;
pub mod levels;
pub mod light;
pub mod pattern;
pub mod pixel;
pub mod reason;
pub mod unwrap;

pub use decode::{PhaseTwin, decode, sample_noise, samples};
pub use demodulate::{demodulate, demodulate_whole};
pub use device::Device;
pub use height::Rig;
pub use levels::{Level, levels_from, levels_of};
pub use pattern::Pattern;
pub use pixel::{PixelTwin, Scale};
pub use reason::Reason;
