//! Checks a scenario: a value outside its bounds, which stand beside the fields, is refused, naming
//! its key, before anything is computed from it.

use std::time::Duration;

use super::scenario::Scenario;
use hal::bounds::{Bound, Fields};

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

    /// Checks the times of a camera against each other; the error names the key.
    fn check_timing(&self) -> Result<(), String> {
        let timing = &self.timing;
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
        Ok(())
    }
}
