//! Checks whether a recipe can be used on a head by planning it; the plan is dropped.

use super::{Plan, PlanError};
use crate::head::calibration::Calibration;
use crate::recipe::Recipe;
use std::sync::{Mutex, PoisonError};

/// One recipe is tried at a time: planning takes up to 31 bytes per pixel beside the recipe itself.
static ONE: Mutex<()> = Mutex::new(());

impl Plan {
    /// Plans a recipe on one thread of its own, so that the computing threads are left to the
    /// measurement.
    ///
    /// # Errors
    /// As [`Plan::new`].
    pub fn try_out(recipe: Recipe, calibration: &Calibration) -> Result<(), PlanError> {
        let number = recipe.id.number;
        let _alone = ONE.lock().unwrap_or_else(PoisonError::into_inner);
        let thread = rayon::ThreadPoolBuilder::new().num_threads(1).build();
        let thread = thread.map_err(|error| PlanError::Unfit {
            number,
            reason: format!("it cannot be tried out: {error}: end other programs"),
        })?;
        thread
            .install(|| Self::new(recipe, calibration, false))
            .map(drop)
    }
}
