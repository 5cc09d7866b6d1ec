//! The devices of a head: how the camera is started and stays on, what is loaded and how long it is
//! exposed, and what stands in for devices that are closed.
//!
//! A triggered camera stays on between sequences, because starting one may take half a second. It
//! stays on only after a sequence in which each trigger gave its frame, so that no frame of it can
//! arrive in the next one; a copy of such a frame is known by its count. It is stopped before it has
//! waited for longer than it may ([`Camera::stays_on`]), because libcamera gives up on a camera that
//! gives no frame.
//!
//! Patterns may be exposed several times as long as the camera is set to. A digital micromirror
//! device makes grey levels over whole refreshes, so a longer exposure is a whole number of those
//! that the camera is set to. What depends on the exposure (period of the camera, pulse of the
//! trigger, times of patterns, time-outs) is computed from [`Camera::timing`].
//!
//! A device can be open only once, so a lost head must be closed before it can be opened again. A
//! closed head keeps the properties of its devices, and every call fails with `Disconnected`.

use std::sync::Arc;
use std::time::Duration;

use super::Head;
use super::clipping::Clipping;
use crate::camera::{Camera, CameraTiming, Encoding, Starts};
use crate::clock::{Clock, Monotonic};
use crate::error::{DeviceKind, Error};
use crate::frame::{Frame, FrameFormat};
use crate::projector::{Flip, Projector, Raster};
use crate::trigger::{NoTrigger, Trigger};
use crate::units::Timestamp;

/// Whether work with a head may go on; called at least once per refresh, also from another thread.
pub type GoOn = Arc<dyn Fn() -> bool + Send + Sync>;

/// The devices, and what a sequence finds of the one before.
pub(crate) struct Devices {
    pub camera: Box<dyn Camera>,
    pub projector: Box<dyn Projector>,
    pub trigger: Box<dyn Trigger>,
    pub clock: Box<dyn Clock>,
    /// Whether the camera stayed on after a sequence, and which frames it had given.
    pub(super) streaming: Streaming,
    /// How many times as long as the camera is set to each exposure lasts.
    pub(super) exposures: u32,
    /// Number of the first patterns that stay loaded; indices of the others count from behind them.
    pub(super) kept: usize,
    /// Where the camera clips below full scale.
    pub(super) clipping: Option<Clipping>,
}

/// A camera that stayed on.
#[derive(Debug, Default)]
pub(super) struct Streaming {
    /// Since when it has been waiting; none if it is stopped, or a sequence runs.
    since: Option<Timestamp>,
    /// How it was started ([`Head::expose`]).
    exposures: u32,
    /// Counts of frames are at least this since the sequence began.
    first: u64,
    /// One more than the largest count of a frame.
    next: u64,
}

impl Streaming {
    /// Records a frame, and returns whether it was exposed since the sequence began.
    pub fn is_new(&mut self, frame: &Frame) -> bool {
        self.next = self.next.max(frame.count() + 1);
        frame.count() >= self.first
    }
}

/// The properties of the devices that were closed.
#[derive(Clone, Debug)]
struct Closed {
    format: FrameFormat,
    encoding: Encoding,
    timing: CameraTiming,
    size: (u32, u32),
    refresh: Duration,
}

impl Head {
    /// Replaces the patterns; within [`Head::aside`] only those behind the patterns that stay. They
    /// are exposed as the camera is set, unless [`Head::expose`] follows.
    ///
    /// # Errors
    /// As [`Projector::load_behind`]; `Ended` as
    /// described there.
    pub fn load(&mut self, rasters: Vec<Raster>) -> Result<(), Error> {
        self.devices.expose(1)?;
        let kept = self.devices.kept;
        let projector = &mut self.devices.projector;
        let Some(go_on) = &self.go_on else {
            return projector.load_behind(kept, rasters);
        };
        projector.load_behind(kept, Vec::new())?;
        // One after the other: a projector takes milliseconds for each.
        for (at, raster) in (kept..).zip(rasters) {
            if !go_on() {
                return Err(Error::ended("loading patterns"));
            }
            projector.load_behind(at, vec![raster])?;
        }
        Ok(())
    }

    /// Calls `work`, for which the first `kept` patterns stay loaded: what it loads comes behind
    /// them, and its indices count from there. It exposes as the camera is set; patterns that stay
    /// are exposed afterwards as before. When `go_on` returns `false`, loading ends before the next
    /// pattern, a sequence as soon as the camera has given the frames that it was triggered for,
    /// and a watch within a refresh, each with the error `Ended`.
    pub fn aside<R>(&mut self, kept: usize, go_on: GoOn, work: impl FnOnce(&mut Self) -> R) -> R {
        let exposures = self.exposures();
        self.devices.kept = kept;
        self.go_on = Some(go_on);
        // Neither can be refused: the camera is set to one, and the others were accepted before.
        let _ = self.devices.expose(1);
        let result = work(self);
        let _ = self.devices.expose(exposures);
        self.devices.kept = 0;
        self.go_on = None;
        result
    }

    /// Exposes the patterns that are loaded `times` as long as the camera is set to, until others
    /// are loaded. A camera that is on is started again by the next sequence.
    ///
    /// # Errors
    /// `Unsupported` if the projector's pulse sets the exposure, or the camera's back-end can only
    /// expose as it is set to.
    pub fn expose(&mut self, times: u32) -> Result<(), Error> {
        self.devices.expose(times.max(1))
    }

    /// How many times as long as set each exposure lasts.
    pub fn exposures(&self) -> u32 {
        self.devices.exposures
    }

    /// How long a camera that is on may wait for the next sequence; zero if it is stopped after
    /// each.
    pub fn stays_on(&self) -> Duration {
        self.devices.camera.stays_on()
    }

    /// How long the camera takes to start.
    ///
    /// # Errors
    /// The error of the camera.
    pub fn start_up(&mut self) -> Result<Duration, Error> {
        let devices = &mut self.devices;
        devices.streaming.since = None;
        devices.camera.stop()?;
        devices.exposing(|_, start_up| Ok((start_up, false)))
    }

    /// To be called now and then while nothing is measured: checks that camera and projector are
    /// still connected, and stops a camera that has waited for as long as it may.
    ///
    /// # Errors
    /// `Disconnected` for the first one that is gone; an error of stopping the camera.
    pub fn rest(&mut self) -> Result<(), Error> {
        self.present()?;
        let Devices {
            camera,
            clock,
            streaming,
            ..
        } = &mut self.devices;
        let over = |since: &mut Timestamp| clock.now() >= *since + camera.stays_on();
        match streaming.since.take_if(over) {
            Some(_) => camera.stop(),
            None => Ok(()),
        }
    }

    /// A closed head with the properties of this one.
    pub fn closed(&self) -> Self {
        let like = Closed {
            format: self.camera_format(),
            encoding: self.encoding(),
            timing: self.camera_timing(),
            size: self.projector_size(),
            refresh: self.refresh(),
        };
        let mut closed = Self::new(
            Box::new(like.clone()),
            Box::new(like),
            Box::new(NoTrigger),
            Box::new(Monotonic::default()),
            self.timing(),
        );
        // The camera's timing is that of so many exposures.
        closed.devices.exposures = self.devices.exposures;
        closed
    }
}

impl Devices {
    /// Calls `work` with a running camera and how long it took to start. `work` also returns
    /// whether the camera may stay on: whether each exposure has given its frame. However it ends,
    /// the projector is blank afterwards.
    pub fn exposing<R>(
        &mut self,
        work: impl FnOnce(&mut Self, Duration) -> Result<(R, bool), Error>,
    ) -> Result<R, Error> {
        let result = self.start().and_then(|start_up| work(self, start_up));
        let stays = matches!(result, Ok((_, true))) && !self.camera.stays_on().is_zero();
        // Both calls are made even if the first fails; an error of `work` is more useful than
        // theirs and goes first.
        let stopped = match stays {
            true => Ok(()),
            false => self.camera.stop(),
        };
        self.streaming.since = stays.then(|| self.clock.now());
        let blanked = self.projector.blank();
        let (result, _) = result?;
        stopped?;
        blanked?;
        Ok(result)
    }

    /// Starts the camera, unless it is on, and returns how long that took.
    fn start(&mut self) -> Result<Duration, Error> {
        let waiting = self.streaming.since.take().is_some();
        if waiting && self.streaming.exposures != self.exposures {
            self.camera.stop()?;
        } else if waiting {
            while let Some(frame) = self.camera.poll_frame()? {
                self.streaming.is_new(&frame);
            }
            self.streaming.first = self.streaming.next;
            return Ok(Duration::ZERO);
        }
        (self.streaming.first, self.streaming.exposures) = (0, self.exposures);
        let begun = self.clock.now();
        self.camera.start()?;
        Ok(self.clock.now().since(begun))
    }

    pub(super) fn expose(&mut self, times: u32) -> Result<(), Error> {
        if times == self.exposures {
            return Ok(());
        }
        let before = self.camera.timing();
        if before.starts == Starts::ByProjector {
            return Err(Error::unsupported(
                format!("exposing {times} times as long: the projector's pulse sets the exposure"),
                "use a recipe that was taught with --exposures 1, or wire the camera's trigger to the computer",
            ));
        }
        self.camera.expose(times)?;
        self.trigger.expose(before.exposure / self.exposures, times);
        self.exposures = times;
        Ok(())
    }
}

fn gone<T>(device: DeviceKind) -> Result<T, Error> {
    Err(Error::disconnected(device, "using a head that is closed"))
}

impl Camera for Closed {
    fn format(&self) -> FrameFormat {
        self.format
    }

    fn encoding(&self) -> Encoding {
        self.encoding.clone()
    }

    fn timing(&self) -> CameraTiming {
        self.timing
    }

    fn present(&self) -> Result<(), Error> {
        gone(DeviceKind::Camera)
    }

    fn start(&mut self) -> Result<(), Error> {
        gone(DeviceKind::Camera)
    }

    fn poll_frame(&mut self) -> Result<Option<Frame>, Error> {
        gone(DeviceKind::Camera)
    }

    fn stop(&mut self) -> Result<(), Error> {
        Ok(())
    }
}

impl Projector for Closed {
    fn size(&self) -> (u32, u32) {
        self.size
    }

    fn refresh(&self) -> Duration {
        self.refresh
    }

    fn present(&self) -> Result<(), Error> {
        gone(DeviceKind::Projector)
    }

    fn load_behind(&mut self, _: usize, _: Vec<Raster>) -> Result<(), Error> {
        gone(DeviceKind::Projector)
    }

    fn queue(&mut self, _: usize) -> Result<(), Error> {
        gone(DeviceKind::Projector)
    }

    fn poll_flip(&mut self) -> Result<Option<Flip>, Error> {
        gone(DeviceKind::Projector)
    }

    fn blank(&mut self) -> Result<(), Error> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use crate::error::ErrorKind;
    use crate::head::tests::{labelled, plain};
    use std::time::Duration;

    #[test]
    fn a_closed_head_is_what_it_was_like_and_measures_nothing() {
        let head = labelled(plain(), 1);
        let mut closed = head.closed();
        assert_eq!(
            (closed.camera_format(), closed.projector_size()),
            (head.camera_format(), head.projector_size())
        );
        assert_eq!(closed.timing(), head.timing());
        let answers = [
            closed.present(),
            closed.load(Vec::new()),
            closed
                .acquire(&[0], Duration::ZERO, &mut |_, _| ())
                .map(|_| ()),
        ];
        for answer in answers {
            assert_eq!(answer.unwrap_err().kind(), ErrorKind::Disconnected);
        }
    }
}
