//! The camera of a head: the trait that every back-end implements.

use std::time::Duration;

use crate::error::Error;
use crate::frame::{Frame, FrameFormat};

/// Who starts an exposure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Starts {
    /// The trigger of the head: one exposure per pulse. A pulse while the camera is busy is lost.
    OnTrigger,
    /// The trigger output of the projector, by a wire of its own: one exposure with each refresh
    /// for which the camera is ready. Its length is that of the projector's pulse, on which no
    /// program has an influence.
    ByProjector,
    /// The camera itself, one exposure per period.
    ByItself,
}

/// How a running camera takes its frames. None of this changes while it runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CameraTiming {
    /// Who starts an exposure.
    pub starts: Starts,
    /// How long an exposure lasts; all rows are exposed at the same time.
    pub exposure: Duration,
    /// From the start of one exposure to the start of the next: the shortest possible time of a
    /// triggered camera, the fixed time of one that runs by itself.
    pub period: Duration,
    /// From the end of an exposure until its frame can be fetched, without any delay.
    pub delivery: Duration,
}

impl CameraTiming {
    /// The timing with exposures `times` as long; the time from the end of one exposure to the
    /// start of the next stays as it is.
    #[must_use]
    pub fn exposed(self, times: u32) -> Self {
        let exposure = self.exposure.saturating_mul(times);
        Self {
            exposure,
            period: exposure + self.period.saturating_sub(self.exposure),
            ..self
        }
    }
}

/// How samples are encoded on their way from the sensor.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Encoding {
    /// The driver's name of the encoding, such as "R16" or "MONO_PISP_COMP1".
    pub name: String,
    /// Whether samples are the sensor's counts. Compressed samples are not, and a phase computed
    /// from them cannot be trusted.
    pub exact: bool,
}

/// A camera that stamps and counts its frames.
///
/// A frame carries the camera's own count (a gap means that a frame was lost) and the sensor's time
/// stamp on the head's clock. Which moment of the exposure the stamp marks is measured by
/// calibration ([`crate::head::Stamp`]). Frames may arrive late, twice or in another order; users
/// must not rely on the order of arrival.
pub trait Camera: Send {
    /// The format that every frame will have.
    fn format(&self) -> FrameFormat;

    /// How samples are encoded on their way from the sensor.
    fn encoding(&self) -> Encoding;

    /// How the camera takes its frames.
    fn timing(&self) -> CameraTiming;

    /// Makes each exposure `times` as long as it is set to, from the camera's next start on;
    /// [`Camera::timing`] says so at once. The device is not asked: if it cannot, its start fails
    /// or its frames show it.
    ///
    /// # Errors
    /// `Unsupported` if this back-end can only expose as it is set to.
    fn expose(&mut self, times: u32) -> Result<(), Error> {
        match times {
            1 => Ok(()),
            _ => Err(Error::unsupported(
                format!("exposing {times} times as long as this camera is set to"),
                "use a recipe that was taught with --exposures 1",
            )),
        }
    }

    /// How long it may stay on without an exposure; zero if it is to be stopped after each
    /// sequence. A triggered camera that stays on is ready for the next sequence at once.
    fn stays_on(&self) -> Duration {
        Duration::ZERO
    }

    /// The temperature of its sensor as of the last frame, °C; `None` if the camera does not report
    /// it.
    fn temperature_c(&self) -> Option<f64> {
        None
    }

    /// Checks that the camera is still connected, without disturbing it. A back-end whose driver
    /// cannot tell returns `Ok`.
    ///
    /// # Errors
    /// `Disconnected` if it is gone.
    fn present(&self) -> Result<(), Error> {
        Ok(())
    }

    /// Starts the camera; triggers before this expose nothing.
    ///
    /// # Errors
    /// `Protocol` if it is running already.
    fn start(&mut self) -> Result<(), Error>;

    /// The next frame that has arrived, if any. Does not wait; [`crate::clock::Clock::wait`] does.
    ///
    /// # Errors
    /// `Protocol` if the camera is not running; `Disconnected` if it is gone.
    fn poll_frame(&mut self) -> Result<Option<Frame>, Error>;

    /// Stops the camera and discards frames that were not fetched. Stopping a stopped camera does
    /// nothing.
    ///
    /// # Errors
    /// The device's error.
    fn stop(&mut self) -> Result<(), Error>;
}
