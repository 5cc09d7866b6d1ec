//! The patterns of a plan: their rasters, and how a head shows them.

use super::Plan;
use crate::head::calibration::Calibration;
use crate::head::seam;
use crate::recipe::PatternFile;
use hal::frame::Frame;
use hal::head::Head;
use hal::projector::Raster;
use hal::replay::Recording;
use hal::replay::recording::{PatternSpec, RecipeReference};

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

    /// A recording of the frames of a sequence, with this recipe's pattern and number.
    pub fn recording(
        &self,
        sequence: usize,
        frames: &[Frame],
        calibration: &Calibration,
    ) -> Recording {
        let shown = self.shots(sequence).zip(frames);
        Recording {
            patterns: vec![self.pattern()],
            frames: shown
                .map(|(shot, frame)| seam::recorded(shot, frame.clone()))
                .collect(),
            range_mm: Some(self.conditions.range_mm),
            exposure_us: self.conditions.exposure_us,
            recipe: Some(RecipeReference {
                number: u32::from(self.id.number),
                fingerprint: self.id.fingerprint.clone(),
            }),
            ..calibration.recording()
        }
    }

    fn pattern(&self) -> PatternSpec {
        match self.conditions.pattern {
            PatternFile::Vertical { fringes } => PatternSpec::Vertical { fringes },
            PatternFile::Horizontal { fringes } => PatternSpec::Horizontal { fringes },
            PatternFile::File => {
                let function = self.production().triangulator().function();
                PatternSpec::File {
                    rows: function.rows(),
                    columns: function.columns(),
                    turns: function.turns(),
                }
            }
        }
    }

    /// How many rasters [`Self::rasters`] makes.
    pub fn patterns(&self) -> usize {
        self.shots.len()
    }
}
