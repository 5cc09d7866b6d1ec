//! The times of a simulated head: exposure, readout and delays, and the delay that its calibration
//! states; and all of them in the form of the virtual devices.

use std::time::Duration;

use super::unfit::Unfit;
use hal::bounded;
use hal::head::Stamp;
use hal::virtual_head::{Faults, FreeRunning, Mechanics};

bounded! {
    /// Times of a simulated head. By default the camera is triggered, exposes for two refreshes and
    /// needs no time for its readout, and a pattern's light comes with its flip.
    pub struct Timing: Default {
        /// Exposure, refreshes of the projector, 0.01…100. A micromirror device makes grey levels
        /// over whole refreshes.
        pub exposure_refreshes: f64 = 0.01..=100.0 => 2.0,
        /// From the end of an exposure until its frame can be fetched, 0…1 000 000 µs.
        pub readout_us: u64 = 0..=1_000_000,
        /// How long it takes to copy a frame out of the camera's buffer, in a thread of its own,
        /// 0…1 000 000 µs.
        pub copy_us: u64 = 0..=1_000_000,
        /// From the camera's start until it can be triggered or runs, 0…10 000 000 µs.
        pub start_up_us: u64 = 0..=10_000_000,
        /// How long a triggered camera may stay on without an exposure, 0…1000 s; 0: it is stopped
        /// after each sequence.
        pub stays_on_s: u64 = 0..=1000 => 30,
        /// For how long after its readout a triggered camera still loses triggers, which its stated
        /// times do not contain, 0…1 000 000 µs.
        pub dead_us: u64 = 0..=1_000_000,
        /// Refreshes per pattern according to the head's calibration, 1…100; if left out, as many
        /// as the camera needs.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub calibrated_refreshes: Option<u32> = 1..=100,
        /// From a flip to its pattern's light, 0…1 000 000 µs.
        pub flip_to_light_us: u64 = 0..=1_000_000,
        /// From opening the head, which sets the projector's mode, to its first light, 0…60 000 000
        /// µs.
        pub first_light_us: u64 = 0..=60_000_000,
        /// The flip-to-light delay according to the head's calibration; if left out, the true one.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub calibrated_flip_to_light_us: Option<u64> = 0..=1_000_000,
        /// Whether the projector triggers the camera, with the light of each refresh for which the
        /// camera is ready.
        pub by_projector: bool,
        /// Period of a camera that runs by itself, at least exposure or readout, up to 10 000 000
        /// µs; 0: the camera is triggered.
        pub camera_period_us: u64 = 0..=10_000_000,
        /// From the start of a camera that runs by itself to its first exposure, 0…10 000 000 µs.
        pub camera_phase_us: u64 = 0..=10_000_000,
        /// What the camera's stamps mark: "exposure_start", "exposure_end" or "readout_end".
        pub stamp: Stamp,
        /// From the moment that they mark to the stamps, 0…1 000 000 µs.
        pub stamp_late_us: u64 = 0..=1_000_000,
        /// From that moment to the stamps according to the head's calibration; if left out, the
        /// true time.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub calibrated_stamp_late_us: Option<u64> = 0..=1_000_000,
    }
}

impl Timing {
    /// The times and faults in the form of the virtual devices, whose projector refreshes so often.
    pub(super) fn mechanics(&self, refresh: Duration, faults: Faults) -> Mechanics {
        let us = Duration::from_micros;
        let believed = self.calibrated_flip_to_light_us;
        let believed_late = self.calibrated_stamp_late_us;
        Mechanics {
            refresh,
            flip_to_light: us(self.flip_to_light_us),
            first_light: us(self.first_light_us),
            calibrated_flip_to_light: us(believed.unwrap_or(self.flip_to_light_us)),
            exposure: self.exposure(refresh),
            readout: us(self.readout_us),
            copy: us(self.copy_us),
            start_up: us(self.start_up_us),
            stays_on: Duration::from_secs(self.stays_on_s),
            dead: us(self.dead_us),
            calibrated_hold: self.calibrated_refreshes.unwrap_or(self.needed(refresh)),
            by_projector: self.by_projector,
            free_running: (self.camera_period_us > 0).then(|| FreeRunning {
                period: us(self.camera_period_us),
                phase: us(self.camera_phase_us),
            }),
            stamp: self.stamp,
            stamp_late: us(self.stamp_late_us),
            calibrated_stamp_late: us(believed_late.unwrap_or(self.stamp_late_us)),
            faults,
        }
    }

    /// Refreshes per pattern that the camera needs, where the times that it states are not all.
    fn needed(&self, refresh: Duration) -> u32 {
        if self.dead_us == 0 {
            return 1;
        }
        let unready = Duration::from_micros(self.readout_us + self.dead_us);
        let busy = (self.exposure(refresh) + unready).as_nanos();
        u32::try_from(busy.div_ceil(refresh.as_nanos())).unwrap_or(u32::MAX)
    }

    /// The exposure. Whole refreshes are computed exactly, as a rounding error could let an
    /// exposure end after the flip that is due at its end.
    fn exposure(&self, refresh: Duration) -> Duration {
        let refreshes = self.exposure_refreshes;
        if refreshes.fract() == 0.0 {
            return refresh * refreshes as u32;
        }
        refresh.mul_f64(refreshes)
    }

    /// Checks the times of a camera against each other.
    pub(super) fn check(&self, refresh: Duration) -> Result<(), Unfit> {
        let period_us = self.camera_period_us;
        if self.by_projector && period_us > 0 {
            return Err(Unfit::OwnPeriod);
        }
        let readout = Duration::from_micros(self.readout_us);
        let busy = self.exposure(refresh).max(readout);
        if period_us > 0 && Duration::from_micros(period_us) < busy {
            return Err(Unfit::ShortPeriod {
                period_us,
                least_us: busy.as_nanos().div_ceil(1000),
            });
        }
        Ok(())
    }
}
