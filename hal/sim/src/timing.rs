//! The times of a simulated head: exposure, readout and delays, and the delay that its calibration
//! states.

use std::time::Duration;

use super::scenario::Scenario;
use hal::bounded;
use hal::bounds::within;
use hal::head::Stamp;
use hal::virtual_head::Mechanics;

bounded! {
    /// Times of a simulated head. By default the camera is triggered, exposes for two refreshes and
    /// needs no time for its readout, and a pattern's light comes with its flip.
    pub struct Timing: Default {
        /// Exposure, refreshes of the projector, 0.01…100. A micromirror device makes grey levels
        /// over whole refreshes.
        pub exposure_refreshes: f64 = 0.01..=100.0 => 2.0,
        /// From the end of an exposure until its frame can be fetched, 0…1 000 000 µs.
        pub readout_us: u64,
        /// How long it takes to copy a frame out of the camera's buffer, in a thread of its own,
        /// 0…1 000 000 µs.
        pub copy_us: u64,
        /// From the camera's start until it can be triggered or runs, 0…10 000 000 µs.
        pub start_up_us: u64,
        /// How long a triggered camera may stay on without an exposure, 0…1000 s; 0: it is stopped
        /// after each sequence.
        pub stays_on_s: u64 => 30,
        /// For how long after its readout a triggered camera still loses triggers, which its stated
        /// times do not contain, 0…1 000 000 µs.
        pub dead_us: u64,
        /// Refreshes per pattern according to the head's calibration, 1…100; if left out, as many
        /// as the camera needs.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub calibrated_refreshes: Option<u32> = 1..=100,
        /// From a flip to its pattern's light, 0…1 000 000 µs.
        pub flip_to_light_us: u64,
        /// From opening the head, which sets the projector's mode, to its first light, 0…60 000 000
        /// µs.
        pub first_light_us: u64,
        /// The flip-to-light delay according to the head's calibration; if left out, the true one.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub calibrated_flip_to_light_us: Option<u64>,
        /// Whether the projector triggers the camera, with the light of each refresh for which the
        /// camera is ready.
        pub by_projector: bool,
        /// Period of a camera that runs by itself, at least exposure or readout, up to 10 000 000
        /// µs; 0: the camera is triggered.
        pub camera_period_us: u64,
        /// From the start of a camera that runs by itself to its first exposure, 0…10 000 000 µs.
        pub camera_phase_us: u64,
        /// What the camera's stamps mark: "exposure_start", "exposure_end" or "readout_end".
        pub stamp: Stamp,
        /// From the moment that they mark to the stamps, 0…1 000 000 µs.
        pub stamp_late_us: u64,
        /// The same according to the head's calibration; if left out, the true one.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub calibrated_stamp_late_us: Option<u64>,
    }
}

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
            free_running: (timing.camera_period_us > 0)
                .then(|| (us(timing.camera_period_us), us(timing.camera_phase_us))),
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
    fn exposure(&self) -> Duration {
        let refreshes = self.timing.exposure_refreshes;
        if refreshes.fract() == 0.0 {
            return self.refresh() * refreshes as u32;
        }
        self.refresh().mul_f64(refreshes)
    }

    /// Checks the times and faults; the error names the key and its range.
    pub(super) fn check_timing(&self) -> Result<(), String> {
        let (timing, faults) = (&self.timing, &self.faults);
        let believed = timing.calibrated_flip_to_light_us.unwrap_or(0);
        let believed_late = timing.calibrated_stamp_late_us.unwrap_or(0);
        for (key, us, most) in [
            ("timing.readout_us", timing.readout_us, 1e6),
            ("timing.start_up_us", timing.start_up_us, 1e7),
            ("timing.stays_on_s", timing.stays_on_s, 1e3),
            ("timing.dead_us", timing.dead_us, 1e6),
            ("timing.flip_to_light_us", timing.flip_to_light_us, 1e6),
            ("timing.copy_us", timing.copy_us, 1e6),
            ("timing.first_light_us", timing.first_light_us, 6e7),
            ("timing.calibrated_flip_to_light_us", believed, 1e6),
            ("timing.stamp_late_us", timing.stamp_late_us, 1e6),
            ("timing.calibrated_stamp_late_us", believed_late, 1e6),
            ("timing.camera_period_us", timing.camera_period_us, 1e7),
            ("timing.camera_phase_us", timing.camera_phase_us, 1e7),
            ("faults.flip_jitter_us", faults.flip_jitter_us, 1e6),
            ("faults.late_news_us", faults.late_news_us, 1e7),
            ("faults.late_frame_us", faults.late_frame_us, 1e7),
            ("faults.stamp_jitter_us", faults.stamp_jitter_us, 1e6),
            ("faults.trigger_jitter_us", faults.trigger_jitter_us, 1e6),
            ("faults.long_pulse_us", faults.long_pulse_us, 1e6),
            ("faults.stall_us", faults.stall_us, 1e7),
        ] {
            within(key, us as f64, 0.0, most)?;
        }
        if timing.by_projector && timing.camera_period_us > 0 {
            return Err(
                "timing.camera_period_us: write 0 for a camera that the projector triggers (timing.by_projector)".into(),
            );
        }
        let busy = self
            .exposure()
            .max(Duration::from_micros(timing.readout_us));
        if timing.camera_period_us > 0 && Duration::from_micros(timing.camera_period_us) < busy {
            return Err(format!(
                "timing.camera_period_us is {}: write at least {}, its exposure or readout, or 0 for a triggered camera",
                timing.camera_period_us,
                busy.as_nanos().div_ceil(1000)
            ));
        }
        within(
            "faults.late_refreshes",
            f64::from(faults.late_refreshes),
            0.0,
            1000.0,
        )?;
        within(
            "faults.drift_ppm",
            f64::from(faults.drift_ppm),
            -100_000.0,
            100_000.0,
        )
    }
}
