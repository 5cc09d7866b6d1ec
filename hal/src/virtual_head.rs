//! Camera, projector and trigger that share one scene and a virtual clock: what simulation and replay have in common.
//!
//! Nothing here waits in real time. The clock stands still between calls and is moved forward by the calls
//! that would wait: `show` to the next refresh of the projector, `fire` to the end of the exposure before,
//! `next_frame` to the end of its exposure, each at most by its time-out. So a sequence has the timestamps of a
//! real head that is triggered right after each flip, at the speed of the computer, and the same every time.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use crate::camera::Camera;
use crate::error::{self, Error};
use crate::frame::{Frame, FrameFormat};
use crate::head::{DynHead, Head};
use crate::projector::{Flip, Projector, Raster};
use crate::trigger::Trigger;
use crate::units::Timestamp;

/// Exposures that wait to be fetched; when one more comes the oldest is lost, as in a real driver.
const MAX_PENDING: usize = 4;
/// A digital micromirror device makes grey levels over whole refreshes, so an exposure is a whole number of them.
const REFRESHES_PER_EXPOSURE: u32 = 2;

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

    /// The frame of an exposure that starts at `timestamp` with pattern `shown` (or none) in view.
    fn expose(
        &mut self,
        shown: Option<usize>,
        timestamp: Timestamp,
        sequence: u64,
    ) -> Result<Frame, Error>;
}

/// The scene and the state of the three devices in front of it.
pub(crate) struct Bench<S> {
    pub scene: S,
    refresh: Duration,
    now: Timestamp,
    flips: u64,
    shown: Option<usize>,
    armed: bool,
    /// End of the latest exposure; the next cannot start before.
    busy_until: Timestamp,
    exposures: u64,
    pending: VecDeque<Frame>,
    camera: Line,
    projector: Line,
}

/// The cable of one device.
#[derive(Clone, Copy, Default)]
struct Line {
    out: bool,
    /// How often it was pulled out. Devices that were opened before the last time are dead for ever.
    pulled: u64,
}

impl Line {
    fn check(
        self,
        device: error::Device,
        opened: u64,
        attempt: impl FnOnce() -> String,
    ) -> Result<(), Error> {
        if self.out || self.pulled != opened {
            return Err(Error::disconnected(device, attempt()));
        }
        Ok(())
    }
}

/// One bench, shared by the three devices (and whoever changes the scene).
pub(crate) type Shared<S> = Arc<Mutex<Bench<S>>>;

/// The devices of a bench with a projector of this refresh period.
pub(crate) fn head<S: Scene + 'static>(scene: S, refresh: Duration) -> (DynHead, Shared<S>) {
    let bench = Arc::new(Mutex::new(Bench {
        scene,
        refresh,
        now: Timestamp(0),
        flips: 0,
        shown: None,
        armed: false,
        busy_until: Timestamp(0),
        exposures: 0,
        pending: VecDeque::with_capacity(MAX_PENDING),
        camera: Line::default(),
        projector: Line::default(),
    }));
    let head = devices(&bench);
    (head, bench)
}

/// The three devices, opened as the cables are now.
fn devices<S: Scene + 'static>(bench: &Shared<S>) -> DynHead {
    let (camera, projector) = {
        let bench = lock(bench);
        (bench.camera.pulled, bench.projector.pulled)
    };
    let device = || {
        Box::new(Device {
            bench: Arc::clone(bench),
            camera,
            projector,
        })
    };
    Head::new(device(), device(), device())
}

/// Opens the devices of a bench anew: a stopped camera and a blank projector.
///
/// # Errors
/// `Disconnected` if one of them is pulled out.
pub(crate) fn reopen<S: Scene + 'static>(bench: &Shared<S>) -> Result<DynHead, Error> {
    {
        let mut bench = lock(bench);
        for (line, device) in [
            (bench.camera, error::Device::Camera),
            (bench.projector, error::Device::Projector),
        ] {
            line.check(device, line.pulled, || {
                format!("opening the {}", device.word())
            })?;
        }
        bench.armed = false;
        bench.shown = None;
        bench.pending.clear();
    }
    Ok(devices(bench))
}

/// Locks a bench. A panic of another thread leaves no half-done state behind that would matter here.
pub(crate) fn lock<S>(bench: &Shared<S>) -> MutexGuard<'_, Bench<S>> {
    bench.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The bench seen as any of the three devices, with the state of the cables when it was opened.
struct Device<S> {
    bench: Shared<S>,
    camera: u64,
    projector: u64,
}

impl<S> Device<S> {
    /// The bench, if the camera is the one that was opened.
    fn as_camera(&self, attempt: &str) -> Result<MutexGuard<'_, Bench<S>>, Error> {
        let bench = lock(&self.bench);
        bench
            .camera
            .check(error::Device::Camera, self.camera, || attempt.to_owned())?;
        Ok(bench)
    }

    /// The bench, if the projector is the one that was opened.
    fn as_projector(&self, attempt: &str) -> Result<MutexGuard<'_, Bench<S>>, Error> {
        let bench = lock(&self.bench);
        bench
            .projector
            .check(error::Device::Projector, self.projector, || {
                attempt.to_owned()
            })?;
        Ok(bench)
    }
}

impl<S> Bench<S> {
    /// Pulls a device's cable out, or puts it back. What was opened before stays dead.
    pub fn plug(&mut self, device: error::Device, into: bool) {
        let line = match device {
            error::Device::Camera => &mut self.camera,
            error::Device::Projector => &mut self.projector,
        };
        line.pulled += u64::from(!into);
        line.out = !into;
    }
}

impl<S: Scene> Bench<S> {
    fn exposure(&self) -> Duration {
        self.refresh * REFRESHES_PER_EXPOSURE
    }

    /// Moves the clock to `until`, or by `timeout` and says that this was not enough.
    fn wait(
        &mut self,
        until: Timestamp,
        timeout: Duration,
        attempt: impl FnOnce() -> String,
    ) -> Result<(), Error> {
        if until > self.now + timeout {
            self.now = self.now + timeout;
            return Err(Error::timeout(
                attempt(),
                timeout,
                format!(
                    "allow at least {} ms",
                    until.since(self.now).as_secs_f64() * 1e3
                ),
            ));
        }
        self.now = self.now.max(until);
        Ok(())
    }
}

impl<S: Scene> Camera for Device<S> {
    fn format(&self) -> FrameFormat {
        lock(&self.bench).scene.format()
    }

    fn present(&self) -> Result<(), Error> {
        self.as_camera("looking for the camera").map(|_| ())
    }

    fn start(&mut self) -> Result<(), Error> {
        let mut bench = self.as_camera("starting the camera")?;
        if bench.armed {
            return Err(Error::protocol(
                "starting a camera that is running",
                "stop it first",
            ));
        }
        bench.armed = true;
        Ok(())
    }

    fn next_frame(&mut self, timeout: Duration) -> Result<Frame, Error> {
        let mut bench = self.as_camera("waiting for a frame")?;
        if !bench.armed {
            return Err(Error::protocol(
                "waiting for a frame of a stopped camera",
                "start it first",
            ));
        }
        let Some(frame) = bench.pending.front().cloned() else {
            bench.now = bench.now + timeout;
            return Err(Error::timeout(
                "waiting for a frame",
                timeout,
                "trigger an exposure first",
            ));
        };
        let ready = frame.timestamp() + bench.exposure();
        bench.wait(ready, timeout, || {
            format!("waiting for frame {}", frame.sequence())
        })?;
        bench.pending.pop_front();
        Ok(frame)
    }

    fn stop(&mut self) -> Result<(), Error> {
        let mut bench = self.as_camera("stopping the camera")?;
        bench.armed = false;
        bench.pending.clear();
        Ok(())
    }
}

impl<S: Scene> Projector for Device<S> {
    fn size(&self) -> (u32, u32) {
        lock(&self.bench).scene.projector_size()
    }

    fn refresh(&self) -> Duration {
        lock(&self.bench).refresh
    }

    fn present(&self) -> Result<(), Error> {
        self.as_projector("looking for the projector").map(|_| ())
    }

    fn load(&mut self, rasters: Vec<Raster>) -> Result<(), Error> {
        let mut bench = self.as_projector("loading patterns")?;
        let (width, height) = bench.scene.projector_size();
        for (index, raster) in rasters.iter().enumerate() {
            if (raster.width(), raster.height()) != (width, height) {
                return Err(Error::unsupported(
                    format!(
                        "loading raster {index} of {}×{}",
                        raster.width(),
                        raster.height()
                    ),
                    format!("make it {width}×{height}, the projector's size"),
                ));
            }
        }
        bench.shown = None;
        bench.scene.load(rasters)
    }

    fn show(&mut self, index: usize, timeout: Duration) -> Result<Flip, Error> {
        let mut bench = self.as_projector("showing a pattern")?;
        let loaded = bench.scene.loaded();
        if index >= loaded {
            return Err(Error::protocol(
                format!("showing pattern {index} of {loaded} loaded (counted from 0)"),
                "load the patterns first",
            ));
        }
        let period = u64::try_from(bench.refresh.as_nanos())
            .unwrap_or(u64::MAX)
            .max(1);
        let next_refresh = Timestamp((bench.now.0 / period + 1).saturating_mul(period));
        bench.wait(next_refresh, timeout, || format!("showing pattern {index}"))?;
        bench.shown = Some(index);
        bench.flips += 1;
        Ok(Flip {
            timestamp: next_refresh,
            sequence: bench.flips,
        })
    }

    fn blank(&mut self) -> Result<(), Error> {
        self.as_projector("blanking the projector")?.shown = None;
        Ok(())
    }
}

impl<S: Scene> Trigger for Device<S> {
    fn fire(&mut self, timeout: Duration) -> Result<Timestamp, Error> {
        let mut bench = lock(&self.bench);
        let free = bench.busy_until;
        bench.wait(free, timeout, || "starting an exposure".to_owned())?;
        let start = bench.now;
        if bench.armed {
            let (shown, sequence) = (bench.shown, bench.exposures);
            let frame = bench.scene.expose(shown, start, sequence)?;
            bench.exposures += 1;
            bench.busy_until = start + bench.exposure();
            if bench.pending.len() == MAX_PENDING {
                bench.pending.pop_front();
            }
            bench.pending.push_back(frame);
        }
        Ok(start)
    }
}
