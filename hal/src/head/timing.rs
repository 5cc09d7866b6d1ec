//! The measured times of a head: the delay from a flip to its light, and the moment that a camera's stamp marks.

use std::time::Duration;

use crate::camera::CameraTiming;
use crate::units::Timestamp;

/// Default of [`Timing::tolerance`]: an exposure of exactly one refresh leaves no slack for jitter otherwise.
pub const TOLERANCE: Duration = Duration::from_micros(200);

/// The moment that a camera's stamp marks. It depends on the driver, so it is measured.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Stamp {
    /// The start of the exposure.
    #[default]
    ExposureStart,
    /// The end of the exposure.
    ExposureEnd,
    /// The end of the readout.
    ReadoutEnd,
}

/// Measured times of a head, from which follows what was in view when.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Timing {
    /// From the time of a flip to the light of its pattern.
    pub flip_to_light: Duration,
    /// What the camera's stamps mark.
    pub stamp: Stamp,
    /// From the end of an exposure to the end of its readout; used only where stamps mark the end of the readout.
    pub readout: Duration,
    /// How far an exposure may reach beyond its pattern's time in view, at each end.
    pub tolerance: Duration,
    /// Refreshes that each pattern stays in view, at least.
    pub hold: u32,
}

impl Default for Timing {
    fn default() -> Self {
        Self {
            flip_to_light: Duration::ZERO,
            stamp: Stamp::default(),
            readout: Duration::ZERO,
            tolerance: TOLERANCE,
            hold: 1,
        }
    }
}

impl Timing {
    /// The start of an exposure of `camera` with this stamp.
    #[must_use]
    pub fn exposure_start(&self, camera: &CameraTiming, stamp: Timestamp) -> Timestamp {
        match self.stamp {
            Stamp::ExposureStart => stamp,
            Stamp::ExposureEnd => stamp - camera.exposure,
            Stamp::ReadoutEnd => stamp - (camera.exposure + self.readout),
        }
    }

    /// The tolerance for exposures of this length: at most a quarter of it, so that no exposure fits two patterns.
    pub(super) fn tolerance_for(&self, exposure: Duration) -> Duration {
        self.tolerance.min(exposure / 4)
    }
}
