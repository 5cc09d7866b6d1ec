//! The camera of a head: what every back-end offers.

use std::time::Duration;

use crate::error::Error;
use crate::frame::{Frame, FrameFormat};

/// A camera that exposes one frame per trigger.
///
/// Frames come in the order of their exposures, with increasing sequence numbers and timestamps. A frame
/// that nobody fetched may be dropped; the gap in the sequence numbers shows it.
pub trait Camera: Send {
    /// The format that every frame will have.
    fn format(&self) -> FrameFormat;

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

    /// Waits for the next frame.
    ///
    /// # Errors
    /// `Timeout` if none came within `timeout`; `Protocol` if the camera is not armed.
    fn next_frame(&mut self, timeout: Duration) -> Result<Frame, Error>;

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

    fn present(&self) -> Result<(), Error> {
        (**self).present()
    }

    fn start(&mut self) -> Result<(), Error> {
        (**self).start()
    }

    fn next_frame(&mut self, timeout: Duration) -> Result<Frame, Error> {
        (**self).next_frame(timeout)
    }

    fn stop(&mut self) -> Result<(), Error> {
        (**self).stop()
    }
}
