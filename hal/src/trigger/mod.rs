//! The trigger of a head: what starts one exposure of the camera.

mod spoiled;

use crate::error::Error;
use crate::units::Timestamp;
pub use spoiled::{Edges, Spoiled};

/// Spoiled pulses that a trigger remembers until it is asked. Whoever asks looks at no frame that is older than so many triggers.
pub const REMEMBERED: usize = 16;

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

    /// The next pulse that was spoiled and has not been told; at most the latest [`REMEMBERED`] are.
    ///
    /// It can be told as soon as the pulse has ended. So whoever fetches a frame and then asks here knows of the pulse that
    /// exposed it. A trigger that knows nothing of its pulses tells none.
    fn poll_spoiled(&mut self) -> Option<Spoiled> {
        None
    }
}

impl<T: Trigger + ?Sized> Trigger for Box<T> {
    fn fire(&mut self) -> Result<Timestamp, Error> {
        (**self).fire()
    }

    fn poll_spoiled(&mut self) -> Option<Spoiled> {
        (**self).poll_spoiled()
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
