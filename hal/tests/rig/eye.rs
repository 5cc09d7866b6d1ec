//! A camera for the virtual display: it exposes when the wire goes high, or by itself, and its
//! frames state which pattern was really in view.
//!
//! It knows what was in view from the kernel alone: the count of refreshes when an exposure begins
//! and ends, and the checksum of what the display showed in each refresh. It shares no code with
//! the back-ends that show, count and trigger.

use std::collections::HashMap;
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::{JoinHandle, sleep, spawn};
use std::time::Duration;

use drm::{Device, VblankWaitFlags, VblankWaitTarget};
use hal::camera::{Camera, CameraTiming, Encoding, Starts};
use hal::clock::monotonic;
use hal::error::Error;
use hal::frame::{Frame, FrameFormat, Pixels};
use hal::head::TOLERANCE;
use hal::units::Timestamp;
use rustix::io::{read, write};
use rustix::pipe::{PipeFlags, pipe_with};

use crate::chip::Wire;
use crate::crc::Checksums;

/// The sample of a frame during which more than one picture was in view.
pub const MIXED: u8 = 255;
/// The sample of a frame whose picture is none of the patterns.
pub const NO_PATTERN: u8 = 254;

/// How often the wire is polled; often enough to be in time for the end of an exposure, mostly.
const LOOK: Duration = Duration::from_micros(500);
/// Shorter than a refresh, with time left for system calls.
const EXPOSURE: Duration = Duration::from_millis(10);
/// A little less than two refreshes, so that a triggered camera keeps up with every second one.
const PERIOD: Duration = Duration::from_millis(30);
/// From the end of an exposure to its frame: longer than the display takes for a checksum.
const READOUT: Duration = Duration::from_millis(8);

/// The display's count of refreshes, from the kernel.
struct Refreshes(OwnedFd);

impl AsFd for Refreshes {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.0.as_fd()
    }
}

impl Device for Refreshes {}

impl Refreshes {
    /// The count at a time in the recent past.
    fn at(&self, time: Timestamp, period: Duration) -> u64 {
        let newest = self.wait_vblank(
            VblankWaitTarget::Relative(0),
            VblankWaitFlags::empty(),
            0,
            0,
        );
        let newest = newest.unwrap();
        let after = (Timestamp(0) + newest.time().unwrap()).since(time);
        u64::from(newest.frame()) - after.as_nanos().div_ceil(period.as_nanos()) as u64
    }
}

/// The display that the camera looks at, and the wire that triggers it.
pub struct View {
    /// A descriptor of the display's card.
    pub display: OwnedFd,
    /// The pattern with each checksum.
    pub patterns: HashMap<u32, u8>,
    /// Time between its refreshes.
    pub refresh: Duration,
    /// Refreshes from a flip to its light.
    pub lag: u64,
    /// The wire; none = the camera runs by itself.
    pub wire: Option<Wire>,
}

/// The camera; its sensor is a thread.
pub struct Eye {
    starts: Starts,
    armed: Arc<AtomicBool>,
    /// How often it was started; frames of an earlier start are discarded.
    start: Arc<AtomicU64>,
    frames: Receiver<Frame>,
    news: OwnedFd,
    over: Arc<AtomicBool>,
    sensor: Option<JoinHandle<()>>,
}

impl Eye {
    pub fn new(view: View) -> Self {
        let (armed, start, over) = (Arc::default(), Arc::default(), Arc::default());
        let (send, frames) = channel();
        let (news, tell) = pipe_with(PipeFlags::NONBLOCK).unwrap();
        let sensor = Sensor {
            armed: Arc::clone(&armed),
            start: Arc::clone(&start),
            over: Arc::clone(&over),
            refreshes: Refreshes(view.display.try_clone().unwrap()),
            checksums: (!view.patterns.is_empty()).then(Checksums::record),
            send,
            tell,
            count: 0,
            view,
        };
        Self {
            starts: if sensor.view.wire.is_some() {
                Starts::OnTrigger
            } else {
                Starts::ByItself
            },
            armed,
            start,
            frames,
            news,
            over,
            sensor: Some(spawn(|| sensor.run())),
        }
    }

    /// A descriptor that is readable when a frame has arrived.
    pub fn descriptor(&self) -> OwnedFd {
        self.news.try_clone().unwrap()
    }

    fn forget(&mut self) {
        let _ = read(&self.news, &mut [0; 64]);
        while self.frames.try_recv().is_ok() {}
    }
}

impl Camera for Eye {
    fn format(&self) -> FrameFormat {
        FrameFormat::packed(1, 1, 8)
    }

    fn encoding(&self) -> Encoding {
        Encoding {
            name: "Y8".into(),
            exact: true,
        }
    }

    fn timing(&self) -> CameraTiming {
        CameraTiming {
            starts: self.starts,
            exposure: EXPOSURE,
            period: PERIOD,
            delivery: READOUT * 2,
        }
    }

    fn start(&mut self) -> Result<(), Error> {
        if self.armed.load(Ordering::SeqCst) {
            return Err(Error::protocol("starting the camera", "stop it first"));
        }
        self.forget();
        self.start.fetch_add(1, Ordering::SeqCst);
        self.armed.store(true, Ordering::SeqCst);
        Ok(())
    }

    fn poll_frame(&mut self) -> Result<Option<Frame>, Error> {
        if !self.armed.load(Ordering::SeqCst) {
            return Err(Error::protocol(
                "fetching a frame",
                "start the camera first",
            ));
        }
        let frame = self.frames.try_recv().ok();
        if frame.is_some() {
            let _ = read(&self.news, &mut [0; 1]);
        }
        Ok(frame)
    }

    fn stop(&mut self) -> Result<(), Error> {
        self.armed.store(false, Ordering::SeqCst);
        self.forget();
        Ok(())
    }
}

impl Drop for Eye {
    fn drop(&mut self) {
        self.over.store(true, Ordering::SeqCst);
        let sensor = self.sensor.take().map(JoinHandle::join);
        assert!(
            std::thread::panicking() || sensor.is_none_or(|sensor| sensor.is_ok()),
            "the sensor panicked"
        );
    }
}

struct Sensor {
    armed: Arc<AtomicBool>,
    start: Arc<AtomicU64>,
    over: Arc<AtomicBool>,
    refreshes: Refreshes,
    checksums: Option<Checksums>,
    send: Sender<Frame>,
    tell: OwnedFd,
    count: u64,
    view: View,
}

impl Sensor {
    fn run(mut self) {
        let (mut free, mut last) = (monotonic(), 0);
        while !self.over.load(Ordering::SeqCst) {
            let began = match &mut self.view.wire {
                Some(wire) => wire.pulse(),
                None => (monotonic() >= free).then(monotonic),
            };
            let start = self.start.load(Ordering::SeqCst);
            // A pulse while the sensor is busy is lost; a start makes the sensor free.
            if let Some(began) = began.filter(|began| *began >= free || start != last)
                && self.armed.load(Ordering::SeqCst)
            {
                (free, last) = (began + PERIOD, start);
                self.expose(began);
            }
            sleep(LOOK);
        }
    }

    fn expose(&mut self, began: Timestamp) {
        let start = self.start.load(Ordering::SeqCst);
        sleep_until(began + EXPOSURE);
        // Without checksums the count is not needed, and must not be read: the display may be gone.
        let seen = self.checksums.is_some().then(|| {
            [TOLERANCE, EXPOSURE - TOLERANCE]
                .map(|into| self.refreshes.at(began + into, self.view.refresh))
        });
        sleep_until(began + (EXPOSURE + READOUT));
        let seen = seen.map_or(NO_PATTERN, |[first, last]| self.in_view(first, last));
        self.count += 1;
        if start != self.start.load(Ordering::SeqCst) || !self.armed.load(Ordering::SeqCst) {
            return;
        }
        let pixels = Arc::new(Pixels::Eight(vec![seen]));
        let frame = Frame::new(FrameFormat::packed(1, 1, 8), pixels, began, self.count).unwrap();
        if self.send.send(frame).is_ok() {
            write(&self.tell, b"!").unwrap();
        }
    }

    /// The pattern whose light was in view from refresh `first` to refresh `last`.
    fn in_view(&mut self, first: u64, last: u64) -> u8 {
        let Some(checksums) = &mut self.checksums else {
            return NO_PATTERN;
        };
        checksums.take();
        let pattern = |count| {
            let sum = checksums.seen.get(&(count - self.view.lag));
            sum.and_then(|sum| self.view.patterns.get(sum))
                .copied()
                .unwrap_or(NO_PATTERN)
        };
        let seen = pattern(first);
        if (first..=last).all(|count| pattern(count) == seen) {
            seen
        } else {
            MIXED
        }
    }
}

fn sleep_until(end: Timestamp) {
    sleep(end.since(monotonic()));
}
