//! The cables of a virtual head: a device that was unplugged fails until the head is opened again.

use std::sync::MutexGuard;

use super::{Bench, Control, Scene, VirtualDevice, lock};
use crate::error::{DeviceKind, Error};

/// The cable of one device.
#[derive(Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Cable {
    out: bool,
    /// How often it was pulled out. A device that was opened before the last time fails for ever.
    pulled: u64,
}

/// The cables by [`DeviceKind`]. That of the GPIO chip has no effect, because the virtual trigger
/// has none.
pub(super) type Cables = [Cable; 3];

impl<S> VirtualDevice<S> {
    /// The bench, if `device` was not unplugged since it was opened.
    pub(super) fn plugged(
        &self,
        device: DeviceKind,
        attempt: &str,
    ) -> Result<MutexGuard<'_, Bench<S>>, Error> {
        let bench = lock(&self.bench);
        let at = device as usize;
        match bench.cables[at] == self.opened[at] {
            true => Ok(bench),
            false => Err(Error::disconnected(device, attempt)),
        }
    }
}

impl<S> Control<S> {
    /// Plugs a device in, or unplugs it. A device that was opened before it was unplugged keeps
    /// failing.
    pub fn plug(&self, device: DeviceKind, plugged: bool) {
        let cable = &mut lock(&self.bench).cables[device as usize];
        cable.pulled += u64::from(!plugged);
        cable.out = !plugged;
    }
}

impl<S: Scene> Bench<S> {
    /// Stops the camera and blanks the projector, if both are plugged in.
    pub(super) fn reset(&mut self) -> Result<(), Error> {
        for device in [DeviceKind::Camera, DeviceKind::Projector] {
            if self.cables[device as usize].out {
                let attempt = format!("opening the {}", device.word());
                return Err(Error::disconnected(device, attempt));
            }
        }
        self.sensor.stop();
        self.expose(1);
        self.blank();
        self.first_light = self.now + self.mechanics.first_light;
        Ok(())
    }
}
