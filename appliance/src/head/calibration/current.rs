//! The calibration of the head that is open, for threads that do not own the head.

use super::Calibration;
use std::sync::{Arc, Mutex, PoisonError};

/// Set by the measuring task whenever it opens a head. Cheap to clone.
#[derive(Clone, Debug, Default)]
pub struct Current(Arc<Mutex<Option<Arc<Calibration>>>>);

impl Current {
    /// Sets the calibration of the head that was just opened; `None` if the head has no calibration
    /// that can be trusted.
    pub fn set(&self, calibration: Option<&Calibration>) {
        let calibration = calibration.cloned().map(Arc::new);
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = calibration;
    }

    /// The calibration; `None` before a head is open, and if the head has no calibration that can
    /// be trusted.
    pub fn get(&self) -> Option<Arc<Calibration>> {
        let current = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        current.clone()
    }
}
