//! Borrowed camera frames, their mean, and a camera's noise from pairs of them.

mod mean;
mod transfer;
mod view;

pub use mean::mean;
pub use transfer::{Noise, NoisePoint, PhotonTransfer};
pub use view::{FrameError, FrameView, Sample, Samples};
