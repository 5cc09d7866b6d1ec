//! Watching a head without a sequence: patterns are shown for whole refreshes, the camera exposes
//! continuously, and everything that arrives is kept.
//!
//! No frame is assigned to a pattern, discarded or taken again. The doctor uses this to examine a
//! head, and calibration to measure the times on which a sequence relies.

use std::time::Duration;

use super::clipping::Clipping;
use super::{Head, wait};
use crate::camera::Starts;
use crate::error::Error;
use crate::frame::Frame;
use crate::projector::Flip;
use crate::trigger::Spoiled;
use crate::units::Timestamp;

/// A pattern and how long it is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Showing {
    /// The loaded pattern.
    pub index: usize,
    /// How many refreshes it is shown for, at least 1.
    pub refreshes: u32,
    /// How many refreshes after the flip no trigger fires, so that the light has settled. A camera
    /// that runs by itself exposes anyway.
    pub settle: u32,
}

/// What happened while patterns were shown.
#[derive(Clone, Debug)]
pub struct Watched<M> {
    /// The flips, in the order of the showings; fewer if the projector stopped.
    pub flips: Vec<Flip>,
    /// When the trigger fired.
    pub triggers: Vec<Timestamp>,
    /// Spoiled pulses of the trigger that determined the length of an exposure.
    pub spoiled: Vec<Spoiled>,
    /// The frames in the order of their arrival.
    pub frames: Vec<WatchedFrame<M>>,
}

/// A frame that arrived: its times, its count, and what was measured in it.
#[derive(Clone, Copy, Debug)]
pub struct WatchedFrame<M> {
    /// Start of the exposure, computed from the stamp with the head's timing.
    pub start: Timestamp,
    /// When the frame was fetched.
    pub arrived: Timestamp,
    /// The camera's count.
    pub count: u64,
    /// What was measured.
    pub measured: M,
}

impl<M> Watched<M> {
    /// Whether a spoiled pulse may have affected an exposure that started at `start` by its stamp:
    /// its own or a neighbouring one, as stamps of the end are off by as much as the pulse.
    pub fn spoiled_near(&self, start: Timestamp) -> bool {
        let near = |pulse: &Spoiled| start.off(pulse.fired) <= pulse.width + pulse.off();
        self.spoiled.iter().any(near)
    }
}

impl Head {
    /// Shows `showings` one after the other while the camera exposes as often as it does in a
    /// sequence, and measures every frame. Flips and frames that do not arrive are missing in the
    /// result, without an error. Ends at the latest `timeout` after its planned end.
    ///
    /// # Errors
    /// The first error of a device.
    pub fn watch<M>(
        &mut self,
        showings: &[Showing],
        timeout: Duration,
        measure: &mut dyn FnMut(&Frame) -> M,
    ) -> Result<Watched<M>, Error> {
        let spacing = self.refresh() * self.timing.hold.max(1);
        self.watching(showings, spacing, timeout, measure, None)
    }

    /// As [`Head::watch`], with triggers `spacing` apart, or as far apart as the camera says if
    /// that is more.
    ///
    /// # Errors
    /// The first error of a device.
    pub fn watch_spaced<M>(
        &mut self,
        showings: &[Showing],
        spacing: Duration,
        timeout: Duration,
        measure: &mut dyn FnMut(&Frame) -> M,
    ) -> Result<Watched<M>, Error> {
        self.watching(showings, spacing, timeout, measure, None)
    }

    /// As [`Head::watch`], but ends within a refresh when `go_on` returns `false`; what has arrived
    /// by then is the result.
    ///
    /// # Errors
    /// As [`Head::watch`].
    pub fn watch_while<M>(
        &mut self,
        showings: &[Showing],
        timeout: Duration,
        measure: &mut dyn FnMut(&Frame) -> M,
        go_on: &dyn Fn() -> bool,
    ) -> Result<Watched<M>, Error> {
        let spacing = self.refresh() * self.timing.hold.max(1);
        self.watching(showings, spacing, timeout, measure, Some(go_on))
    }

    fn watching<M>(
        &mut self,
        showings: &[Showing],
        spacing: Duration,
        timeout: Duration,
        measure: &mut dyn FnMut(&Frame) -> M,
        go_on: Option<&dyn Fn() -> bool>,
    ) -> Result<Watched<M>, Error> {
        let (camera, refresh, timing) = (self.camera_timing(), self.refresh(), self.timing);
        let head_goes_on = self.go_on.clone();
        let triggered = camera.starts == Starts::OnTrigger;
        let spacing = spacing.max(camera.period);
        let mut seen = Watched {
            flips: Vec::new(),
            triggers: Vec::new(),
            spoiled: Vec::new(),
            frames: Vec::new(),
        };
        let refreshes: u32 = showings.iter().map(|showing| showing.refreshes + 1).sum();
        // The last exposure ends, and its frame arrives, after the last pattern.
        let rest = camera.exposure + camera.period + camera.delivery + timing.flip_to_light;
        self.devices.exposing(|devices, _| {
            let deadline = devices.clock.now() + (refresh * refreshes + rest + timeout);
            let (mut queued, mut next_flip, mut settled) = (0, devices.clock.now(), None);
            let mut free = devices.clock.now();
            loop {
                while let Some(flip) = devices.projector.poll_flip()? {
                    let Some(showing) = showings.get(seen.flips.len()) else {
                        continue;
                    };
                    seen.flips.push(flip);
                    // Well after the last refresh that this pattern is to have, and well before the
                    // next.
                    next_flip =
                        flip.timestamp + (refresh * (showing.refreshes.max(1) - 1) + refresh / 8);
                    settled = Some(flip.timestamp + refresh * showing.settle);
                }
                while let Some(frame) = devices.camera.poll_frame()? {
                    if !devices.streaming.is_new(&frame) {
                        continue;
                    }
                    let frame = Clipping::marked(&mut devices.clipping, frame)?;
                    seen.frames.push(WatchedFrame {
                        start: timing.exposure_start(&camera, frame.timestamp()),
                        arrived: devices.clock.now(),
                        count: frame.count(),
                        measured: measure(&frame),
                    });
                }
                // A pulse that fired before this watch is ignored.
                let fired = |pulse: &Spoiled| {
                    pulse.decides(camera.exposure) && seen.triggers.contains(&pulse.fired)
                };
                let spoiled = std::iter::from_fn(|| devices.trigger.poll_spoiled());
                seen.spoiled.extend(spoiled.filter(fired));
                if head_goes_on.as_ref().is_some_and(|go_on| !go_on()) {
                    return Err(Error::ended("watching the head"));
                }
                let now = devices.clock.now();
                let shown = seen.flips.len() == showings.len();
                let end = next_flip + (refresh + timing.flip_to_light);
                if go_on.is_some_and(|go_on| !go_on())
                    || now >= deadline
                    || shown && now >= end + rest
                {
                    // Frames of the last triggers may still be missing.
                    return Ok(((), false));
                }
                if !shown && queued == seen.flips.len() && now >= next_flip {
                    devices
                        .projector
                        .queue(devices.kept + showings[queued].index)?;
                    queued += 1;
                    continue;
                }
                let mut next = if shown { end + rest } else { deadline };
                if !shown && queued == seen.flips.len() {
                    next = next.min(next_flip);
                }
                if triggered
                    && !(shown && now >= end)
                    && let Some(settled) = settled
                {
                    let due = settled.max(free);
                    if due <= now {
                        let at = devices.trigger.fire()?;
                        seen.triggers.push(at);
                        free = at + spacing;
                        continue;
                    }
                    next = next.min(due);
                }
                if go_on.is_some() || head_goes_on.is_some() {
                    next = next.min(now + refresh);
                }
                wait(&mut *devices.clock, next.min(deadline));
            }
        })?;
        Ok(seen)
    }
}
