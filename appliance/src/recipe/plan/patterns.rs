//! The patterns of a plan: their rasters, and how a head shows them.

use super::Plan;
use super::run::Run;
use crate::head::calibration::Calibration;
use crate::head::seam;
use crate::recipe::PatternFile;
use algo::pattern::Shot;
use hal::frame::Frame;
use hal::head::Head;
use hal::projector::Raster;
use hal::replay::Recording;
use hal::replay::recording::{PatternSpec, RecipeReference};

impl Plan {
    /// The longest sequence whose frames are all among those that show these shots of its own
    /// pattern (`None` for frames of another one), and which of them its frames are.
    pub fn sequence_among(&self, shown: &[Option<Shot>]) -> Option<(usize, Vec<usize>)> {
        let indices = |sequence| -> Option<Vec<usize>> {
            let place = |shot| shown.iter().position(|other| *other == Some(shot));
            self.shots(sequence).map(place).collect()
        };
        let mut sequences = (0..self.sequence_count()).rev();
        sequences.find_map(|at| Some((at, indices(at)?)))
    }

    /// Keeps only the sequence of [`Self::sequence_among`]: a head that plays a recording has no
    /// other frames. If there is no such sequence, nothing changes.
    pub fn only(mut self, shown: &[Option<Shot>]) -> Self {
        if let Some((sequence, indices)) = self.sequence_among(shown) {
            let first = self.shots[self.runs[sequence].indices[0]];
            let run = self.runs.swap_remove(sequence);
            self.runs = vec![Run { indices, ..run }];
            // Whatever is shown for the other frames, the recorded ones come.
            self.shots = shown.iter().map(|shot| shot.unwrap_or(first)).collect();
        }
        self
    }

    /// The rasters of all sequences; those of the first sequence come first, in the order of its
    /// frames.
    pub fn rasters(&self, calibration: &Calibration) -> Result<Vec<Raster>, hal::error::Error> {
        let function = self.production().triangulator().function();
        self.illumination
            .rasters(function, &self.shots, calibration)
    }

    /// Loads these rasters into a head, which exposes them for as long as the recipe says.
    ///
    /// # Errors
    /// The error of the projector, or if the head cannot expose for so long.
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
            exposure_us: self
                .conditions
                .exposing
                .map(|set| f64::from(set.exposure_us) * f64::from(self.conditions.exposures)),
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
