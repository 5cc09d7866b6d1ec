//! Borrowed camera pixels.

mod mean;
mod view;

pub use mean::mean;
pub use view::{FrameError, FrameView, Sample, Samples};
