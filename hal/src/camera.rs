//! The camera of a head: what every back-end offers.

use std::time::Duration;

use crate::error::Error;
use crate::frame::{Frame, FrameFormat};

/// Who starts an exposure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Starts {
    /// The trigger of the head: one exposure per pulse. A pulse while the camera is busy is lost.
    OnTrigger,
    /// The camera itself, one exposure per period; also one that the projector triggers by wire.
    ByItself,
}

/// How a running camera takes its frames. Nothing of it changes between start and stop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CameraTiming {
    /// Who starts an exposure.
    pub starts: Starts,
    /// How long one lasts; the same for all rows.
    pub exposure: Duration,
    /// From the start of one exposure to the start of the next: the shortest time if it is triggered, the time if it runs by itself.
    pub period: Duration,
    /// From the end of an exposure until its frame can be fetched when nothing is late.
    pub delivery: Duration,
}

/// How samples come over the wire.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Encoding {
    /// The driver's word, as "R16" or "MONO_PISP_COMP1".
    pub name: String,
    /// Whether samples are what the sensor counted. Compressed ones are not, and no phase can be trusted that is made of them.
    pub exact: bool,
}

/// A camera that stamps and counts its frames.
///
/// A frame carries the camera's own count (a gap means a frame that was lost) and the sensor's time on the head's
/// clock. What moment of the exposure that time marks is known by calibration ([`crate::head::Stamp`]). Frames
/// may come late, twice or in another order: nobody relies on the order of arrival.
pub trait Camera: Send {
    /// The format that every frame will have.
    fn format(&self) -> FrameFormat;

    /// How samples come over the wire.
    fn encoding(&self) -> Encoding;

    /// How it takes its frames.
    fn timing(&self) -> CameraTiming;

    /// Asks whether the camera is still there, without disturbing it. A back-end whose driver cannot say answers that it is.
    ///
    /// # Errors
    /// `Disconnected` if it is gone.
    fn present(&self) -> Result<(), Error> {
        Ok(())
    }

    /// Arms the camera; triggers before this expose nothing.
    ///
    /// # Errors
    /// `Protocol` if it is armed already.
    fn start(&mut self) -> Result<(), Error>;

    /// The next frame that is there. Does not wait: [`crate::clock::Clock::wait`] does.
    ///
    /// # Errors
    /// `Protocol` if the camera is not armed; `Disconnected` if it is gone.
    fn poll_frame(&mut self) -> Result<Option<Frame>, Error>;

    /// Disarms the camera and forgets frames that were not fetched. Stopping a stopped camera is fine.
    ///
    /// # Errors
    /// What the device says.
    fn stop(&mut self) -> Result<(), Error>;
}

impl<C: Camera + ?Sized> Camera for Box<C> {
    fn format(&self) -> FrameFormat {
        (**self).format()
    }

    fn encoding(&self) -> Encoding {
        (**self).encoding()
    }

    fn timing(&self) -> CameraTiming {
        (**self).timing()
    }

    fn present(&self) -> Result<(), Error> {
        (**self).present()
    }

    fn start(&mut self) -> Result<(), Error> {
        (**self).start()
    }

    fn poll_frame(&mut self) -> Result<Option<Frame>, Error> {
        (**self).poll_frame()
    }

    fn stop(&mut self) -> Result<(), Error> {
        (**self).stop()
    }
}
