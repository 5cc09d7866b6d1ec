//! Borrowed camera pixels.

mod view;

pub use view::{FrameError, FrameView, Sample, Samples};
