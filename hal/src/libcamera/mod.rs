//! A camera through libcamera, such as the Raspberry Pi's: chosen by its id, configured before it
//! starts, each frame verified.
//!
//! One thread owns all objects of the library ([`LibCamera::open`] starts it, dropping the camera
//! ends it); frames arrive from it through a channel. It copies the samples of each frame out of
//! the camera's buffer, so that neither a kept frame nor slow memory can delay the camera or the
//! next trigger.
//!
//! The choice of the format, the check of metadata and the conversion of stamps do not depend on
//! the library.

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

/// Buffers to ask for: one that is copied, one being written, one queued in the driver, and five
/// that wait to be fetched when the computer is busy.
const BUFFERS: u32 = 8;

/// Which camera, and how it takes its frames.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// The library's id of the camera, which names its connection. Never an index: the order of
    /// cameras changes with the library's version. None selects the only camera.
    pub id: Option<String>,
    /// Which samples of its images are used.
    pub reading: Reading,
    /// Columns and rows; none selects the largest size.
    pub size: Option<(u32, u32)>,
    /// Who starts an exposure. The sensor's trigger mode is set in its driver, not here.
    pub starts: Starts,
    /// Exposure, gain and frame period.
    pub exposing: Exposing,
    /// Whether `exposing` is set, and verified in each frame's metadata. False only for trials with
    /// a camera that has no such controls.
    pub controlled: bool,
    /// From the end of an exposure until its frame can be fetched, without any delay.
    pub delivery: Duration,
    /// How long a triggered camera may stay on without an exposure: less than the time after which
    /// the library gives it up.
    pub stays_on: Duration,
    /// Buffers to ask for. A camera may grant fewer.
    pub buffers: u32,
}

impl Settings {
    /// Settings as configured, with each frame verified.
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
            stays_on: Duration::ZERO,
            buffers: BUFFERS,
        }
    }
}
