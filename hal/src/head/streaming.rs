//! Keeps a triggered camera on between sequences, because starting one may take half a second.
//!
//! It stays on only after a sequence in which each trigger gave its frame, so that no frame of it
//! can arrive in the next one; a copy of such a frame is known by its count. It is stopped before
//! it has waited for longer than it may ([`Camera::stays_on`](crate::camera::Camera::stays_on)),
//! because libcamera gives up on a camera that gives no frame.

use std::time::Duration;

use super::{Devices, Head};
use crate::error::Error;
use crate::frame::Frame;
use crate::units::Timestamp;

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

impl Head {
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
}
