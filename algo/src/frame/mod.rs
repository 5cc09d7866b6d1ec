//! Borrowed camera frames, their mean, and a camera's noise: from pairs of frames, and as it is
//! used.

mod mean;
mod noise;
mod transfer;
mod view;

pub use mean::mean;
pub use noise::SampleNoise;
pub use transfer::{Noise, NoisePoint, PhotonTransfer};
pub use view::{FrameError, FrameView, Sample, Samples};
