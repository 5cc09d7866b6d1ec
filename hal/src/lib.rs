//! Devices of a measuring head: traits, the acquisition that uses them, real back-ends behind
//! features, and a replay back-end.
//!
//! This crate knows cameras, projectors and triggers. It knows nothing of phase: a pattern is a
//! grey raster and a frame is an array of counts. How the two are related is known to the crate
//! that decodes them.

pub mod bounds;
pub mod camera;
pub mod clock;
pub mod contract;
pub mod dlpc347x;
pub mod error;
pub mod frame;
#[cfg(feature = "gpio")]
pub mod gpio;
pub mod head;
#[cfg(feature = "kms")]
pub mod kms;
#[cfg(any(test, feature = "libcamera"))]
pub mod libcamera;
pub mod lines;
pub mod model;
pub mod npy;
pub mod projector;
pub mod replay;
pub mod setup;
pub mod trigger;
pub mod units;
pub mod virtual_head;
