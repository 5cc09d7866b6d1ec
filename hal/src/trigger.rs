//! The trigger of a head: what starts one exposure of the camera.

use std::time::Duration;

use crate::error::Error;
use crate::units::Timestamp;

/// Starts one camera exposure per call.
pub trait Trigger: Send {
    /// Starts one exposure and returns when it started.
    ///
    /// # Errors
    /// `Timeout` if the exposure could not start within `timeout`.
    fn fire(&mut self, timeout: Duration) -> Result<Timestamp, Error>;
}

impl<T: Trigger + ?Sized> Trigger for Box<T> {
    fn fire(&mut self, timeout: Duration) -> Result<Timestamp, Error> {
        (**self).fire(timeout)
    }
}
