//! The thread that owns a camera and the library: it starts and stops the camera, queues requests,
//! and copies the frames of completed ones.
//!
//! Copying here keeps it out of the thread that has to fire the next trigger.

use std::sync::atomic::{AtomicBool, AtomicU32, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender};
use std::sync::{Arc, Mutex, TryLockError};
use std::time::Duration;

use ::libcamera::camera_manager::CameraManager;
use ::libcamera::control::ControlList;
use ::libcamera::controls;
use ::libcamera::framebuffer::{AsFrameBuffer, FrameMetadataStatus, OwnedFrameBuffer};
use ::libcamera::framebuffer_allocator::FrameBuffer;
use ::libcamera::request::{Request, RequestStatus, ReuseFlag};
use rustix::fd::OwnedFd;
use rustix::time::ClockId;

use super::open::{Configured, Opened, open, refused};
use super::{ClockReading, Clocks, Exposing, Reported, Settings, on_the_heads_clock};
use crate::clock::{monotonic, read};
use crate::error::{DeviceKind, Error};
use crate::frame::{Frame, Pixels, Pool};

/// Longest time in which the library returns its requests after it has stopped.
const CANCELLED: Duration = Duration::from_secs(2);

/// Copied frames whose memory is reused.
const COPIES: usize = 64;

/// The library allows one camera manager in a process.
static ONE_MANAGER: Mutex<()> = Mutex::new(());

/// A message to the thread.
pub(super) enum Order {
    /// Start the camera with these settings.
    Start(Exposing, Sender<Result<(), Error>>),
    Stop(Sender<Result<(), Error>>),
    /// The library has completed a request.
    Done(Request),
    /// The frame of this request was fetched. Until then the camera does not get the request back,
    /// so frames that are not fetched do not pile up.
    Fetched(usize),
    /// Close the camera and end.
    Close,
}

/// An event of a running camera.
#[derive(Debug)]
pub(super) enum Event {
    /// A frame with the count since the camera's start, and the request that it is from.
    Frame(Frame, usize),
    /// A frame that cannot be used, and why.
    Refused(Error),
}

/// The settings, channels and counters that the thread shares with `LibCamera`.
pub(super) struct Wires {
    pub settings: Settings,
    pub orders: Receiver<Order>,
    pub home: Sender<Order>,
    pub events: Sender<Event>,
    /// An eventfd that counts the events that were not fetched, so that it is readable as long as
    /// there is one.
    pub ready: Arc<OwnedFd>,
    /// Whether the camera is disconnected.
    pub gone: Arc<AtomicBool>,
    /// Number of requests that the library has.
    pub in_flight: Arc<AtomicUsize>,
    /// Temperature of the sensor as of the last frame, °C, as bits of an `f32`; NaN if it does not
    /// say.
    pub celsius: Arc<AtomicU32>,
}

/// Calls `work` with the camera manager; a second one at the same time would abort the process.
///
/// # Errors
/// `Protocol` if another camera is open in this process or the library does not start; that of
/// `work`.
pub(super) fn with_manager<R>(
    work: impl FnOnce(&CameraManager) -> Result<R, Error>,
) -> Result<R, Error> {
    let guard = match ONE_MANAGER.try_lock() {
        Ok(guard) => Some(guard),
        Err(TryLockError::Poisoned(poisoned)) => Some(poisoned.into_inner()),
        Err(TryLockError::WouldBlock) => None,
    };
    let Some(_guard) = guard else {
        return Err(Error::protocol(
            "starting libcamera a second time in this program",
            "close the camera that is open first",
        ));
    };
    let manager = CameraManager::new().map_err(|cause| {
        Error::protocol(
            format!("starting libcamera: {cause}"),
            "see what it says on the standard error output",
        )
    })?;
    work(&manager)
}

/// Opens the camera, answers with its id and configuration, and serves orders until it is to close.
pub(super) fn own(wires: Wires, answer: &Sender<Result<(String, Configured), Error>>) {
    let served = with_manager(|manager| {
        let mut opened = open(manager, &wires.settings)?;
        if answer
            .send(Ok((opened.id.clone(), opened.configured)))
            .is_err()
        {
            // `LibCamera::open` has given up waiting, so nothing would ever close the camera.
            return Ok(());
        }
        let home = wires.home.clone();
        opened.camera.on_request_completed(move |request| {
            let _ = home.send(Order::Done(request));
        });
        let (gone, ready) = (Arc::clone(&wires.gone), Arc::clone(&wires.ready));
        opened.camera.on_disconnected(move || {
            gone.store(true, Ordering::Relaxed);
            ring(&ready);
        });
        let mut owner = Owner {
            copies: Pool::new(opened.configured.format, COPIES),
            opened,
            exposing: wires.settings.exposing,
            wires: &wires,
            running: false,
            closing: false,
        };
        owner.serve();
        Ok(())
    });
    if let Err(error) = served {
        let _ = answer.send(Err(error));
    }
}

/// Increments the eventfd.
fn ring(ready: &OwnedFd) {
    let _ = rustix::io::write(ready, &1_u64.to_ne_bytes());
}

struct Owner<'a> {
    opened: Opened,
    copies: Pool,
    /// The settings that the camera was started with.
    exposing: Exposing,
    wires: &'a Wires,
    running: bool,
    closing: bool,
}

impl Owner<'_> {
    fn serve(&mut self) {
        while !self.closing
            && let Ok(order) = self.wires.orders.recv()
        {
            match order {
                Order::Start(exposing, answer) => {
                    self.exposing = exposing;
                    let started = self.start();
                    let _ = answer.send(started);
                }
                Order::Stop(answer) => {
                    let stopped = self.stop();
                    let _ = answer.send(stopped);
                }
                Order::Done(request) => self.done(request),
                Order::Fetched(index) => self.again(index),
                Order::Close => self.closing = true,
            }
        }
        // A request must not outlive its camera, so `stop` takes back those in the library, and
        // those still in the channel are dropped.
        let _ = self.stop();
        while self.wires.orders.try_recv().is_ok() {}
    }

    fn start(&mut self) -> Result<(), Error> {
        let refused = |cause| refused(&self.opened.id, "starting", &cause);
        if self.wires.settings.controlled {
            let set = self.controls();
            self.opened.camera.start(Some(&set)).map_err(refused)?;
        } else {
            self.opened.camera.start(None).map_err(refused)?;
        }
        self.running = true;
        (0..self.opened.slots.len()).try_for_each(|index| self.queue(index))
    }

    /// Controls that switch everything automatic off and set the values from the first frame on.
    fn controls(&self) -> ::libcamera::utils::UniquePtr<ControlList> {
        let exposing = &self.exposing;
        let microseconds = |time: Duration| i64::try_from(time.as_micros()).unwrap_or(i64::MAX);
        let period = microseconds(exposing.period);
        let exposure = i32::try_from(exposing.exposure.as_micros()).unwrap_or(i32::MAX);
        let mut set = ControlList::new();
        // A list that is not bound to a camera accepts every control; whether the values took
        // effect is verified in the metadata.
        let _ = set.set(controls::AeEnable(false));
        let _ = set.set(controls::ExposureTime(exposure));
        let _ = set.set(controls::AnalogueGain(exposing.gain));
        let _ = set.set(controls::FrameDurationLimits([period, period]));
        set
    }

    /// Stops the camera and takes its requests back.
    fn stop(&mut self) -> Result<(), Error> {
        if !self.running {
            return Ok(());
        }
        self.running = false;
        self.opened
            .camera
            .stop()
            .map_err(|cause| refused(&self.opened.id, "stopping", &cause))?;
        while self.opened.slots.iter().any(|slot| slot.request.is_none()) {
            match self.wires.orders.recv_timeout(CANCELLED) {
                Ok(Order::Done(request)) => {
                    self.keep(request);
                }
                // `LibCamera` was dropped without waiting for an answer.
                Ok(Order::Close) => self.closing = true,
                Ok(Order::Start(..) | Order::Stop(_) | Order::Fetched(_)) => {}
                Err(RecvTimeoutError::Timeout | RecvTimeoutError::Disconnected) => {
                    return Err(Error::timeout(
                        format!(
                            "taking back the requests of the camera `{}`",
                            self.opened.id
                        ),
                        CANCELLED,
                        "restart the program",
                    ));
                }
            }
        }
        Ok(())
    }

    fn keep(&mut self, request: Request) -> Option<usize> {
        self.wires.in_flight.fetch_sub(1, Ordering::Relaxed);
        let index = usize::try_from(request.cookie()).ok()?;
        self.opened.slots.get_mut(index)?.request = Some(request);
        Some(index)
    }

    /// Queues a request, unless the library has it already.
    fn queue(&mut self, index: usize) -> Result<(), Error> {
        let slot = &mut self.opened.slots[index];
        let Some(mut request) = slot.request.take() else {
            return Ok(());
        };
        request.reuse(ReuseFlag::REUSE_BUFFERS);
        // Counted before it is queued, as it may be completed before `queue_request` returns.
        self.wires.in_flight.fetch_add(1, Ordering::Relaxed);
        let queued = self.opened.camera.queue_request(request);
        queued.map_err(|(request, cause)| {
            self.wires.in_flight.fetch_sub(1, Ordering::Relaxed);
            slot.request = Some(request);
            refused(&self.opened.id, "queueing a request to", &cause)
        })
    }

    fn done(&mut self, request: Request) {
        let status = request.status();
        let Some(index) = self.keep(request) else {
            return;
        };
        if !self.running {
            return;
        }
        if status == RequestStatus::Cancelled {
            // The camera was not stopped: libcamera cancels requests when a camera no longer
            // answers.
            self.wires.gone.store(true, Ordering::Relaxed);
            let attempt = format!("waiting for a frame of the camera `{}`", self.opened.id);
            self.tell(Event::Refused(Error::disconnected(
                DeviceKind::Camera,
                attempt,
            )));
            return;
        }
        match self.read(index) {
            Some(Event::Refused(error)) => {
                self.tell(Event::Refused(error));
                self.again(index);
            }
            Some(frame) => self.tell(frame),
            // An erroneous frame, or one of the sensor's start-up: it shows as a gap in the count.
            None => self.again(index),
        }
    }

    /// Queues a request once more.
    fn again(&mut self, index: usize) {
        if self.running
            && let Err(error) = self.queue(index)
        {
            self.tell(Event::Refused(error));
        }
    }

    /// The event of a completed request; none if its frame is erroneous.
    fn read(&mut self, index: usize) -> Option<Event> {
        let clocks = Clocks::of(&[(); 3].map(|()| ClockReading {
            before: monotonic(),
            boot: read(ClockId::Boottime),
            after: monotonic(),
        }));
        let slot = &self.opened.slots[index];
        let request = slot.request.as_ref()?;
        let stream = &self.opened.stream;
        let from_driver = request.buffer::<FrameBuffer>(stream);
        let frame = match from_driver {
            Some(buffer) => buffer.metadata()?,
            None => request.buffer::<OwnedFrameBuffer>(stream)?.metadata()?,
        };
        if frame.status() != FrameMetadataStatus::Success {
            return None;
        }
        let metadata = request.metadata();
        let celsius = metadata.get::<controls::SensorTemperature>();
        let celsius = celsius.map_or(f32::NAN, |celsius| celsius.0);
        self.wires
            .celsius
            .store(celsius.to_bits(), Ordering::Relaxed);
        let sensor = metadata.get::<controls::SensorTimestamp>();
        let stamp = sensor.ok().and_then(|stamp| u64::try_from(stamp.0).ok());
        let stamp = stamp.unwrap_or_else(|| frame.timestamp());
        let verified = if self.wires.settings.controlled {
            let reported = Reported {
                exposure: metadata.get::<controls::ExposureTime>().ok().map(|v| v.0),
                gain: metadata.get::<controls::AnalogueGain>().ok().map(|v| v.0),
                period: metadata.get::<controls::FrameDuration>().ok().map(|v| v.0),
            };
            let rows = self.opened.configured.rows;
            self.exposing.verify(rows, &reported)
        } else {
            Ok(())
        };
        let stamp = verified.and_then(|()| on_the_heads_clock(stamp, clocks));
        let copied = stamp.and_then(|stamp| {
            let Configured {
                readable,
                format,
                stride,
                ..
            } = self.opened.configured;
            let copy = |bytes: &[u8], pixels: &mut Pixels| {
                readable.copy(bytes, stride, &format, pixels);
            };
            let mut read = Ok(());
            let count = frame.sequence().into();
            let frame = self.copies.frame(stamp, count, |pixels| {
                read = slot.memory.read(pixels, &copy);
            });
            read.and(frame)
        });
        Some(copied.map_or_else(Event::Refused, |frame| Event::Frame(frame, index)))
    }

    fn tell(&self, event: Event) {
        // Signal the eventfd before sending: the receiver decrements it for each event that it
        // fetches.
        ring(&self.wires.ready);
        let _ = self.wires.events.send(event);
    }
}
