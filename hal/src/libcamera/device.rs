//! The camera as the head uses it: it sends orders to the thread that owns the library, and fetches
//! frames and errors from it.

use std::os::fd::OwnedFd;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicUsize, Ordering};
use std::sync::mpsc::{self, Receiver, Sender, TryRecvError};
use std::thread;
use std::time::Duration;

use ::libcamera::properties;
use rustix::event::{EventfdFlags, eventfd};

use super::open::Configured;
use super::owner::{Event, Order, Wires, own, with_manager};
use super::{ContinuedCount, Exposing, Reading, Settings};
use crate::camera::{Camera, CameraTiming, Encoding, Starts};
use crate::error::{DeviceKind, Error};
use crate::frame::{Frame, FrameFormat};

/// Longest time for opening, starting and stopping a camera, in which the sensor is powered up and
/// programmed over I²C. If it takes longer, the driver hangs.
const PATIENCE: Duration = Duration::from_secs(15);
/// A camera that libcamera lists.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Listed {
    /// Its id, for [`Settings::id`].
    pub id: String,
    /// The sensor's or the device's name, where it has one.
    pub model: Option<String>,
}

/// A camera through libcamera. One can be open at a time.
#[derive(Debug)]
pub struct LibCamera {
    id: String,
    settings: Settings,
    configured: Configured,
    orders: Sender<Order>,
    events: Receiver<Event>,
    ready: Arc<OwnedFd>,
    gone: Arc<AtomicBool>,
    in_flight: Arc<AtomicUsize>,
    celsius: Arc<AtomicU32>,
    ended: Receiver<()>,
    count: ContinuedCount,
    running: bool,
    /// How it is started: each exposure so many times as long as set.
    times: u32,
}

impl LibCamera {
    /// The cameras that are there, in no particular order.
    ///
    /// # Errors
    /// `Protocol` if a camera is open in this program or the library does not start.
    pub fn list() -> Result<Vec<Listed>, Error> {
        with_manager(|manager| {
            let cameras = manager.cameras();
            let listed = cameras.iter().map(|camera| Listed {
                id: camera.id().to_owned(),
                model: camera
                    .properties()
                    .get::<properties::Model>()
                    .ok()
                    .map(|model| model.0),
            });
            Ok(listed.collect())
        })
    }

    /// Opens a camera: finds it by its id, negotiates a format, and maps its buffers.
    ///
    /// # Errors
    /// `Disconnected` if there is no camera, or none of that id; `Unsupported` if there are several
    /// and no id is given, if the camera does not support the settings, listing what it supports,
    /// or if there is no memory for buffers; `Protocol` if another program uses it, one is open in
    /// this program, or the library fails; `Timeout` if its driver hangs.
    pub fn open(settings: Settings) -> Result<Self, Error> {
        let system = |cause: &dyn std::fmt::Display| {
            Error::protocol(
                format!("opening a camera: {cause}"),
                "the system is out of descriptors or threads: see its log",
            )
        };
        let ready = eventfd(
            0,
            EventfdFlags::SEMAPHORE | EventfdFlags::NONBLOCK | EventfdFlags::CLOEXEC,
        )
        .map_err(|cause| system(&cause))?;
        let (ready, gone) = (Arc::new(ready), Arc::default());
        let in_flight = Arc::default();
        let celsius = Arc::new(AtomicU32::new(f32::NAN.to_bits()));
        let (orders, ordered) = mpsc::channel();
        let (told, events) = mpsc::channel();
        let (answer, opened) = mpsc::channel();
        let (end, ended) = mpsc::channel();
        let wires = Wires {
            settings: settings.clone(),
            orders: ordered,
            home: orders.clone(),
            events: told,
            ready: Arc::clone(&ready),
            gone: Arc::clone(&gone),
            in_flight: Arc::clone(&in_flight),
            celsius: Arc::clone(&celsius),
        };
        thread::Builder::new()
            .name("libcamera".into())
            .spawn(move || {
                own(wires, &answer);
                drop(end);
            })
            .map_err(|cause| system(&cause))?;
        let attempt = match &settings.id {
            Some(id) => format!("opening the camera `{id}`"),
            None => "opening a camera".into(),
        };
        let (id, configured) = answered(&opened, attempt)?;
        Ok(Self {
            id,
            settings,
            configured,
            orders,
            events,
            ready,
            gone,
            in_flight,
            celsius,
            ended,
            count: ContinuedCount::default(),
            running: false,
            times: 1,
        })
    }

    /// A descriptor that is readable as long as there is a frame or an error that was not fetched.
    ///
    /// # Errors
    /// `Protocol` if the system is out of descriptors.
    pub fn ready(&self) -> Result<OwnedFd, Error> {
        self.ready.try_clone().map_err(|cause| {
            Error::protocol(
                format!(
                    "duplicating a descriptor of the camera `{}`: {cause}",
                    self.id
                ),
                "the system is out of descriptors: see its log",
            )
        })
    }

    /// The library's id of the camera.
    #[must_use]
    pub fn id(&self) -> &str {
        &self.id
    }

    /// Buffers that the camera has.
    #[must_use]
    pub fn buffers(&self) -> usize {
        self.configured.buffers
    }

    /// Whether the processor caches these buffers. If not, reading them takes many times as long.
    #[must_use]
    pub fn cached(&self) -> bool {
        self.configured.cached
    }

    fn ask(
        &self,
        attempt: &str,
        order: impl FnOnce(Sender<Result<(), Error>>) -> Order,
    ) -> Result<(), Error> {
        let (answer, answers) = mpsc::channel();
        // If the thread has ended, `answered` finds its channel closed.
        let _ = self.orders.send(order(answer));
        answered(&answers, format!("{attempt} the camera `{}`", self.id))
    }

    /// Takes the next event and decrements the eventfd, which counts the events that were not
    /// fetched.
    fn fetch(&mut self) -> Result<Option<Event>, Error> {
        match self.events.try_recv() {
            Ok(event) => {
                let _ = rustix::io::read(&*self.ready, &mut [0_u8; 8]);
                if let Event::Frame(_, index) = event {
                    let _ = self.orders.send(Order::Fetched(index));
                }
                Ok(Some(event))
            }
            Err(TryRecvError::Empty) => Ok(None),
            Err(TryRecvError::Disconnected) => Err(self.lost()),
        }
    }

    fn lost(&self) -> Error {
        let attempt = format!("waiting for a frame of the camera `{}`", self.id);
        Error::disconnected(DeviceKind::Camera, attempt)
    }
}

/// The thread's answer to `attempt`, within [`PATIENCE`].
fn answered<T>(answers: &Receiver<Result<T, Error>>, attempt: String) -> Result<T, Error> {
    match answers.recv_timeout(PATIENCE) {
        Ok(answer) => answer,
        Err(mpsc::RecvTimeoutError::Timeout) => Err(Error::timeout(
            attempt,
            PATIENCE,
            "its driver hangs: see the system's log, and restart the computer",
        )),
        Err(mpsc::RecvTimeoutError::Disconnected) => {
            Err(Error::disconnected(DeviceKind::Camera, attempt))
        }
    }
}

impl Camera for LibCamera {
    fn format(&self) -> FrameFormat {
        self.configured.format
    }

    fn encoding(&self) -> Encoding {
        Encoding {
            name: self.configured.readable.describe(),
            exact: self.configured.readable.reading == Reading::Raw,
        }
    }

    fn timing(&self) -> CameraTiming {
        let Exposing {
            exposure, period, ..
        } = self.settings.exposing;
        let set = CameraTiming {
            starts: self.settings.starts,
            exposure,
            period,
            delivery: self.settings.delivery,
        };
        set.exposed(self.times)
    }

    fn expose(&mut self, times: u32) -> Result<(), Error> {
        if times != 1 && !self.settings.controlled {
            return Err(Error::unsupported(
                format!("setting the exposure of the camera `{}`", self.id),
                "use a camera that has this control, or a recipe that was taught with --exposures 1",
            ));
        }
        self.times = times;
        Ok(())
    }

    fn stays_on(&self) -> Duration {
        match self.settings.starts {
            Starts::OnTrigger => self.settings.stays_on,
            Starts::ByProjector | Starts::ByItself => Duration::ZERO,
        }
    }

    fn temperature_c(&self) -> Option<f64> {
        let celsius = f32::from_bits(self.celsius.load(Ordering::Relaxed));
        celsius.is_finite().then(|| celsius.into())
    }

    fn present(&self) -> Result<(), Error> {
        if self.gone.load(Ordering::Relaxed) {
            return Err(self.lost());
        }
        Ok(())
    }

    fn start(&mut self) -> Result<(), Error> {
        self.present()?;
        if self.running {
            return Err(Error::protocol(
                format!("starting the camera `{}` that runs", self.id),
                "stop it first",
            ));
        }
        self.count.restart();
        let timing = self.timing();
        let exposing = Exposing {
            exposure: timing.exposure,
            period: timing.period,
            ..self.settings.exposing
        };
        let start = |answer| Order::Start(exposing, answer);
        self.ask("starting", start).inspect_err(|_| {
            // The camera may be running, and queueing its requests may have failed.
            let _ = self.ask("stopping", Order::Stop);
        })?;
        self.running = true;
        Ok(())
    }

    fn poll_frame(&mut self) -> Result<Option<Frame>, Error> {
        if !self.running {
            return Err(Error::protocol(
                format!(
                    "fetching a frame of the camera `{}` that is stopped",
                    self.id
                ),
                "start it first",
            ));
        }
        match self.fetch()? {
            Some(Event::Frame(frame, _)) => {
                let count = self.count.of(frame.count());
                Ok(Some(frame.restamped(frame.timestamp(), count)))
            }
            Some(Event::Refused(error)) => Err(error),
            None => self.present().map(|()| None),
        }
    }

    fn stop(&mut self) -> Result<(), Error> {
        if !self.running {
            return Ok(());
        }
        self.running = false;
        let stopped = self.ask("stopping", Order::Stop);
        let in_flight = self.in_flight.load(Ordering::Relaxed);
        while let Ok(Some(_)) = self.fetch() {}
        stopped?;
        if in_flight > 0 {
            // Their frames would be taken for those of the next sequence.
            return Err(Error::protocol(
                format!(
                    "stopping the camera `{}` that keeps {in_flight} requests",
                    self.id
                ),
                "this is a defect of fringed or of libcamera: report it",
            ));
        }
        Ok(())
    }
}

impl Drop for LibCamera {
    fn drop(&mut self) {
        let _ = self.orders.send(Order::Close);
        // No other camera can be opened before the library is closed. If the driver hangs, the
        // thread is left behind.
        let _ = self.ended.recv_timeout(PATIENCE);
    }
}
