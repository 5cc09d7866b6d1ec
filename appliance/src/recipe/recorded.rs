//! Which pattern of a recording is a recipe's.

use super::Recipe;
use super::Refusal;
use crate::head::seam;
use crate::recipe::rules::refused;
use algo::pattern::PhaseFunction;
use hal::replay::Recording;

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
            let function = seam::phase_function(spec, columns, rows);
            let function = function.map_err(|error| error.to_string())?;
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
