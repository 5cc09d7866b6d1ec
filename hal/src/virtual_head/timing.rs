//! How time goes on a virtual head: refresh, exposure, readout, and what its calibration believes.

use std::time::Duration;

use super::Faults;
use crate::camera::{CameraTiming, Encoding, Starts};
use crate::head::{Stamp, TOLERANCE, Timing};

/// The true times of a virtual head, and its faults.
#[derive(Clone, Debug)]
pub struct Mechanics {
    /// Time from one refresh of the projector to the next.
    pub refresh: Duration,
    /// From a flip to its pattern's light.
    pub flip_to_light: Duration,
    /// What the head's calibration believes of that.
    pub calibrated_flip_to_light: Duration,
    /// Planned exposure.
    pub exposure: Duration,
    /// From the end of an exposure to its frame.
    pub readout: Duration,
    /// Period and first exposure after the start of a camera that runs by itself.
    pub free_running: Option<(Duration, Duration)>,
    /// What the camera's stamps mark.
    pub stamp: Stamp,
    /// What goes wrong.
    pub faults: Faults,
}

impl Mechanics {
    /// A triggered camera that exposes `refreshes` whole refreshes, as a digital micromirror device needs it, and is read out in no time.
    pub(crate) fn plain(refresh: Duration, refreshes: u32) -> Self {
        Self {
            refresh,
            flip_to_light: Duration::ZERO,
            calibrated_flip_to_light: Duration::ZERO,
            exposure: refresh * refreshes,
            readout: Duration::ZERO,
            free_running: None,
            stamp: Stamp::default(),
            faults: Faults::default(),
        }
    }

    pub(super) fn calibrated(&self) -> Timing {
        Timing {
            flip_to_light: self.calibrated_flip_to_light,
            stamp: self.stamp,
            readout: self.readout,
            tolerance: TOLERANCE,
            hold: 1,
        }
    }

    pub(super) fn camera(&self) -> CameraTiming {
        let (starts, period) = match self.free_running {
            Some((period, _)) => (Starts::ByItself, period),
            // Exposure and readout of a triggered camera do not overlap.
            None => (Starts::OnTrigger, self.exposure + self.readout),
        };
        CameraTiming {
            starts,
            exposure: self.exposure,
            period,
            delivery: self.readout,
        }
    }

    pub(super) fn encoding(&self) -> Encoding {
        let exact = !self.faults.compressed;
        Encoding {
            name: if exact { "RAW" } else { "COMPRESSED" }.into(),
            exact,
        }
    }
}
