//! The thread that owns a camera and the library: it starts, stops, fills the camera's queue and reads what comes of it.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender};
use std::sync::{Arc, Mutex, TryLockError};
use std::time::Duration;

use ::libcamera::camera_manager::CameraManager;
use ::libcamera::control::ControlList;
use ::libcamera::controls;
use ::libcamera::framebuffer::{AsFrameBuffer, FrameMetadataStatus};
use ::libcamera::framebuffer_allocator::FrameBuffer;
use ::libcamera::request::{Request, RequestStatus, ReuseFlag};
use rustix::fd::OwnedFd;
use rustix::time::{ClockId, clock_gettime};

use super::Settings;
use super::buffers::Lease;
use super::layout::Layout;
use super::open::{Configured, Opened, open, refused};
use super::report::{Clocks, Reported, on_the_heads_clock};
use crate::clock::monotonic;
use crate::error::{Device, Error};
use crate::units::Timestamp;

/// Requests that the library has come back within this, once it has stopped.
const CANCELLED: Duration = Duration::from_secs(2);

/// The library allows one manager of cameras in a process.
static ONE_MANAGER: Mutex<()> = Mutex::new(());

/// What the thread is told.
pub(super) enum Order {
    Start(Sender<Result<(), Error>>),
    Stop(Sender<Result<(), Error>>),
    /// The library is done with a request.
    Done(Request),
    /// Nobody keeps a frame in this buffer any more.
    Free(usize),
    /// End.
    Close,
}

/// What came of a running camera.
#[derive(Debug)]
pub(super) enum Event {
    Frame(Arrived),
    /// A frame that cannot be used, and why.
    Refused(Error),
}

/// A frame in its buffer.
#[derive(Debug)]
pub(super) struct Arrived {
    pub lease: Lease,
    pub stamp: Timestamp,
    /// The camera's count since its start.
    pub sequence: u32,
}

/// The ends of what connects the thread with the camera's other half.
pub(super) struct Wires {
    pub settings: Settings,
    pub orders: Receiver<Order>,
    pub home: Sender<Order>,
    pub events: Sender<Event>,
    /// Counts the events that were not fetched, so that it is readable as long as there is one.
    pub ready: Arc<OwnedFd>,
    pub gone: Arc<AtomicBool>,
    /// Buffers with frames that were not dropped.
    pub out: Arc<AtomicUsize>,
    /// Requests that the library has.
    pub in_flight: Arc<AtomicUsize>,
}

/// Does `work` with the manager of all cameras; two at a time would end the process.
///
/// # Errors
/// `Protocol` if another camera is open in this process or the library does not start; that of `work`.
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

/// Opens the camera, answers how, and serves it until it is told to end.
pub(super) fn own(wires: Wires, answer: &Sender<Result<(String, Configured), Error>>) {
    let served = with_manager(|manager| {
        let mut opened = open(manager, &wires.settings)?;
        if answer
            .send(Ok((opened.id.clone(), opened.configured)))
            .is_err()
        {
            // Nobody waited so long, and nobody would ever close it.
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
            opened,
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

/// Makes the descriptor readable once more.
fn ring(ready: &OwnedFd) {
    let _ = rustix::io::write(ready, &1_u64.to_ne_bytes());
}

struct Owner<'a> {
    opened: Opened,
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
                Order::Start(answer) => {
                    let started = self.start();
                    let _ = answer.send(started);
                }
                Order::Stop(answer) => {
                    let stopped = self.stop();
                    let _ = answer.send(stopped);
                }
                Order::Done(request) => self.done(request),
                Order::Free(index) => self.free(index),
                Order::Close => self.closing = true,
            }
        }
        // A request must not outlive its camera: neither one that the library has nor one that comes back unread.
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

    /// Everything automatic off, and the values that hold from the first frame.
    fn controls(&self) -> ::libcamera::utils::UniquePtr<ControlList> {
        let exposing = &self.wires.settings.exposing;
        let microseconds = |time: Duration| i64::try_from(time.as_micros()).unwrap_or(i64::MAX);
        let period = microseconds(exposing.period);
        let exposure = i32::try_from(exposing.exposure.as_micros()).unwrap_or(i32::MAX);
        let mut set = ControlList::new();
        // A list that is not bound to a camera takes every control; whether the values were taken shows in the metadata.
        let _ = set.set(controls::AeEnable(false));
        let _ = set.set(controls::ExposureTime(exposure));
        let _ = set.set(controls::AnalogueGain(exposing.gain));
        let _ = set.set(controls::FrameDurationLimits([period, period]));
        set
    }

    /// Stops the camera and takes back the requests that it had.
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
                Ok(Order::Free(index)) => self.free(index),
                // Its other half did not wait for this one's answer.
                Ok(Order::Close) => self.closing = true,
                Ok(Order::Start(_) | Order::Stop(_)) => {}
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

    fn free(&mut self, index: usize) {
        if let Some(slot) = self.opened.slots.get_mut(index) {
            slot.lent = false;
        }
        if self.running
            && let Err(error) = self.queue(index)
        {
            self.tell(Event::Refused(error));
        }
    }

    /// Gives a request to the library, unless somebody keeps its buffer or the library has it.
    fn queue(&mut self, index: usize) -> Result<(), Error> {
        let slot = &mut self.opened.slots[index];
        if slot.lent {
            return Ok(());
        }
        let Some(mut request) = slot.request.take() else {
            return Ok(());
        };
        request.reuse(ReuseFlag::REUSE_BUFFERS);
        // Before it is queued: it may be back before that returns.
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
            // Nobody stopped it: libcamera gives up a camera that no longer answers.
            self.wires.gone.store(true, Ordering::Relaxed);
            let attempt = format!("waiting for a frame of the camera `{}`", self.opened.id);
            self.tell(Event::Refused(Error::disconnected(Device::Camera, attempt)));
            return;
        }
        match self.read(index) {
            Some(event) => {
                self.opened.slots[index].lent = matches!(event, Event::Frame(_));
                let again = !self.opened.slots[index].lent;
                self.tell(event);
                if again {
                    self.free(index);
                }
            }
            // A frame that the sensor spoiled, or one of its start-up: a gap in the count.
            None => self.free(index),
        }
    }

    /// What a completed request holds; none if its frame is no good.
    fn read(&self, index: usize) -> Option<Event> {
        let clocks = Clocks::of(&[(); 3].map(|()| (monotonic(), boot(), monotonic())));
        let slot = &self.opened.slots[index];
        let request = slot.request.as_ref()?;
        let buffer: &FrameBuffer = request.buffer(&self.opened.stream)?;
        let frame = buffer.metadata()?;
        if frame.status() != FrameMetadataStatus::Success {
            return None;
        }
        let metadata = request.metadata();
        let sensor = metadata.get::<controls::SensorTimestamp>();
        let stamp = sensor.ok().and_then(|stamp| u64::try_from(stamp.0).ok());
        let stamp = stamp.unwrap_or_else(|| frame.timestamp());
        let verified = if self.wires.settings.controlled {
            let reported = Reported {
                exposure: metadata.get::<controls::ExposureTime>().ok().map(|v| v.0),
                gain: metadata.get::<controls::AnalogueGain>().ok().map(|v| v.0),
                period: metadata.get::<controls::FrameDuration>().ok().map(|v| v.0),
            };
            let rows = self.opened.configured.format.height;
            self.wires.settings.exposing.verify(rows, &reported)
        } else {
            Ok(())
        };
        let stamp = verified.and_then(|()| on_the_heads_clock(stamp, clocks));
        Some(match stamp {
            Ok(stamp) => Event::Frame(Arrived {
                lease: Lease::new(
                    index,
                    slot.bytes.clone(),
                    self.opened.configured.readable.layout == Layout::Words,
                    self.wires.home.clone(),
                    &self.wires.out,
                ),
                stamp,
                sequence: frame.sequence(),
            }),
            Err(error) => Event::Refused(error),
        })
    }

    fn tell(&self, event: Event) {
        // Signal the eventfd before sending: the receiver decrements it for each event that it fetches.
        ring(&self.wires.ready);
        let _ = self.wires.events.send(event);
    }
}

/// Now, on `CLOCK_BOOTTIME`.
fn boot() -> Timestamp {
    let now = clock_gettime(ClockId::Boottime);
    let seconds = Duration::from_secs(u64::try_from(now.tv_sec).unwrap_or(0));
    Timestamp(0) + seconds + Duration::from_nanos(u64::try_from(now.tv_nsec).unwrap_or(0))
}
