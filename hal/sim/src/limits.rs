//! The limits of a scenario's values: a value outside is refused, naming its key, before anything is computed from it.

use super::scenario::{Placement, RigDevice, Scenario};
pub(crate) use hal::bounds::within;
use hal::bounds::{MAX_PLACEMENT_MM, MAX_ROTATION_DEG, MAX_TILT_DEG};

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
        within("sub_rays", self.sub_rays, 1, 16)?;
        for (name, device) in [
            ("rig.camera", &self.rig.camera),
            ("rig.projector", &self.rig.projector),
        ] {
            device
                .check()
                .map_err(|problem| format!("{name}.{problem}"))?;
        }
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
        within("refresh_hz", self.refresh_hz, 1.0, 1000.0)?;
        within("light.ambient", self.light.ambient, 0.0, 100.0)?;
        within("light.diffuse", self.light.diffuse, 0.0, 100.0)?;
        within("light.specular", self.light.specular, 0.0, 4.0)?;
        within("light.shininess", self.light.shininess, 1.0, 500.0)?;
        let noise = &self.noise;
        within("noise.full_well_e", noise.full_well_e, 100.0, 1e7)?;
        within("noise.read_noise_e", noise.read_noise_e, 0.0, 1000.0)?;
        within("noise.prnu", noise.prnu, 0.0, 0.1)?;
        if let Some(counts) = noise.noise_counts {
            within("noise.noise_counts", counts, 0.0, 255.0)?;
        }
        within(
            "optics.projector_blur_px",
            self.optics.projector_blur_px,
            0.0,
            20.0,
        )?;
        within(
            "optics.camera_blur_px",
            self.optics.camera_blur_px,
            0.0,
            20.0,
        )?;
        within("optics.gamma", self.optics.gamma, 0.1, 10.0)?;
        within("optics.gain", self.optics.gain, 0.0, 100.0)?;
        within("optics.content_gain", self.optics.content_gain, -1.0, 10.0)?;
        self.check_timing()?;
        self.placement.check()?;
        self.part.check()
    }
}

impl Placement {
    /// Checks every value; the error names the key and its range.
    pub(crate) fn check(&self) -> Result<(), String> {
        for shift in self.shift_mm {
            within(
                "placement.shift_mm",
                shift,
                -MAX_PLACEMENT_MM,
                MAX_PLACEMENT_MM,
            )?;
        }
        for tilt in self.tilt_deg {
            within("placement.tilt_deg", tilt, -MAX_TILT_DEG, MAX_TILT_DEG)?;
        }
        let turned = self.rotation_deg;
        within(
            "placement.rotation_deg",
            turned,
            -MAX_ROTATION_DEG,
            MAX_ROTATION_DEG,
        )
    }
}

impl RigDevice {
    fn check(&self) -> Result<(), String> {
        for (name, pixels) in [("width", self.width), ("height", self.height)] {
            within(name, pixels, 1, 4096)?;
        }
        for fov in self.fov_deg {
            within("fov_deg", fov, 1.0, 120.0)?;
        }
        within("angle_deg", self.angle_deg, -80.0, 80.0)?;
        within("distance_mm", self.distance_mm, 10.0, 100_000.0)?;
        for angle in self.knocked_deg {
            within("knocked_deg", angle, -10.0, 10.0)?;
        }
        for coefficient in self.distortion {
            within("distortion", coefficient, -1.0, 1.0)?;
        }
        Ok(())
    }
}
