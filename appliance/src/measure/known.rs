//! What a recipe knows of a recording: its golden map, once the two are found to fit.

use super::AnyError;
use crate::recipe::Recipe;
use crate::seam;
use algo::pattern::PhaseFunction;
use algo::units::AbsolutePhase;
use hal::replay::Recording;

/// Phase functions that differ by no more than this are the same one, in turns: files hold `f64`.
const SAME: f64 = 1e-9;

/// The golden map of a recipe that fits a recording.
#[derive(Debug)]
pub(super) struct Known {
    /// Which of the recording's patterns is the recipe's.
    pub pattern: usize,
    /// Φ as taught, row-major over the camera's frame, unknown where it was not resolved.
    pub golden: Vec<AbsolutePhase>,
}

impl Known {
    /// Finds the recipe's pattern among the recording's.
    ///
    /// # Errors
    /// If the frames are of another size, or no pattern is the recipe's; both are named.
    pub fn of(recipe: &Recipe, recording: &Recording) -> Result<Self, AnyError> {
        let number = recipe.file.number;
        let camera = &recipe.file.camera;
        if (camera.width, camera.height) != (recording.width, recording.height) {
            return Err(format!(
                "recipe {number} is for frames of {}x{}, the recording has {}x{}: name the recipe that \
                 was taught with this camera",
                camera.width, camera.height, recording.width, recording.height
            )
            .into());
        }
        let projector = &recording.projector;
        let mut others = Vec::new();
        for (pattern, spec) in recording.patterns.iter().enumerate() {
            let (columns, rows) = (projector.width as usize, projector.height as usize);
            let function = seam::phase_function(spec, columns, rows)?;
            let apart = difference(&function, &recipe.function);
            if apart.is_some_and(|turns| turns <= SAME) {
                let golden = recipe.arrays.golden_phase.iter();
                let golden = golden.map(|&turns| AbsolutePhase::from_turns(turns));
                return Ok(Self {
                    pattern,
                    golden: golden.collect(),
                });
            }
            others.push(match apart {
                Some(turns) => format!("{function} (up to {turns:.3e} turns apart)"),
                None => function.to_string(),
            });
        }
        Err(format!(
            "the recording was made with {}, recipe {number} with {}: name the recipe of this pattern, or \
             measure without one",
            others.join(" and "),
            recipe.function
        )
        .into())
    }
}

/// The largest difference of two phase functions over the pixels of the raster, in turns; none if
/// their rasters differ.
fn difference(a: &PhaseFunction, b: &PhaseFunction) -> Option<f64> {
    let (columns, rows) = (a.columns(), a.rows());
    let differences = (0..rows).flat_map(|row| {
        (0..columns).map(move |column| (a.at_pixel(column, row) - b.at_pixel(column, row)).abs())
    });
    ((columns, rows) == (b.columns(), b.rows())).then(|| differences.fold(0.0, f64::max))
}
