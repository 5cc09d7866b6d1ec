//! A head (camera, projector and trigger) and the acquisition of one sequence with it.

use std::time::Duration;

use crate::camera::Camera;
use crate::error::Error;
use crate::frame::{Frame, FrameFormat};
use crate::projector::{Flip, Projector, Raster};
use crate::trigger::Trigger;
use crate::units::Timestamp;

/// Frames older than their pattern that are discarded before the sequence is given up.
const MAX_STALE_FRAMES: u32 = 8;

/// A head of any back-end.
pub type DynHead = Head<Box<dyn Camera>, Box<dyn Projector>, Box<dyn Trigger>>;

/// Camera, projector and trigger that look at the same part.
#[derive(Debug)]
pub struct Head<C, P, T> {
    camera: C,
    projector: P,
    trigger: T,
}

/// When a sequence was taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Exposure {
    /// When the first pattern came into view.
    pub started: Timestamp,
    /// When the exposure of the last frame started.
    pub done: Timestamp,
    /// Frames that were older than their pattern and were discarded.
    pub stale: u32,
    /// Frames that were exposed and never came: gaps in the camera's count.
    pub dropped: u32,
    /// Refreshes that the projector missed: gaps in its count of flips.
    pub missed_flips: u32,
    /// Longest time from a pattern's coming into view to the start of its exposure.
    pub lag: Duration,
}

/// The counts of the frame and the flip before.
#[derive(Clone, Copy, Default)]
struct Counts {
    frame: Option<u64>,
    flip: Option<u64>,
}

/// How many counts are missing between two that follow each other.
fn gap(before: Option<u64>, now: u64) -> u32 {
    let missing = before.map_or(0, |before| now.saturating_sub(before).saturating_sub(1));
    u32::try_from(missing).unwrap_or(u32::MAX)
}

impl<C: Camera, P: Projector, T: Trigger> Head<C, P, T> {
    /// A head of these devices.
    pub fn new(camera: C, projector: P, trigger: T) -> Self {
        Self {
            camera,
            projector,
            trigger,
        }
    }

    /// The format of the frames that [`Head::acquire`] delivers.
    pub fn camera_format(&self) -> FrameFormat {
        self.camera.format()
    }

    /// Columns and rows of the rasters that [`Head::load`] takes.
    pub fn projector_size(&self) -> (u32, u32) {
        self.projector.size()
    }

    /// Time between two refreshes of the projector.
    pub fn refresh(&self) -> Duration {
        self.projector.refresh()
    }

    /// Asks whether camera and projector are still there, without disturbing them.
    ///
    /// # Errors
    /// `Disconnected` of the first one that is gone.
    pub fn present(&self) -> Result<(), Error> {
        self.camera.present()?;
        self.projector.present()
    }

    /// Replaces the patterns.
    ///
    /// # Errors
    /// As [`Projector::load`].
    pub fn load(&mut self, rasters: Vec<Raster>) -> Result<(), Error> {
        self.projector.load(rasters)
    }

    /// Shows the patterns `indices` in this order, exposes one frame of each, and hands each to `sink` with
    /// its pattern's index as soon as it is there. Every single wait is limited by `timeout`.
    ///
    /// A frame belongs to a pattern if its exposure did not start before the pattern came into view; earlier
    /// frames are discarded. However it ends, the camera is stopped and the projector blank afterwards.
    ///
    /// # Errors
    /// The first error of a device; `Protocol` if `indices` is empty or if nothing but stale frames comes.
    /// `sink` has then seen the frames before it.
    pub fn acquire(
        &mut self,
        indices: &[usize],
        timeout: Duration,
        sink: &mut dyn FnMut(usize, Frame),
    ) -> Result<Exposure, Error> {
        let mut all = |index, frame| {
            sink(index, frame);
            true
        };
        self.acquire_while(indices, timeout, &mut all)
    }

    /// As [`Head::acquire`], but `sink` ends the sequence early by answering `false`.
    ///
    /// # Errors
    /// As [`Head::acquire`]; ending early is none.
    pub fn acquire_while(
        &mut self,
        indices: &[usize],
        timeout: Duration,
        sink: &mut dyn FnMut(usize, Frame) -> bool,
    ) -> Result<Exposure, Error> {
        let result = self
            .camera
            .start()
            .and_then(|()| self.sequence(indices, timeout, sink));
        // Both are told, whatever the first one answers; the sequence's own error says more than theirs.
        let stopped = self.camera.stop();
        let blanked = self.projector.blank();
        let exposure = result?;
        stopped?;
        blanked?;
        Ok(exposure)
    }

    fn sequence(
        &mut self,
        indices: &[usize],
        timeout: Duration,
        sink: &mut dyn FnMut(usize, Frame) -> bool,
    ) -> Result<Exposure, Error> {
        let mut exposure: Option<Exposure> = None;
        let mut before = Counts::default();
        for &index in indices {
            let flip = self.projector.show(index, timeout)?;
            self.trigger.fire(timeout)?;
            let (frame, stale, dropped) = self.frame_of(index, flip, timeout, &mut before)?;
            let so_far = exposure.get_or_insert(Exposure {
                started: flip.timestamp,
                done: flip.timestamp,
                stale: 0,
                dropped: 0,
                missed_flips: 0,
                lag: Duration::ZERO,
            });
            so_far.done = frame.timestamp();
            so_far.stale += stale;
            so_far.dropped = so_far.dropped.saturating_add(dropped);
            let missed = gap(before.flip.replace(flip.sequence), flip.sequence);
            so_far.missed_flips = so_far.missed_flips.saturating_add(missed);
            so_far.lag = so_far.lag.max(frame.timestamp().since(flip.timestamp));
            if !sink(index, frame) {
                break;
            }
        }
        exposure.ok_or_else(|| {
            Error::protocol(
                "acquiring a sequence of 0 patterns",
                "name at least one loaded pattern",
            )
        })
    }

    /// The first frame that was exposed with pattern `index` in view, how many older ones came before it, and how many
    /// are missing in the camera's count.
    fn frame_of(
        &mut self,
        index: usize,
        flip: Flip,
        timeout: Duration,
        before: &mut Counts,
    ) -> Result<(Frame, u32, u32), Error> {
        let mut dropped = 0_u32;
        for stale in 0..=MAX_STALE_FRAMES {
            let frame = self.camera.next_frame(timeout)?;
            let missing = gap(before.frame.replace(frame.sequence()), frame.sequence());
            dropped = dropped.saturating_add(missing);
            if frame.timestamp() >= flip.timestamp {
                return Ok((frame, stale, dropped));
            }
        }
        Err(Error::protocol(
            format!(
                "waiting for the frame of pattern {index}, in view since {}: {} frames were exposed before that, which",
                flip.timestamp,
                MAX_STALE_FRAMES + 1
            ),
            "check that camera and projector stamp by the same clock and that the camera is triggered",
        ))
    }

    /// The devices, for the contract checks.
    pub(crate) fn devices(&mut self) -> (&mut C, &mut P, &mut T) {
        (&mut self.camera, &mut self.projector, &mut self.trigger)
    }
}

#[cfg(test)]
mod tests;
