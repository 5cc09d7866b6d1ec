//! A virtual head: camera, projector, trigger and clock around one scene, without hardware; the
//! common part of simulation and replay.
//!
//! A back-end implements [`Scene`], which computes the camera's frames from the patterns in view,
//! and gets a head from [`head`].
//!
//! Nothing here waits in real time. The clock stands still between waits, and a wait sets it to the
//! next event, at most to the end of the wait. So a sequence has the times of a real head, runs as
//! fast as the computer can, and is the same every time. Light is integrated over each exposure: a
//! frame that straddles two patterns shows both.

mod camera;
mod mechanics;
mod projector;

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use crate::clock::Clock;
use crate::error::{DeviceKind, Error};
use crate::frame::{Frame, FrameFormat};
use crate::head::Head;
use crate::projector::Raster;
use crate::trigger::{Edges, Spoiled, SpoiledPulses, Trigger, keep_latest};
use crate::units::Timestamp;
use camera::Sensor;
use mechanics::{Dice, Mishap};
pub use mechanics::{Faults, FreeRunning, Mechanics};
use projector::{LightHistory, Screen};

/// What was in view for a part of an exposure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InView {
    /// The pattern, or none.
    pub pattern: Option<usize>,
    /// How long, as a share of the exposure that the camera is set to.
    pub share: f32,
}

/// What the virtual devices look at.
pub trait Scene: Send {
    /// The format of every frame.
    fn format(&self) -> FrameFormat;

    /// How the camera's samples are encoded, where they are exact.
    fn encoding(&self) -> &'static str {
        "RAW"
    }

    /// Columns and rows of the projector.
    fn projector_size(&self) -> (u32, u32);

    /// Replaces the patterns behind the first `kept`, which are loaded; the size of the rasters has
    /// been checked.
    ///
    /// # Errors
    /// If the scene cannot show them.
    fn load(&mut self, kept: usize, rasters: Vec<Raster>) -> Result<(), Error>;

    /// Patterns loaded.
    fn loaded(&self) -> usize;

    /// The frame of an exposure. `seen` lists what was in view, in order; it is not empty, and its
    /// shares sum to 1, or to more if the exposure lasted longer. `timestamp` and `count` are the
    /// frame's.
    ///
    /// # Errors
    /// If the scene has no frame for this.
    fn expose(&mut self, seen: &[InView], timestamp: Timestamp, count: u64)
    -> Result<Frame, Error>;
}

/// The cable of one device.
#[derive(Clone, Copy, Default, PartialEq, Eq)]
struct Cable {
    out: bool,
    /// How often it was pulled out. A device that was opened before the last time fails for ever.
    pulled: u64,
}

/// The cables by [`DeviceKind`]. That of the GPIO chip has no effect, because the virtual trigger
/// has none.
type Cables = [Cable; 3];

/// The scene and the state of the devices in front of it.
struct Bench<S> {
    scene: S,
    /// The times of the devices; exposure and period are those of so many [`Bench::exposures`].
    mechanics: Mechanics,
    exposures: u32,
    dice: Dice,
    now: Timestamp,
    screen: Screen,
    light: LightHistory,
    /// The projector is dark before this.
    first_light: Timestamp,
    sensor: Sensor,
    pulses: Pulses,
    waits: u64,
    cables: Cables,
}

impl<S: Scene> Bench<S> {
    /// Stops the camera and blanks the projector, if both are plugged in.
    fn reset(&mut self) -> Result<(), Error> {
        for device in [DeviceKind::Camera, DeviceKind::Projector] {
            if self.cables[device as usize].out {
                let attempt = format!("opening the {}", device.word());
                return Err(Error::disconnected(device, attempt));
            }
        }
        self.sensor.stop();
        self.expose(1);
        self.blank();
        self.first_light = self.now + self.mechanics.first_light;
        Ok(())
    }
}

/// One bench, shared by the devices and the [`Control`].
type Shared<S> = Arc<Mutex<Bench<S>>>;

/// Changes the scene of a virtual head, and plugs and unplugs its devices. Clones act on the same
/// head.
pub struct Control<S> {
    bench: Shared<S>,
}

impl<S> Clone for Control<S> {
    fn clone(&self) -> Self {
        Self {
            bench: Arc::clone(&self.bench),
        }
    }
}

impl<S: Scene + 'static> Control<S> {
    /// Calls `act` with the scene; no device is used meanwhile.
    pub fn scene<R>(&self, act: impl FnOnce(&mut S) -> R) -> R {
        act(&mut lock(&self.bench).scene)
    }

    /// The exposure that the camera is set to.
    #[must_use]
    pub fn exposure(&self) -> Duration {
        lock(&self.bench).own_exposure()
    }

    /// Replaces the exposure that the camera is set to; how much brighter frames are then, the
    /// owner of the scene tells the scene.
    pub fn set_exposure(&self, exposure: Duration) {
        let mut bench = lock(&self.bench);
        bench.mechanics.exposure = exposure * bench.exposures;
    }

    /// Plugs a device in, or unplugs it. A device that was opened before it was unplugged keeps
    /// failing.
    pub fn plug(&self, device: DeviceKind, plugged: bool) {
        let cable = &mut lock(&self.bench).cables[device as usize];
        cable.pulled += u64::from(!plugged);
        cable.out = !plugged;
    }

    /// Opens the devices again: a stopped camera and a blank projector.
    ///
    /// # Errors
    /// `Disconnected` if one of them is unplugged.
    pub fn reopen(&self) -> Result<Head, Error> {
        lock(&self.bench).reset()?;
        Ok(devices(&self.bench))
    }
}

/// A head in front of `scene` with these times and faults, and the control of it.
pub fn head<S: Scene + 'static>(scene: S, mechanics: Mechanics) -> (Head, Control<S>) {
    let bench = Arc::new(Mutex::new(Bench {
        scene,
        dice: Dice::new(mechanics.faults.seed),
        now: Timestamp(0),
        screen: Screen::default(),
        light: LightHistory::new(),
        first_light: Timestamp(0) + mechanics.first_light,
        sensor: Sensor::default(),
        pulses: Pulses::default(),
        waits: 0,
        cables: Cables::default(),
        exposures: 1,
        mechanics,
    }));
    let head = devices(&bench);
    (head, Control { bench })
}

/// A head of the devices, opened with the cables in their present state.
fn devices<S: Scene + 'static>(bench: &Shared<S>) -> Head {
    let (opened, timing) = {
        let bench = lock(bench);
        (bench.cables, bench.mechanics.calibrated())
    };
    let device = || {
        Box::new(VirtualDevice {
            bench: Arc::clone(bench),
            opened,
        })
    };
    Head::new(device(), device(), device(), device(), timing)
}

/// Locks a bench. A lock that is poisoned by a panic is used all the same.
fn lock<S>(bench: &Shared<S>) -> MutexGuard<'_, Bench<S>> {
    bench.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Any of the devices of the bench, with the state of the cables when it was opened.
struct VirtualDevice<S> {
    bench: Shared<S>,
    opened: Cables,
}

impl<S> VirtualDevice<S> {
    /// The bench, if `device` was not unplugged since it was opened.
    fn plugged(
        &self,
        device: DeviceKind,
        attempt: &str,
    ) -> Result<MutexGuard<'_, Bench<S>>, Error> {
        let bench = lock(&self.bench);
        let at = device as usize;
        match bench.cables[at] == self.opened[at] {
            true => Ok(bench),
            false => Err(Error::disconnected(device, attempt)),
        }
    }
}

impl<S: Scene> Clock for VirtualDevice<S> {
    fn now(&self) -> Timestamp {
        lock(&self.bench).now
    }

    fn wait(&mut self, until: Timestamp) {
        let mut bench = lock(&self.bench);
        let bench = &mut *bench;
        let flip = bench.screen.next();
        let frame = bench.sensor.next(&bench.mechanics);
        let next = [flip, frame].into_iter().flatten();
        // A flip or frame that could be fetched already does not end a wait.
        let next = next
            .filter(|at| *at > bench.now)
            .fold(until, Timestamp::min);
        bench.waits += 1;
        let stall = bench.dice.up_to(
            Mishap::Stall,
            bench.waits,
            bench.mechanics.faults.stall,
            Duration::from_micros(bench.mechanics.faults.stall_us),
        );
        bench.now = bench.now.max(next) + stall;
    }

    fn stands_still(&self) -> bool {
        true
    }
}

/// The pulses of the trigger, each as long as the exposure that it starts, and reports of those that
/// last too long.
#[derive(Default)]
struct Pulses {
    begun: u64,
    /// The end of the latest pulse that lasts too long. All other pulses end before the camera can
    /// take the next one.
    on_until: Timestamp,
    /// Spoiled pulses that were not fetched yet.
    spoiled: SpoiledPulses,
}

impl Pulses {
    /// Begins a pulse and returns how long it will last; none if one is still on.
    fn begin(&mut self, now: Timestamp, mechanics: &Mechanics, dice: Dice) -> Option<Duration> {
        if now < self.on_until {
            return None;
        }
        self.begun += 1;
        let faults = &mechanics.faults;
        let longest = Duration::from_micros(faults.long_pulse_us);
        let longer = dice.up_to(Mishap::LongPulse, self.begun, faults.long_pulse, longest);
        if longer.is_zero() {
            return Some(mechanics.exposure);
        }
        let end = now + (mechanics.exposure + longer);
        self.on_until = end;
        let edges = Edges {
            rise: (now, now),
            fall: (end, end),
        };
        if let Some(spoiled) = Spoiled::by(&edges, mechanics.exposure) {
            keep_latest(&mut self.spoiled, spoiled);
        }
        Some(mechanics.exposure + longer)
    }

    /// The next spoiled pulse that has ended.
    fn poll(&mut self, now: Timestamp) -> Option<Spoiled> {
        self.spoiled.pop_front_if(|pulse| pulse.ended() <= now)
    }
}

impl<S: Scene> Trigger for VirtualDevice<S> {
    fn fire(&mut self) -> Result<Timestamp, Error> {
        let mut bench = lock(&self.bench);
        let bench = &mut *bench;
        let (now, mechanics, dice) = (bench.now, &bench.mechanics, bench.dice);
        if let Some(length) = bench.pulses.begin(now, mechanics, dice) {
            bench.sensor.fire(now, length, mechanics, dice);
        }
        Ok(now)
    }

    fn poll_spoiled(&mut self) -> Option<Spoiled> {
        let mut bench = lock(&self.bench);
        let now = bench.now;
        bench.pulses.poll(now)
    }
}
