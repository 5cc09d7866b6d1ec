//! Looking at a head without a sequence: show patterns by the refresh, expose all the while, and keep what comes.
//!
//! Nothing is proved, discarded or taken again here. It is for those who want to know whether a head is well, and for those
//! who measure what a sequence takes for given.

use std::time::Duration;

use super::{Head, wait};
use crate::camera::{Camera, Starts};
use crate::clock::Clock;
use crate::error::Error;
use crate::frame::Frame;
use crate::projector::{Flip, Projector};
use crate::trigger::{Spoiled, Trigger};
use crate::units::Timestamp;

/// A pattern and how long it is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Showing {
    /// The loaded pattern.
    pub index: usize,
    /// For so many refreshes, at least 1.
    pub refreshes: u32,
    /// Not triggered for so many refreshes after the flip, so that light has settled. A camera that runs by itself exposes anyway.
    pub settle: u32,
}

/// What came while patterns were shown.
#[derive(Clone, Debug)]
pub struct Watched<M> {
    /// The flips, in the order of the showings; fewer if the projector stopped.
    pub flips: Vec<Flip>,
    /// When the trigger fired.
    pub triggers: Vec<Timestamp>,
    /// Pulses of the trigger that did not last as long as they should, and decided an exposure.
    pub spoiled: Vec<Spoiled>,
    /// The frames in the order of their arrival.
    pub frames: Vec<Seen<M>>,
}

/// What was measured in a frame.
#[derive(Clone, Copy, Debug)]
pub struct Seen<M> {
    /// Start of the exposure, as its stamp is understood.
    pub start: Timestamp,
    /// When the frame was there to be fetched, at the latest.
    pub arrived: Timestamp,
    /// The camera's count.
    pub count: u64,
    /// What was measured.
    pub measured: M,
}

impl<M> Watched<M> {
    /// Whether a spoiled pulse may have had a part in an exposure that seems to have started then: its own or a neighbour's, as stamps
    /// of ends are off by as much as the pulse.
    pub fn spoiled_near(&self, start: Timestamp) -> bool {
        let near = |pulse: &Spoiled| {
            let reach = u128::from(start.0.abs_diff(pulse.fired.0));
            reach <= (pulse.width + pulse.off()).as_nanos()
        };
        self.spoiled.iter().any(near)
    }
}

impl<C: Camera, P: Projector, T: Trigger, K: Clock> Head<C, P, T, K> {
    /// Shows `showings` one after the other while the camera exposes as often as it can, and measures every frame. Flips and
    /// frames that do not come are missing in the answer: that is no error. Ends at the latest `timeout` after the plan.
    ///
    /// # Errors
    /// The first error of a device.
    pub fn watch<M>(
        &mut self,
        showings: &[Showing],
        timeout: Duration,
        measure: &mut dyn FnMut(&Frame) -> M,
    ) -> Result<Watched<M>, Error> {
        let (camera, refresh, timing) = (self.camera_timing(), self.refresh(), self.timing);
        let triggered = camera.starts == Starts::OnTrigger;
        let mut seen = Watched {
            flips: Vec::new(),
            triggers: Vec::new(),
            spoiled: Vec::new(),
            frames: Vec::new(),
        };
        let refreshes: u32 = showings.iter().map(|showing| showing.refreshes + 1).sum();
        // The last exposure and its frame come after the last pattern.
        let rest = camera.exposure + camera.period + camera.delivery + timing.flip_to_light;
        self.devices.exposing(|devices| {
            let deadline = devices.clock.now() + (refresh * refreshes + rest + timeout);
            let (mut queued, mut next_flip, mut settled) = (0, devices.clock.now(), None);
            let mut free = devices.clock.now();
            loop {
                while let Some(flip) = devices.projector.poll_flip()? {
                    let Some(showing) = showings.get(seen.flips.len()) else {
                        continue;
                    };
                    seen.flips.push(flip);
                    // Well after the last refresh that this pattern is to have, and well before the next.
                    next_flip =
                        flip.timestamp + (refresh * (showing.refreshes.max(1) - 1) + refresh / 8);
                    settled = Some(flip.timestamp + refresh * showing.settle);
                }
                while let Some(frame) = devices.camera.poll_frame()? {
                    seen.frames.push(Seen {
                        start: timing.exposure_start(&camera, frame.timestamp()),
                        arrived: devices.clock.now(),
                        count: frame.sequence(),
                        measured: measure(&frame),
                    });
                }
                // One of before is nobody's any more.
                let fired = |pulse: &Spoiled| {
                    pulse.decides(camera.exposure) && seen.triggers.contains(&pulse.fired)
                };
                let told = std::iter::from_fn(|| devices.trigger.poll_spoiled());
                seen.spoiled.extend(told.filter(fired));
                let now = devices.clock.now();
                let shown = seen.flips.len() == showings.len();
                let end = next_flip + (refresh + timing.flip_to_light);
                if now >= deadline || shown && now >= end + rest {
                    return Ok(());
                }
                if !shown && queued == seen.flips.len() && now >= next_flip {
                    devices.projector.queue(showings[queued].index)?;
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
                        free = at + camera.period;
                        continue;
                    }
                    next = next.min(due);
                }
                wait(&mut devices.clock, next.min(deadline));
            }
        })?;
        Ok(seen)
    }
}
