//! The patterns of a plan: their rasters, and how a head shows them.

use super::Plan;
use crate::head::calibration::Calibration;
use hal::head::Head;
use hal::projector::Raster;

impl Plan {
    /// The rasters of all sequences; those of the first come first, in the order of its frames.
    pub fn rasters(&self, calibration: &Calibration) -> Result<Vec<Raster>, hal::error::Error> {
        let function = self.production().triangulator().function();
        self.illumination
            .rasters(function, &self.shots, calibration)
    }

    /// Loads these rasters into a head, which exposes them for as long as the recipe says.
    ///
    /// # Errors
    /// Of the projector, or if the head cannot expose for so long.
    pub fn load(
        &self,
        head: &mut Head,
        calibration: &Calibration,
    ) -> Result<(), hal::error::Error> {
        let function = self.production().triangulator().function();
        self.illumination
            .load(head, function, &self.shots, calibration)
    }

    /// How many rasters [`Self::rasters`] makes.
    pub fn patterns(&self) -> usize {
        self.shots.len()
    }
}
