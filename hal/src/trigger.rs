//! The trigger of a head: what starts one exposure of the camera.

use crate::error::Error;
use crate::units::Timestamp;

/// Starts one camera exposure per call.
pub trait Trigger: Send {
    /// Begins one pulse and answers when it began, without waiting for its end.
    ///
    /// Whether the camera took it shows in its frames only: a pulse on an open wire, or to a camera that is
    /// stopped or busy, is lost.
    ///
    /// # Errors
    /// What the device says.
    fn fire(&mut self) -> Result<Timestamp, Error>;
}

impl<T: Trigger + ?Sized> Trigger for Box<T> {
    fn fire(&mut self) -> Result<Timestamp, Error> {
        (**self).fire()
    }
}

/// No trigger: of a camera that runs by itself.
#[derive(Clone, Copy, Debug, Default)]
pub struct NoTrigger;

impl Trigger for NoTrigger {
    /// # Errors
    /// Always `Unsupported`.
    fn fire(&mut self) -> Result<Timestamp, Error> {
        Err(Error::unsupported(
            "triggering the camera without a trigger line",
            "name the line in head.trigger.line",
        ))
    }
}
