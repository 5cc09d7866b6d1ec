//! A head (camera, projector and trigger) and the acquisition of one sequence with it.
//!
//! The `sequencer` decides and knows no device; the loop here carries its decisions out.

mod clipping;
mod devices;
mod identity;
mod outcome;
mod pacing;
mod sequencer;
mod watch;

use std::sync::mpsc;
use std::time::Duration;

use crate::camera::{Camera, CameraTiming, Encoding, Starts};
use crate::clock::Clock;
use crate::error::Error;
use crate::frame::{Frame, FrameFormat};
use crate::projector::ControllerState;
use crate::projector::Projector;
use crate::trigger::Trigger;
use crate::units::Timestamp;
use clipping::Clipping;
use devices::Devices;
pub use devices::GoOn;
pub use outcome::Exposure;
use pacing::Pacing;
pub use pacing::{Stamp, TOLERANCE, Timing};
use sequencer::{Act, Sequencer};
pub use watch::{Showing, Watched, WatchedFrame};

/// A device may disappear without ending a wait; on a real clock the devices are polled at least
/// this often.
const UNNOTICED: Duration = Duration::from_millis(100);

/// Camera, projector and trigger in front of the same part, and the clock that they share.
pub struct Head {
    devices: Devices,
    timing: Timing,
    sequencer: Sequencer,
    /// What ends everything that the head does; see [`Head::aside`].
    go_on: Option<GoOn>,
}

impl Head {
    /// A head of these devices with these measured times.
    pub fn new(
        camera: Box<dyn Camera>,
        projector: Box<dyn Projector>,
        trigger: Box<dyn Trigger>,
        clock: Box<dyn Clock>,
        timing: Timing,
    ) -> Self {
        Self {
            devices: Devices {
                camera,
                projector,
                trigger,
                clock,
                streaming: Default::default(),
                exposures: 1,
                kept: 0,
                clipping: None,
            },
            timing,
            sequencer: Sequencer::default(),
            go_on: None,
        }
    }

    /// The format of the frames that [`Head::acquire`] delivers.
    pub fn camera_format(&self) -> FrameFormat {
        self.devices.camera.format()
    }

    /// How the camera's samples are encoded.
    pub fn encoding(&self) -> Encoding {
        self.devices.camera.encoding()
    }

    /// How the camera takes its frames.
    pub fn camera_timing(&self) -> CameraTiming {
        self.devices.camera.timing()
    }

    /// The measured times between flips, light and stamps.
    pub fn timing(&self) -> Timing {
        self.timing
    }

    /// Replaces the measured times between flips, light and stamps.
    pub fn set_timing(&mut self, timing: Timing) {
        self.timing = timing;
    }

    /// Delivers samples from this count on as samples at full scale: the camera clips there, or is not
    /// linear beyond. `None`: no others are.
    pub fn set_clipping(&mut self, from: Option<u16>) {
        let format = self.camera_format();
        self.devices.clipping = from.and_then(|from| Clipping::new(from, format));
    }

    /// Columns and rows of the rasters that [`Head::load`] takes.
    pub fn projector_size(&self) -> (u32, u32) {
        self.devices.projector.size()
    }

    /// Whether the projector's light may come seconds after the head was opened.
    pub fn starts_dark(&self) -> bool {
        self.devices.projector.starts_dark()
    }

    /// The time on the clock that the devices share.
    pub fn now(&self) -> Timestamp {
        self.devices.clock.now()
    }

    /// The temperature of the camera's sensor as of the last frame, °C; `None` if it does not say.
    pub fn camera_temperature_c(&self) -> Option<f64> {
        self.devices.camera.temperature_c()
    }

    /// What the projector's controller said of itself when it was last asked; `None` if there is
    /// none to ask.
    pub fn controller(&self) -> Option<ControllerState> {
        self.devices.projector.controller()
    }

    /// Time between two refreshes of the projector.
    pub fn refresh(&self) -> Duration {
        self.devices.projector.refresh()
    }

    /// Checks that camera and projector are still connected, without disturbing them.
    ///
    /// # Errors
    /// `Disconnected` for the first one that is gone.
    pub fn present(&self) -> Result<(), Error> {
        self.devices.camera.present()?;
        self.devices.projector.present()
    }

    /// Shows the patterns `indices` in this order, exposes one frame of each, and passes each frame
    /// to `sink` with its pattern's index as soon as it and all frames before it have arrived,
    /// stamped with the start of its exposure.
    ///
    /// A frame belongs to a pattern if its whole exposure lies within the pattern's time in view,
    /// by the times and counts of flips and frames and never by the order of arrival, and if no
    /// pulse of the trigger spoiled it. A pattern without such a frame is shown again. The sequence
    /// ends at the latest `timeout` after its planned end. However it ends, the projector is blank
    /// afterwards. The camera is stopped, unless it stays on ([`Camera::stays_on`]) and each
    /// trigger gave its frame. `sink` delays no flip: another thread serves the devices while
    /// `sink` runs.
    ///
    /// # Errors
    /// The first error of a device; `Protocol` if `indices` is empty or frames never fit their
    /// patterns; `Timeout` if the time is over, or flips or frames no longer arrive. `sink` has
    /// then received the frames before the failure.
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

    /// As [`Head::acquire`], but `sink` can end the sequence early by returning `false`.
    ///
    /// # Errors
    /// As [`Head::acquire`]; ending early is not an error.
    pub fn acquire_while(
        &mut self,
        indices: &[usize],
        timeout: Duration,
        sink: &mut dyn FnMut(usize, Frame) -> bool,
    ) -> Result<Exposure, Error> {
        if indices.is_empty() {
            return Err(Error::protocol(
                "acquiring a sequence of 0 patterns",
                "name at least one loaded pattern",
            ));
        }
        let Self {
            devices,
            timing,
            sequencer,
            go_on,
        } = self;
        let go_on = go_on.as_ref();
        let camera = devices.camera.timing();
        let pacing = Pacing::new(devices.projector.refresh(), &camera, timing);
        let planned = pacing.planned(indices.len()) + timeout;
        let start_of = |frame: &Frame| timing.exposure_start(&camera, frame.timestamp());
        devices.exposing(|devices, start_up| {
            sequencer.begin(pacing, indices, devices.clock.now() + planned);
            let served = if devices.clock.stands_still() {
                carry_out(devices, sequencer, timeout, &start_of, go_on, sink)
            } else {
                beside(devices, sequencer, timeout, &start_of, go_on, sink)
            };
            match served {
                Ok(so_far) => {
                    let exposure = Exposure { start_up, ..so_far };
                    Ok((Ok(exposure), sequencer.all_answered()))
                }
                Err(ended @ Error::Ended { .. }) => {
                    let triggered = camera.starts == Starts::OnTrigger;
                    Ok((Err(ended), triggered && sequencer.none_is_awaited()))
                }
                Err(error) => Err(error),
            }
        })?
    }

    /// The devices, for the contract checks and for [`Head::watch`].
    pub(crate) fn devices(&mut self) -> &mut Devices {
        &mut self.devices
    }
}

/// As [`carry_out`], in another thread, so that `sink` delays no flip.
fn beside(
    devices: &mut Devices,
    sequencer: &mut Sequencer,
    timeout: Duration,
    start_of: &(dyn Fn(&Frame) -> Timestamp + Sync),
    go_on: Option<&GoOn>,
    sink: &mut dyn FnMut(usize, Frame) -> bool,
) -> Result<Exposure, Error> {
    std::thread::scope(|scope| {
        let (frames, taken) = mpsc::channel();
        let served = scope.spawn(move || {
            let mut hand = |index, frame| frames.send((index, frame)).is_ok();
            carry_out(devices, sequencer, timeout, start_of, go_on, &mut hand)
        });
        for (index, frame) in taken {
            if !sink(index, frame) {
                break;
            }
        }
        served
            .join()
            .unwrap_or_else(|panic| std::panic::resume_unwind(panic))
    })
}

/// Passes events to the sequencer and does what it decides, until the sequence ends or `hand`
/// returns `false`.
fn carry_out(
    devices: &mut Devices,
    sequencer: &mut Sequencer,
    timeout: Duration,
    start_of: &(dyn Fn(&Frame) -> Timestamp + Sync),
    go_on: Option<&GoOn>,
    hand: &mut dyn FnMut(usize, Frame) -> bool,
) -> Result<Exposure, Error> {
    let Devices {
        camera,
        projector,
        trigger,
        clock,
        streaming,
        kept,
        clipping,
        ..
    } = devices;
    let refresh = projector.refresh();
    let timing = camera.timing();
    // Once it is to be ended: until when the frames of the triggers that have fired are waited for,
    // so that the camera can stay on.
    let mut ending: Option<Timestamp> = None;
    loop {
        while let Some(flip) = projector.poll_flip()? {
            sequencer.flipped(flip);
        }
        while let Some(frame) = camera.poll_frame()? {
            if !streaming.is_new(&frame) {
                continue;
            }
            let (start, count) = (start_of(&frame), frame.count());
            let frame = Clipping::marked(clipping, frame)?;
            sequencer.frame(frame.restamped(start, count));
        }
        // After the frames and before any decision: the pulse of a frame that has arrived has ended
        // and is known.
        while let Some(pulse) = trigger.poll_spoiled() {
            sequencer.spoiled(pulse);
        }
        let now = clock.now();
        if ending.is_none() && go_on.is_some_and(|go_on| !go_on()) {
            ending = Some(now + (timing.exposure + timing.delivery + refresh));
        }
        if let Some(end) = ending {
            if now >= end || sequencer.none_is_awaited() {
                return Err(Error::ended("acquiring a sequence"));
            }
            wait(&mut **clock, end);
            continue;
        }
        match sequencer.act(now) {
            Act::Queue(index) => projector.queue(*kept + index)?,
            Act::Fire => sequencer.fired(trigger.fire()?),
            Act::Hand(index, frame) => {
                if !hand(index, frame) {
                    return Ok(sequencer.so_far());
                }
            }
            Act::Wait(until) if go_on.is_some() => wait(&mut **clock, until.min(now + refresh)),
            Act::Wait(until) => wait(&mut **clock, until),
            Act::Done => return Ok(sequencer.so_far()),
            Act::Fail(failure) => return Err(failure.error(timeout)),
        }
    }
}

/// Waits for a flip or a frame, but not longer than the absence of a device may stay unnoticed.
fn wait(clock: &mut dyn Clock, until: Timestamp) {
    let soon = clock.now() + UNNOTICED;
    clock.wait(if clock.stands_still() {
        until
    } else {
        until.min(soon)
    });
}

#[cfg(test)]
mod tests;
