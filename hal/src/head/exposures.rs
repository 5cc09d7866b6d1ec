//! Patterns that are exposed several times as long as the camera is set to.
//!
//! A digital micromirror device makes grey levels over whole refreshes, so a longer exposure is a
//! whole number of those that the camera is set to. What depends on the exposure (period of the
//! camera, pulse of the trigger, times of patterns, time-outs) is computed from
//! [`Camera::timing`](crate::camera::Camera::timing).

use super::{Devices, Head};
use crate::camera::Starts;
use crate::error::Error;

impl Head {
    /// Exposes the patterns that are loaded `times` as long as the camera is set to, until others
    /// are loaded. A camera that is on is started again by the next sequence.
    ///
    /// # Errors
    /// `Unsupported` if the projector's pulse sets the exposure, or the camera's back-end can only
    /// expose as it is set to.
    pub fn expose(&mut self, times: u32) -> Result<(), Error> {
        self.devices.expose(times.max(1))
    }

    /// How many times as long as set each exposure lasts.
    pub fn exposures(&self) -> u32 {
        self.devices.exposures
    }
}

impl Devices {
    pub(super) fn expose(&mut self, times: u32) -> Result<(), Error> {
        if times == self.exposures {
            return Ok(());
        }
        let before = self.camera.timing();
        if before.starts == Starts::ByProjector {
            return Err(Error::unsupported(
                format!("exposing {times} times as long: the projector's pulse sets the exposure"),
                "use a recipe that was taught with --exposures 1, or wire the camera's trigger to the computer",
            ));
        }
        self.camera.expose(times)?;
        self.trigger.expose(before.exposure / self.exposures, times);
        self.exposures = times;
        Ok(())
    }
}
