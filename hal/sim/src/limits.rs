//! Checks a scenario: a value outside its bounds, which stand beside the fields, is refused, naming
//! its key, before anything is computed from it.

use std::time::Duration;

use super::scenario::Scenario;
use hal::bounds::{Bound, Fields, within};

/// Most rays of a light transport; so many take minutes.
const MAX_RAYS: u64 = 1 << 28;

impl Scenario {
    /// Checks every value.
    ///
    /// # Errors
    /// A message that names the first key that is out of its range, and the range.
    pub fn check(&self) -> Result<(), String> {
        if ![8, 10, 12].contains(&self.bit_depth) {
            return Err(format!(
                "bit_depth is {}: write 8, 10 or 12",
                self.bit_depth
            ));
        }
        Fields.check("", self)?;
        let camera = &self.rig.camera;
        if self.colour && camera.width.min(camera.height) < 2 {
            return Err(format!(
                "rig.camera of {}×{} pixels with colour = true has no green plane: write at least 2 columns and rows",
                camera.width, camera.height
            ));
        }
        let pixels = u64::from(camera.width) * u64::from(camera.height);
        let rays = pixels * u64::from(self.sub_rays).pow(2);
        if rays > MAX_RAYS {
            return Err(format!(
                "rig.camera of {}×{} pixels with {}² sub_rays is {rays} rays: keep within {MAX_RAYS}",
                camera.width, camera.height, self.sub_rays
            ));
        }
        self.check_timing()?;
        self.part.check()
    }

    /// Checks the times and faults; the error names the key and its range.
    fn check_timing(&self) -> Result<(), String> {
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
