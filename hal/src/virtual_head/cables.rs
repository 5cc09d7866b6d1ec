//! The cables of a virtual head: what is pulled out is gone until the head is opened again.

use std::sync::MutexGuard;

use super::{Bench, Control, Device, Scene, lock};
use crate::error::{self, Error};

/// The cable of one device.
#[derive(Clone, Copy, Default)]
pub(super) struct Line {
    out: bool,
    /// How often it was pulled out. Devices that were opened before the last time are dead for ever.
    pub pulled: u64,
}

impl Line {
    fn check(
        self,
        device: error::Device,
        opened: u64,
        attempt: impl FnOnce() -> String,
    ) -> Result<(), Error> {
        if self.out || self.pulled != opened {
            return Err(Error::disconnected(device, attempt()));
        }
        Ok(())
    }
}

impl<S> Device<S> {
    /// The bench, if the camera is the one that was opened.
    pub(super) fn as_camera(&self, attempt: &str) -> Result<MutexGuard<'_, Bench<S>>, Error> {
        let bench = lock(&self.bench);
        bench
            .camera
            .check(error::Device::Camera, self.camera, || attempt.to_owned())?;
        Ok(bench)
    }

    /// The bench, if the projector is the one that was opened.
    pub(super) fn as_projector(&self, attempt: &str) -> Result<MutexGuard<'_, Bench<S>>, Error> {
        let bench = lock(&self.bench);
        bench
            .projector
            .check(error::Device::Projector, self.projector, || {
                attempt.to_owned()
            })?;
        Ok(bench)
    }
}

impl<S> Control<S> {
    /// Pulls a device's cable out, or plugs it `into` the device again. What was opened before stays dead.
    pub fn plug(&self, device: error::Device, into: bool) {
        let mut bench = lock(&self.bench);
        let line = match device {
            error::Device::Camera => &mut bench.camera,
            error::Device::Projector => &mut bench.projector,
            // Its trigger needs no chip.
            error::Device::Lines => return,
        };
        line.pulled += u64::from(!into);
        line.out = !into;
    }
}

impl<S: Scene> Bench<S> {
    /// A stopped camera and a blank projector, if both are there.
    pub(super) fn reset(&mut self) -> Result<(), Error> {
        for (line, device) in [
            (self.camera, error::Device::Camera),
            (self.projector, error::Device::Projector),
        ] {
            line.check(device, line.pulled, || {
                format!("opening the {}", device.word())
            })?;
        }
        self.sensor.stop();
        self.blank();
        Ok(())
    }
}
