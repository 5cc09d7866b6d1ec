//! The virtual camera: exposures start by trigger or by themselves, and their frames arrive after
//! the readout.
//!
//! A frame is computed when it is fetched, so a frame that is not fetched costs no time and uses no
//! random numbers.

use std::collections::VecDeque;
use std::time::Duration;

use super::mechanics::{Dice, FreeRunning, Mechanics, Mishap};
use super::{Bench, Scene, VirtualDevice, lock};
use crate::camera::{Camera, CameraTiming, Encoding, Starts};
use crate::error::{DeviceKind, Error};
use crate::frame::{Frame, FrameFormat};
use crate::head::Stamp;
use crate::units::Timestamp;

/// Most frames that wait to be fetched; when one more arrives, the oldest is lost, as in a real
/// driver.
const MAX_WAITING: usize = 4;
const DEVICE: DeviceKind = DeviceKind::Camera;

/// The exposures of a camera.
#[derive(Default)]
pub(super) struct Sensor {
    armed: bool,
    /// A triggered camera ignores triggers before this.
    busy_until: Timestamp,
    /// When a camera that runs by itself was started, and its exposures since.
    started: Timestamp,
    since: u64,
    count: u64,
    /// When the copying of the latest frame ends.
    copied: Timestamp,
    /// The exposures in the order in which their frames arrive.
    exposures: VecDeque<PendingExposure>,
    /// The last frame, if it is to arrive a second time.
    again: Option<Frame>,
}

#[derive(Clone, Copy)]
struct PendingExposure {
    start: Timestamp,
    length: Duration,
    count: u64,
    ready: Timestamp,
    twice: bool,
}

impl Sensor {
    pub fn stop(&mut self) {
        self.armed = false;
        self.exposures.clear();
        self.again = None;
    }

    /// Receives a trigger pulse of this length. It is lost on an open wire, and if the camera is
    /// stopped or busy.
    pub fn fire(&mut self, now: Timestamp, length: Duration, mechanics: &Mechanics, dice: Dice) {
        let faults = &mechanics.faults;
        let lost = !self.armed
            || mechanics.camera().starts != Starts::OnTrigger
            || now < self.busy_until
            || faults.wire_open
            || dice.happens(Mishap::LostTrigger, self.count ^ now.0, faults.lost_trigger);
        if lost {
            return;
        }
        let jitter = Duration::from_micros(faults.trigger_jitter_us);
        let start = now + dice.up_to(Mishap::TriggerJitter, self.count, 1.0, jitter);
        let longer = length.saturating_sub(mechanics.exposure);
        self.busy_until = now + (mechanics.camera().period + mechanics.dead + longer);
        self.expose(start, length, mechanics, dice);
    }

    fn expose(&mut self, start: Timestamp, length: Duration, mechanics: &Mechanics, dice: Dice) {
        let faults = &mechanics.faults;
        let n = self.count;
        if faults.frames_until_stuck > 0 && n >= faults.frames_until_stuck {
            return;
        }
        self.count += 1;
        if dice.happens(Mishap::Dropped, n, faults.dropped) {
            return;
        }
        let late = Duration::from_micros(faults.late_frame_us);
        let late = dice.up_to(Mishap::LateFrame, n, faults.late_frame, late);
        let mut ready = start + (length + mechanics.readout + late);
        if dice.happens(Mishap::Swapped, n, faults.swapped) {
            ready = ready + (mechanics.camera().period + mechanics.exposure / 4);
        }
        if !mechanics.copy.is_zero() {
            ready = ready.max(self.copied) + mechanics.copy;
            self.copied = ready;
        }
        let exposure = PendingExposure {
            start,
            length,
            count: n,
            ready,
            twice: dice.happens(Mishap::Duplicated, n, faults.duplicated),
        };
        let place = self
            .exposures
            .iter()
            .take_while(|pending| pending.ready <= ready)
            .count();
        self.exposures.insert(place, exposure);
    }

    /// The start of the next exposure of a camera that runs by itself, or that the projector
    /// triggers.
    fn next_start(&self, mechanics: &Mechanics) -> Option<Timestamp> {
        if self.armed && mechanics.by_projector {
            let refresh = u64::try_from(mechanics.refresh.as_nanos()).unwrap_or(u64::MAX);
            let lag = mechanics.flip_to_light.as_nanos() as u64 % refresh.max(1);
            let ready = self.started.max(self.busy_until).0.saturating_sub(lag);
            let start = ready.div_ceil(refresh.max(1)).saturating_mul(refresh);
            return Some(Timestamp(start.saturating_add(lag)));
        }
        let FreeRunning { period, phase } = mechanics.free_running.filter(|_| self.armed)?;
        let drifted =
            period.as_nanos() as f64 * (1.0 + f64::from(mechanics.faults.drift_ppm) * 1e-6);
        Some(self.started + phase + Duration::from_nanos((drifted * self.since as f64) as u64))
    }

    /// Makes the exposures until `now` of a camera that runs by itself.
    fn run(&mut self, now: Timestamp, mechanics: &Mechanics, dice: Dice) {
        let jitter = Duration::from_micros(mechanics.faults.trigger_jitter_us);
        while let Some(start) = self
            .next_start(mechanics)
            .filter(|start| *start + jitter <= now)
        {
            self.since += 1;
            let off = dice.up_to(Mishap::TriggerJitter, self.count, 1.0, jitter);
            self.expose(start + off, mechanics.exposure, mechanics, dice);
            let busy = mechanics.exposure + mechanics.readout + mechanics.dead;
            self.busy_until = start + off + busy;
        }
        // Frames that were not fetched in time are lost.
        while self.exposures.len() > MAX_WAITING && self.exposures[MAX_WAITING].ready <= now {
            self.exposures.pop_front();
        }
    }

    /// When the next frame can be fetched, or the next exposure starts.
    pub fn next(&self, mechanics: &Mechanics) -> Option<Timestamp> {
        let jitter = Duration::from_micros(mechanics.faults.trigger_jitter_us);
        let start = self.next_start(mechanics).map(|start| start + jitter);
        let frame = self.exposures.front().map(|exposure| exposure.ready);
        [start, frame].into_iter().flatten().min()
    }

    /// The start of the oldest exposure whose light may still be computed.
    pub fn oldest(&self, now: Timestamp, mechanics: &Mechanics) -> Timestamp {
        let starts = self.exposures.iter().map(|exposure| exposure.start);
        starts
            .chain(self.next_start(mechanics))
            .fold(now, Timestamp::min)
    }
}

impl<S: Scene> Bench<S> {
    /// The exposure that the camera is set to.
    pub fn own_exposure(&self) -> Duration {
        self.mechanics.exposure / self.exposures
    }

    /// Makes each exposure so many times as long as set.
    pub fn expose(&mut self, times: u32) {
        let own = self.own_exposure();
        let before = std::mem::replace(&mut self.mechanics.exposure, own * times);
        if let Some(camera) = &mut self.mechanics.free_running {
            camera.period = camera.period + own * times - before;
        }
        self.exposures = times;
    }

    fn frame(&mut self) -> Result<Option<Frame>, Error> {
        self.sensor.run(self.now, &self.mechanics, self.dice);
        if let Some(frame) = self.sensor.again.take() {
            return Ok(Some(frame));
        }
        let ready = |exposure: &mut PendingExposure| exposure.ready <= self.now;
        let Some(exposure) = self.sensor.exposures.pop_front_if(ready) else {
            return Ok(None);
        };
        let mechanics = &self.mechanics;
        let (start, length) = (exposure.start, exposure.length);
        let end = start + length;
        let seen = self
            .light
            .seen(start, length, mechanics.exposure / self.exposures);
        let marked = match mechanics.stamp {
            Stamp::ExposureStart => start,
            Stamp::ExposureEnd => end,
            Stamp::ReadoutEnd => end + mechanics.readout,
        };
        let jitter = Duration::from_micros(mechanics.faults.stamp_jitter_us);
        let off = self
            .dice
            .up_to(Mishap::StampJitter, exposure.count, 1.0, 2 * jitter);
        let frame = self.scene.expose(
            seen,
            marked + (mechanics.stamp_late + off) - jitter,
            exposure.count,
        )?;
        if exposure.twice {
            self.sensor.again = Some(frame.clone());
        }
        Ok(Some(frame))
    }
}

impl<S: Scene> Camera for VirtualDevice<S> {
    fn format(&self) -> FrameFormat {
        lock(&self.bench).scene.format()
    }

    fn encoding(&self) -> Encoding {
        let bench = lock(&self.bench);
        bench.mechanics.encoding(bench.scene.encoding())
    }

    fn timing(&self) -> CameraTiming {
        lock(&self.bench).mechanics.camera()
    }

    fn expose(&mut self, times: u32) -> Result<(), Error> {
        lock(&self.bench).expose(times);
        Ok(())
    }

    fn stays_on(&self) -> Duration {
        let mechanics = &lock(&self.bench).mechanics;
        match mechanics.camera().starts {
            Starts::OnTrigger => mechanics.stays_on,
            Starts::ByProjector | Starts::ByItself => Duration::ZERO,
        }
    }

    fn present(&self) -> Result<(), Error> {
        self.plugged(DEVICE, "looking for the camera").map(|_| ())
    }

    fn start(&mut self) -> Result<(), Error> {
        let mut bench = self.plugged(DEVICE, "starting the camera")?;
        if bench.sensor.armed {
            return Err(Error::protocol(
                "starting a camera that is running",
                "stop it first",
            ));
        }
        bench.sensor.armed = true;
        bench.now = bench.now + bench.mechanics.start_up;
        (bench.sensor.started, bench.sensor.since) = (bench.now, 0);
        Ok(())
    }

    fn poll_frame(&mut self) -> Result<Option<Frame>, Error> {
        let mut bench = self.plugged(DEVICE, "waiting for a frame")?;
        if !bench.sensor.armed {
            return Err(Error::protocol(
                "waiting for a frame of a stopped camera",
                "start it first",
            ));
        }
        bench.frame()
    }

    fn stop(&mut self) -> Result<(), Error> {
        self.plugged(DEVICE, "stopping the camera")?.sensor.stop();
        Ok(())
    }
}
