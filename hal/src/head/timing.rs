//! The measured times of a head: the delay from a flip to its light, and the moment that a camera's
//! stamp marks.

use std::time::Duration;

use crate::camera::{CameraTiming, Starts};
use crate::units::Timestamp;

/// Default of [`Timing::tolerance`]: an exposure of exactly one refresh leaves no slack for jitter
/// otherwise.
pub const TOLERANCE: Duration = Duration::from_micros(200);
/// Refreshes per pattern where a trigger or the projector starts the exposures and nothing is
/// proven. After an exposure of one refresh (16.667 ms at 60 Hz) an IMX296 is read out for 1118
/// lines of 14.8148 µs (16.563 ms): of two refreshes 0.1 ms would be left for its own delays.
const TRIGGERED_HOLD: u32 = 3;
/// Refreshes per pattern where the camera runs by itself: an exposure of one whole refresh fits two
/// from wherever it starts.
const OWN_HOLD: u32 = 2;

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
    /// From the moment that a stamp marks to the stamp itself: a driver that stamps in an interrupt
    /// is late by a constant time.
    pub stamp_late: Duration,
    /// From the end of an exposure to the end of its readout; used only where stamps mark the end
    /// of the readout.
    pub readout: Duration,
    /// How far an exposure may reach beyond its pattern's time in view, at each end.
    pub tolerance: Duration,
    /// Refreshes that each pattern stays in view, at least. A camera that is triggered once in so
    /// many refreshes must lose no trigger.
    pub hold: u32,
}

impl Default for Timing {
    fn default() -> Self {
        Self {
            flip_to_light: Duration::ZERO,
            stamp: Stamp::default(),
            stamp_late: Duration::ZERO,
            readout: Duration::ZERO,
            tolerance: TOLERANCE,
            hold: 1,
        }
    }
}

impl Timing {
    /// The times of a real head that is not calibrated.
    #[must_use]
    pub fn unproven(starts: Starts) -> Self {
        Self {
            hold: match starts {
                Starts::OnTrigger | Starts::ByProjector => TRIGGERED_HOLD,
                Starts::ByItself => OWN_HOLD,
            },
            ..Self::default()
        }
    }

    /// The start of an exposure of `camera` with this stamp.
    #[must_use]
    pub fn exposure_start(&self, camera: &CameraTiming, stamp: Timestamp) -> Timestamp {
        let marked = stamp - self.stamp_late;
        match self.stamp {
            Stamp::ExposureStart => marked,
            Stamp::ExposureEnd => marked - camera.exposure,
            Stamp::ReadoutEnd => marked - (camera.exposure + self.readout),
        }
    }

    /// The tolerance for exposures of this length: at most a quarter of it, so that no exposure
    /// fits two patterns.
    pub(super) fn tolerance_for(&self, exposure: Duration) -> Duration {
        self.tolerance.min(exposure / 4)
    }
}
