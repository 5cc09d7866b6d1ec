//! Borrowed camera pixels, and what they tell of the camera.

mod mean;
mod transfer;
mod view;

pub use mean::mean;
pub use transfer::{Noise, NoisePoint, PhotonTransfer};
pub use view::{FrameError, FrameView, Sample, Samples};
