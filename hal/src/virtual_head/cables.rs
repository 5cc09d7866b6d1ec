//! The cables of a virtual head: a device that was unplugged fails until the head is opened again.

use std::sync::MutexGuard;

use super::{Bench, Control, Scene, VirtualDevice, lock};
use crate::error::{self, Error};

/// The cable of one device.
#[derive(Clone, Copy, Default)]
pub(super) struct Cable {
    out: bool,
    /// How often it was pulled out. A device that was opened before the last time fails for ever.
    pub pulled: u64,
}

impl Cable {
    fn check(
        self,
        device: error::DeviceKind,
        opened: u64,
        attempt: impl FnOnce() -> String,
    ) -> Result<(), Error> {
        if self.out || self.pulled != opened {
            return Err(Error::disconnected(device, attempt()));
        }
        Ok(())
    }
}

impl<S> VirtualDevice<S> {
    /// The bench, if the camera was not unplugged since it was opened.
    pub(super) fn as_camera(&self, attempt: &str) -> Result<MutexGuard<'_, Bench<S>>, Error> {
        let bench = lock(&self.bench);
        bench
            .camera
            .check(error::DeviceKind::Camera, self.camera, || {
                attempt.to_owned()
            })?;
        Ok(bench)
    }

    /// The bench, if the projector was not unplugged since it was opened.
    pub(super) fn as_projector(&self, attempt: &str) -> Result<MutexGuard<'_, Bench<S>>, Error> {
        let bench = lock(&self.bench);
        bench
            .projector
            .check(error::DeviceKind::Projector, self.projector, || {
                attempt.to_owned()
            })?;
        Ok(bench)
    }
}

impl<S> Control<S> {
    /// Plugs a device in, or unplugs it. A device that was opened before it was unplugged keeps failing.
    pub fn plug(&self, device: error::DeviceKind, plugged: bool) {
        let mut bench = lock(&self.bench);
        let cable = match device {
            error::DeviceKind::Camera => &mut bench.camera,
            error::DeviceKind::Projector => &mut bench.projector,
            // The virtual trigger has no GPIO chip.
            error::DeviceKind::Lines => return,
        };
        cable.pulled += u64::from(!plugged);
        cable.out = !plugged;
    }
}

impl<S: Scene> Bench<S> {
    /// Stops the camera and blanks the projector, if both are plugged in.
    pub(super) fn reset(&mut self) -> Result<(), Error> {
        for (cable, device) in [
            (self.camera, error::DeviceKind::Camera),
            (self.projector, error::DeviceKind::Projector),
        ] {
            cable.check(device, cable.pulled, || {
                format!("opening the {}", device.word())
            })?;
        }
        self.sensor.stop();
        self.blank();
        Ok(())
    }
}
