//! The phase that is expected in a recording: a recipe's golden map, the prediction from a
//! preliminary measurement, or a map from a file.

use crate::error::{Exit, Result};
use crate::head::channel::Expected;
use crate::head::seam;
use crate::recipe::{Recipe, SequenceKind, safe};
use algo::adaptive::ProjectorMap;
use algo::pattern::Unwrapping;
use algo::units::AbsolutePhase;
use hal::npy::Array;
use hal::replay::Recording;

/// An expected phase map that fits a recording.
#[derive(Debug)]
pub(super) struct Known {
    /// "golden", "preliminary" or "given", for reports.
    name: &'static str,
    /// Which of the recording's patterns it is of.
    pub pattern: usize,
    /// Φ, row-major over the camera's frame, unknown where it was not resolved.
    phase: Vec<AbsolutePhase>,
    /// How far a placement within the recipe's tolerance can move the phase, turns; `None` without
    /// a recipe.
    reach: Option<Vec<f32>>,
}

impl Expected for Known {
    fn name(&self) -> &'static str {
        self.name
    }

    /// For levels of limited reach the map is unknown outside of their safe mask.
    fn map(&self, unwrapping: Unwrapping) -> Vec<AbsolutePhase> {
        let limit = match unwrapping {
            Unwrapping::Single => SequenceKind::SingleLevel.reach(),
            Unwrapping::DenseTwo { .. } => SequenceKind::TwoLevels.reach(),
            Unwrapping::Geometric | Unwrapping::DenseThree { .. } => None,
        };
        match limit {
            Some(turns) => self.within(f64::from(turns)),
            None => self.phase.clone(),
        }
    }

    fn within(&self, turns: f64) -> Vec<AbsolutePhase> {
        match &self.reach {
            Some(reach) => safe(&self.phase, reach, turns as f32),
            None => self.phase.clone(),
        }
    }
}

impl Known {
    /// The phase that the recording's pattern has on the surface of a preliminary measurement.
    ///
    /// # Errors
    /// If the preliminary measurement has frames of another size.
    pub fn expected(preliminary: &ProjectorMap, recording: &Recording) -> Result<Self> {
        let (width, height) = (recording.width as usize, recording.height as usize);
        let given = (preliminary.width, preliminary.height());
        if given != (width, height) {
            return Exit::Content.fail(format!(
                "the preliminary recording has frames of {}x{}, this one of {width}x{height}: both must come from one camera",
                given.0, given.1
            ));
        }
        let pattern = super::vertical_of(recording);
        let projector = &recording.projector;
        let (columns, rows) = (projector.width as usize, projector.height as usize);
        let function = seam::phase_function(&recording.patterns[pattern], columns, rows)
            .map_err(Exit::Content.failure())?;
        Ok(Self {
            name: "preliminary",
            pattern,
            phase: preliminary.expected_phase(&function),
            reach: None,
        })
    }

    /// A map from a file, of the recording's first vertical pattern, else of its first.
    ///
    /// # Errors
    /// If it has not the size of the frames.
    pub fn given(map: &Array<f64>, recording: &Recording) -> Result<Self> {
        let (width, height) = (recording.width as usize, recording.height as usize);
        if (map.columns, map.rows) != (width, height) {
            return Exit::Content.fail(format!(
                "the expected phase has {}x{} pixels, the recording {width}x{height}: name the expected phase that was made with this camera",
                map.columns, map.rows
            ));
        }
        let turns = map.elements.iter();
        Ok(Self {
            name: "given",
            pattern: super::vertical_of(recording),
            phase: turns
                .map(|&turns| AbsolutePhase::from_turns(turns))
                .collect(),
            reach: None,
        })
    }

    /// Golden's phase, of the recipe's pattern among the recording's.
    ///
    /// # Errors
    /// If the frames are of another size, or no pattern is the recipe's; both are named.
    pub fn of(recipe: &Recipe, recording: &Recording) -> Result<Self> {
        let pattern = recipe
            .pattern_in(recording)
            .map_err(Exit::Content.failure())?;
        let golden = recipe.arrays.golden_phase.iter();
        let golden = golden.map(|&turns| AbsolutePhase::from_turns(turns));
        Ok(Self {
            name: "golden",
            pattern,
            phase: golden.collect(),
            reach: Some(recipe.arrays.phase_reach.to_vec()),
        })
    }
}
