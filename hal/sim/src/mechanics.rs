//! The times and faults of a scenario, in the form of the virtual devices.

use std::time::Duration;

use super::scenario::Scenario;
use hal::virtual_head::{FreeRunning, Mechanics};

impl Scenario {
    /// Time from one refresh of the projector to the next.
    #[must_use]
    pub fn refresh(&self) -> Duration {
        Duration::from_secs_f64(1.0 / self.refresh_hz)
    }

    /// The times and faults in the form of the virtual devices.
    pub(super) fn mechanics(&self) -> Mechanics {
        let (timing, refresh) = (&self.timing, self.refresh());
        let us = Duration::from_micros;
        let believed = timing.calibrated_flip_to_light_us;
        let believed_late = timing.calibrated_stamp_late_us;
        Mechanics {
            refresh,
            flip_to_light: us(timing.flip_to_light_us),
            first_light: us(timing.first_light_us),
            calibrated_flip_to_light: us(believed.unwrap_or(timing.flip_to_light_us)),
            exposure: self.exposure(),
            readout: us(timing.readout_us),
            copy: us(timing.copy_us),
            start_up: us(timing.start_up_us),
            stays_on: Duration::from_secs(timing.stays_on_s),
            dead: us(timing.dead_us),
            calibrated_hold: timing.calibrated_refreshes.unwrap_or(self.needed()),
            by_projector: timing.by_projector,
            free_running: (timing.camera_period_us > 0).then(|| FreeRunning {
                period: us(timing.camera_period_us),
                phase: us(timing.camera_phase_us),
            }),
            stamp: timing.stamp,
            stamp_late: us(timing.stamp_late_us),
            calibrated_stamp_late: us(believed_late.unwrap_or(timing.stamp_late_us)),
            faults: self.faults.clone(),
        }
    }

    /// Refreshes per pattern that the camera needs, where the times that it states are not all.
    fn needed(&self) -> u32 {
        if self.timing.dead_us == 0 {
            return 1;
        }
        let unready = Duration::from_micros(self.timing.readout_us + self.timing.dead_us);
        let busy = (self.exposure() + unready).as_nanos();
        u32::try_from(busy.div_ceil(self.refresh().as_nanos())).unwrap_or(u32::MAX)
    }

    /// The exposure. Whole refreshes are computed exactly, as a rounding error could let an
    /// exposure end after the flip that is due at its end.
    pub(super) fn exposure(&self) -> Duration {
        let refreshes = self.timing.exposure_refreshes;
        if refreshes.fract() == 0.0 {
            return self.refresh() * refreshes as u32;
        }
        self.refresh().mul_f64(refreshes)
    }
}
