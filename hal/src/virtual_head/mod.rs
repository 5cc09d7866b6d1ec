//! Camera, projector, trigger and clock around one scene: what simulation and replay have in common.
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
pub(crate) use timing::Mechanics;

/// What the virtual devices look at.
pub(crate) trait Scene: Send {
    /// The format of every frame.
    fn format(&self) -> FrameFormat;

    /// Columns and rows of the projector.
    fn projector_size(&self) -> (u32, u32);

    /// Replaces the patterns, whose size has been checked.
    fn load(&mut self, rasters: Vec<Raster>) -> Result<(), Error>;

    /// Patterns loaded.
    fn loaded(&self) -> usize;

    /// The frame of an exposure. `seen` says which patterns (or none) were in view, in turn, for which share of the planned
    /// exposure; it is not empty, and its shares sum to 1, or to more if the exposure lasted longer. `timestamp` and
    /// `sequence` are the frame's.
    fn expose(
        &mut self,
        seen: &[(Option<usize>, f32)],
        timestamp: Timestamp,
        sequence: u64,
    ) -> Result<Frame, Error>;
}

/// The scene and the state of the devices in front of it.
pub(crate) struct Bench<S> {
    pub scene: S,
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

/// One bench, shared by the devices (and whoever changes the scene).
pub(crate) type Shared<S> = Arc<Mutex<Bench<S>>>;

/// The devices of a bench whose time goes like this.
pub(crate) fn head<S: Scene + 'static>(scene: S, mechanics: Mechanics) -> (DynHead, Shared<S>) {
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
    (head, bench)
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

/// Opens the devices of a bench anew: a stopped camera and a blank projector.
///
/// # Errors
/// `Disconnected` if one of them is pulled out.
pub(crate) fn reopen<S: Scene + 'static>(bench: &Shared<S>) -> Result<DynHead, Error> {
    lock(bench).reset()?;
    Ok(devices(bench))
}

/// Locks a bench. A panic of another thread leaves no half-done state behind that would matter here.
pub(crate) fn lock<S>(bench: &Shared<S>) -> MutexGuard<'_, Bench<S>> {
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
