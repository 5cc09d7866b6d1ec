//! The textbook: every step from frames to heights in plain `f64` loops, written to be read.
//!
//! This is the independent twin of the fixed-point path. It shares no code with the crate that it
//! judges, only the definitions: a recording's keys (format 1) and the equations of Peng & Gupta
//! 2008. Where an implementation would be clever, this one is slow.

pub mod decode;
pub mod demodulate;
pub mod device;
pub mod height;
pub mod pattern;
pub mod pixel;
pub mod reason;
pub mod unwrap;

pub use decode::{Level, PhaseTwin, decode, levels_from, levels_of, sample_noise};
pub use device::Device;
pub use height::Rig;
pub use pattern::Pattern;
pub use pixel::PixelTwin;
pub use reason::Reason;
