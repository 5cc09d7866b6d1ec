//! Camera, projector, trigger and clock around one scene, without hardware: what simulation and replay have in common.
//!
//! A back-end implements [`Scene`], which says what the camera sees of what the projector shows, and gets a head from [`head`].
//!
//! Nothing here waits in real time. The clock stands still between waits and jumps to the next thing that happens, at most to
//! the end of the wait. So a sequence has the times of a real head, at the speed of the computer, and the same every
//! time. Light is integrated over each exposure: a frame that straddles two patterns shows both.

mod cables;
mod camera;
mod faults;
mod light;
mod projector;
mod pulse;
mod timing;

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use crate::clock::Clock;
use crate::error::Error;
use crate::frame::{Frame, FrameFormat};
use crate::head::{DynHead, Head};
use crate::projector::Raster;
use crate::trigger::{Spoiled, Trigger};
use crate::units::Timestamp;
use cables::Line;
use camera::Sensor;
use faults::Dice;
pub use faults::Faults;
use light::Light;
use projector::Screen;
use pulse::Pulses;
pub use timing::Mechanics;

/// What the virtual devices look at.
pub trait Scene: Send {
    /// The format of every frame.
    fn format(&self) -> FrameFormat;

    /// Columns and rows of the projector.
    fn projector_size(&self) -> (u32, u32);

    /// Replaces the patterns, whose size has been checked.
    ///
    /// # Errors
    /// Where the scene cannot show them.
    fn load(&mut self, rasters: Vec<Raster>) -> Result<(), Error>;

    /// Patterns loaded.
    fn loaded(&self) -> usize;

    /// The frame of an exposure. `seen` says which patterns (or none) were in view, in turn, for which share of the planned
    /// exposure; it is not empty, and its shares sum to 1, or to more if the exposure lasted longer. `timestamp` and
    /// `sequence` are the frame's.
    ///
    /// # Errors
    /// Where the scene has no frame of that.
    fn expose(
        &mut self,
        seen: &[(Option<usize>, f32)],
        timestamp: Timestamp,
        sequence: u64,
    ) -> Result<Frame, Error>;
}

/// The scene and the state of the devices in front of it.
struct Bench<S> {
    scene: S,
    mechanics: Mechanics,
    dice: Dice,
    now: Timestamp,
    screen: Screen,
    light: Light,
    sensor: Sensor,
    pulses: Pulses,
    waits: u64,
    camera: Line,
    projector: Line,
}

/// One bench, shared by the devices and the [`Control`].
type Shared<S> = Arc<Mutex<Bench<S>>>;

/// Changes the scene of a virtual head and plugs its cables. Clones act on the same head.
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

    /// Opens the devices anew: a stopped camera and a blank projector.
    ///
    /// # Errors
    /// `Disconnected` if one of them is pulled out.
    pub fn reopen(&self) -> Result<DynHead, Error> {
        lock(&self.bench).reset()?;
        Ok(devices(&self.bench))
    }
}

/// A head in front of `scene` with these times and faults, and the control of it.
pub fn head<S: Scene + 'static>(scene: S, mechanics: Mechanics) -> (DynHead, Control<S>) {
    let bench = Arc::new(Mutex::new(Bench {
        scene,
        dice: Dice::new(mechanics.faults.seed),
        now: Timestamp(0),
        screen: Screen::default(),
        light: Light::new(),
        sensor: Sensor::new(),
        pulses: Pulses::new(),
        waits: 0,
        camera: Line::default(),
        projector: Line::default(),
        mechanics,
    }));
    let head = devices(&bench);
    (head, Control { bench })
}

/// The devices, opened as the cables are now.
fn devices<S: Scene + 'static>(bench: &Shared<S>) -> DynHead {
    let (camera, projector, timing) = {
        let bench = lock(bench);
        (
            bench.camera.pulled,
            bench.projector.pulled,
            bench.mechanics.calibrated(),
        )
    };
    let device = || {
        Box::new(Device {
            bench: Arc::clone(bench),
            camera,
            projector,
        })
    };
    Head::new(device(), device(), device(), device(), timing)
}

/// Locks a bench. A panic of another thread leaves no half-done state behind that would matter here.
fn lock<S>(bench: &Shared<S>) -> MutexGuard<'_, Bench<S>> {
    bench.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The bench seen as any of the devices, with the state of the cables when it was opened.
struct Device<S> {
    bench: Shared<S>,
    camera: u64,
    projector: u64,
}

impl<S: Scene> Clock for Device<S> {
    fn now(&self) -> Timestamp {
        lock(&self.bench).now
    }

    fn wait(&mut self, until: Timestamp) {
        let mut bench = lock(&self.bench);
        let bench = &mut *bench;
        let flip = bench.screen.next();
        let frame = bench.sensor.next(&bench.mechanics);
        let next = [flip, frame].into_iter().flatten();
        // What can be fetched already does not end a wait.
        let next = next
            .filter(|at| *at > bench.now)
            .fold(until, Timestamp::min);
        bench.waits += 1;
        let stall = bench.dice.up_to(
            faults::Kind::Stall,
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

impl<S: Scene> Trigger for Device<S> {
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
