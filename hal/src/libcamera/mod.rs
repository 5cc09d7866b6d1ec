//! A camera through libcamera, as the Raspberry Pi's are: chosen by its id, set before it starts, each frame verified.
//!
//! One thread owns everything of the library ([`LibCamera::open`] starts it, dropping the camera ends it); frames come from there
//! by a channel, and buffers go back to it. A frame borrows the buffer that the camera wrote, mapped once at opening; a frame
//! that is kept may outlive the camera. Only where too few buffers would be left for the camera to write into, or where samples
//! are packed, are they copied.
//!
//! The choice of the format, the check of metadata and the conversion of stamps know nothing of the library.

#[cfg(feature = "libcamera")]
mod buffers;
#[cfg(feature = "libcamera")]
mod device;
mod layout;
#[cfg(feature = "libcamera")]
mod open;
#[cfg(feature = "libcamera")]
mod owner;
mod report;

use std::time::Duration;

use crate::camera::Starts;
use crate::setup::CameraSetup;
#[cfg(feature = "libcamera")]
pub use device::{LibCamera, Listed};
pub use layout::Reading;
pub use report::Exposing;

/// Buffers to ask for: frames of the longest sequence, of which none is copied then, and those that the camera writes meanwhile.
const BUFFERS: u32 = 16;

/// Which camera, and how it is to take its frames.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// The library's id of it, which names the way that it is connected. Never an index: the order of cameras changes with
    /// the library's version. None takes the only camera that is there.
    pub id: Option<String>,
    /// What is taken of its images.
    pub reading: Reading,
    /// Columns and rows; none takes the largest.
    pub size: Option<(u32, u32)>,
    /// Who starts an exposure. That a sensor waits for its trigger is set in its driver, not here.
    pub starts: Starts,
    /// Exposure, gain and frame length.
    pub exposing: Exposing,
    /// Whether these are set, and verified in each frame's metadata. Only for trials with a camera that has no such controls:
    /// then they are taken on trust.
    pub controlled: bool,
    /// From the end of an exposure until its frame can be fetched when nothing is late.
    pub delivery: Duration,
    /// Buffers to ask for. A camera may grant less, and what is kept beyond them is copied.
    pub buffers: u32,
}

impl Settings {
    /// As configured, each frame verified.
    #[must_use]
    pub fn new(setup: &CameraSetup, starts: Starts) -> Self {
        let microseconds = |us: u32| Duration::from_micros(us.into());
        Self {
            id: setup.id.clone(),
            reading: if setup.luma {
                Reading::Luma
            } else {
                Reading::Raw
            },
            size: setup.width.zip(setup.height),
            starts,
            exposing: Exposing {
                exposure: microseconds(setup.exposure_us),
                gain: setup.gain as f32,
                period: microseconds(setup.period_us),
            },
            controlled: true,
            delivery: microseconds(setup.delivery_us),
            buffers: BUFFERS,
        }
    }
}
