//! The patterns of a plan: their rasters, and how a head shows them.

use super::Plan;
use super::run::Run;
use crate::head::calibration::Calibration;
use crate::head::seam;
use crate::recipe::file::refusal::refused;
use crate::recipe::{PatternFile, Recipe, Refusal};
use algo::pattern::{PhaseFunction, Shot};
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

/// Phase functions that differ by no more than this are the same, in turns: files hold `f64`.
const SAME: f64 = 1e-9;

impl Recipe {
    /// Finds the recipe's pattern among the recording's.
    ///
    /// # Errors
    /// If the frames are of another size, or no pattern is the recipe's; both are named.
    pub fn pattern_in(&self, recording: &Recording) -> Result<usize, Refusal> {
        let number = self.id.number;
        let (width, height, _) = self.conditions.camera;
        if (width, height) != (recording.width, recording.height) {
            return refused!(
                "recipe {number} is for frames of {width}x{height}, the recording has {}x{}: name the recipe that \
                 was taught with this camera",
                recording.width,
                recording.height
            );
        }
        let projector = &recording.projector;
        let mut others = Vec::new();
        for (pattern, spec) in recording.patterns.iter().enumerate() {
            let (columns, rows) = (projector.width as usize, projector.height as usize);
            let function = seam::phase_function(spec, columns, rows)?;
            let apart = difference(&function, &self.function);
            if apart.is_some_and(|turns| turns <= SAME) {
                return Ok(pattern);
            }
            others.push(match apart {
                Some(turns) => format!("{function} (up to {turns:.3e} turns apart)"),
                None => function.to_string(),
            });
        }
        refused!(
            "the recording was made with {}, recipe {number} with {}: name the recipe of this pattern",
            others.join(" and "),
            self.function
        )
    }
}

/// The largest difference of two phase functions over the pixels of the raster, in turns; `None` if
/// their rasters differ.
fn difference(a: &PhaseFunction, b: &PhaseFunction) -> Option<f64> {
    if (a.columns(), a.rows()) != (b.columns(), b.rows()) {
        return None;
    }
    let pairs = a.turns().into_iter().zip(b.turns());
    Some(pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max))
}
