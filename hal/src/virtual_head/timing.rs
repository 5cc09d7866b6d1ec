//! The times of a virtual head: refresh, exposure, readout and delays, and the delay that its
//! calibration states.

use std::time::Duration;

use super::Faults;
use crate::camera::{CameraTiming, Encoding, Starts};
use crate::head::{Stamp, Timing};

/// How long a triggered camera stays on between sequences, unless stated otherwise.
const STAYS_ON: Duration = Duration::from_secs(30);

/// The true times of a virtual head, and its faults.
#[derive(Clone, Debug)]
pub struct Mechanics {
    /// Time from one refresh of the projector to the next.
    pub refresh: Duration,
    /// From a flip to its pattern's light.
    pub flip_to_light: Duration,
    /// From opening the projector, which sets its mode, to its first light.
    pub first_light: Duration,
    /// The flip-to-light delay according to the head's calibration.
    pub calibrated_flip_to_light: Duration,
    /// Planned exposure.
    pub exposure: Duration,
    /// From the end of an exposure until its frame can be fetched.
    pub readout: Duration,
    /// How long it takes to copy a frame out of the camera's buffer. A thread of its own copies one
    /// after the other.
    pub copy: Duration,
    /// For how long after its readout a triggered camera still loses triggers, which it does not
    /// say.
    pub dead: Duration,
    /// Refreshes per pattern according to the head's calibration.
    pub calibrated_hold: u32,
    /// From the camera's start until it can be triggered.
    pub start_up: Duration,
    /// How long a triggered camera may stay on without an exposure.
    pub stays_on: Duration,
    /// Whether the projector triggers the camera, with the light of each refresh for which the
    /// camera is ready.
    pub by_projector: bool,
    /// Of a camera that runs by itself: its period, and the time from its start to its first
    /// exposure.
    pub free_running: Option<(Duration, Duration)>,
    /// What the camera's stamps mark.
    pub stamp: Stamp,
    /// From the moment that they mark to the stamps.
    pub stamp_late: Duration,
    /// From the moment that they mark to the stamps, according to the head's calibration.
    pub calibrated_stamp_late: Duration,
    /// What goes wrong.
    pub faults: Faults,
}

impl Mechanics {
    /// A triggered camera that exposes for `refreshes` whole refreshes, as a digital micromirror
    /// device requires, and needs no time for its readout.
    pub(crate) fn plain(refresh: Duration, refreshes: u32) -> Self {
        Self {
            refresh,
            flip_to_light: Duration::ZERO,
            first_light: Duration::ZERO,
            calibrated_flip_to_light: Duration::ZERO,
            exposure: refresh * refreshes,
            readout: Duration::ZERO,
            copy: Duration::ZERO,
            dead: Duration::ZERO,
            calibrated_hold: 1,
            start_up: Duration::ZERO,
            stays_on: STAYS_ON,
            by_projector: false,
            free_running: None,
            stamp: Stamp::default(),
            stamp_late: Duration::ZERO,
            calibrated_stamp_late: Duration::ZERO,
            faults: Faults::default(),
        }
    }

    pub(super) fn calibrated(&self) -> Timing {
        Timing {
            flip_to_light: self.calibrated_flip_to_light,
            stamp: self.stamp,
            stamp_late: self.calibrated_stamp_late,
            readout: self.readout,
            hold: self.calibrated_hold,
            ..Timing::default()
        }
    }

    pub(super) fn camera(&self) -> CameraTiming {
        let (starts, period) = match self.free_running {
            Some((period, _)) => (Starts::ByItself, period),
            None if self.by_projector => (Starts::ByProjector, self.exposure + self.readout),
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

    pub(super) fn encoding(&self, raw: &str) -> Encoding {
        let exact = !self.faults.compressed;
        Encoding {
            name: if exact { raw } else { "COMPRESSED" }.into(),
            exact,
        }
    }
}
