//! The trigger of a head: what starts one exposure of the camera.

mod spoiled;

use std::time::Duration;

use crate::error::Error;
use crate::units::Timestamp;
#[cfg(feature = "gpio")]
pub(crate) use spoiled::decides;
pub use spoiled::{Edges, Spoiled};

/// How many triggers back a frame may belong to: so many pulses are remembered, and so many spoiled
/// ones are kept until fetched.
pub const REMEMBERED: usize = 16;

/// The latest spoiled pulses, oldest first; filled with [`crate::latest::keep`].
pub(crate) type SpoiledPulses = heapless::Deque<Spoiled, REMEMBERED>;

/// Starts one camera exposure per call.
pub trait Trigger: Send {
    /// Begins one pulse and returns the time at which it began, without waiting for its end.
    ///
    /// Only the frames show whether the camera took it: a pulse on an open wire, or to a camera
    /// that is stopped or busy, is lost.
    ///
    /// # Errors
    /// The device's error.
    fn fire(&mut self) -> Result<Timestamp, Error>;

    /// From now on the camera exposes `times` as long as its own `exposure`: so do pulses that set
    /// the exposure.
    fn expose(&mut self, _exposure: Duration, _times: u32) {}

    /// The next spoiled pulse that was not fetched yet; at most the latest [`REMEMBERED`] are kept.
    ///
    /// A spoiled pulse is known as soon as it has ended. So a caller that first fetches a frame and
    /// then calls this learns of the pulse that exposed it. A trigger that does not measure its
    /// pulses returns `None`.
    fn poll_spoiled(&mut self) -> Option<Spoiled> {
        None
    }
}

/// No trigger, for a camera that runs by itself.
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
