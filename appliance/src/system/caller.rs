//! The caller of the daemon: the service manager (`sd_notify`: READY, signs of life of the measuring
//! task, the status line, the stop), and the source of the stop signal.
//!
//! Without a service manager nothing is sent. A notification that fails is dropped and measuring goes
//! on: the manager's own time-outs notice what is missing.

use super::runtime;
use crate::error::{Exit, Result};
use sd_notify::NotifyState;
use std::future::pending;
use std::sync::Arc;
use std::sync::atomic::{AtomicU8, AtomicU64, Ordering};
use std::time::{Duration, Instant};
use tokio::signal::unix::{SignalKind, signal};
use tokio::sync::watch;

/// The caller of the daemon; by default there is no service manager and no stop signal.
#[derive(Clone, Debug, Default)]
pub struct Caller {
    /// The service manager.
    pub notify: Notify,
    /// The stop signal, which also ends a start early.
    pub stop: StopSignal,
}

/// Signs of life that are sent per watchdog period.
const BEATS: u32 = 4;

/// The connection to the service manager. Cheap to clone; clones share the phase.
#[derive(Clone, Debug, Default)]
pub struct Notify {
    connected: bool,
    /// The watchdog period: a longer silence counts as a hang. `None` without a watchdog.
    watchdog: Option<Duration>,
    phase: Arc<AtomicU8>,
}

/// Phases, in order.
const STARTING: u8 = 0;
const RUNNING: u8 = 1;
const STOPPING: u8 = 2;

impl Notify {
    /// To the manager that NOTIFY_SOCKET names, if it is set.
    pub fn from_environment() -> Self {
        Self {
            connected: std::env::var_os("NOTIFY_SOCKET").is_some(),
            watchdog: sd_notify::watchdog_enabled(),
            phase: Arc::default(),
        }
    }

    /// Whether a service manager started the program.
    pub fn is_connected(&self) -> bool {
        self.connected
    }

    /// The start is complete. From now on the watchdog takes silence of the measuring task for a
    /// hang.
    pub fn ready(&self) {
        self.phase.fetch_max(RUNNING, Ordering::Relaxed);
        self.send(&[NotifyState::Ready]);
    }

    /// The status line for people.
    pub fn status(&self, words: &str) {
        self.send(&[NotifyState::Status(&words.replace('\n', " "))]);
    }

    /// The stop has begun.
    pub fn stopping(&self) {
        self.phase.store(STOPPING, Ordering::Relaxed);
        self.send(&[NotifyState::Stopping, NotifyState::Status("stopping")]);
    }

    /// The source of the measuring task's signs of life; only that task may own it.
    pub fn pulse(&self) -> Pulse {
        Pulse {
            notify: self.clone(),
            begun: Instant::now(),
            next_ms: AtomicU64::new(0),
        }
    }

    fn send(&self, states: &[NotifyState<'_>]) {
        if self.connected {
            drop(sd_notify::notify(states));
        }
    }
}

/// The measuring task's signs of life, the only source that feeds the watchdog. It cannot be
/// cloned, so that no other thread can answer for a measuring task that hangs.
#[derive(Debug)]
pub struct Pulse {
    notify: Notify,
    begun: Instant,
    /// When the next notification is due, in ms since `begun`.
    next_ms: AtomicU64,
}

impl Pulse {
    /// A sign of life. May be called at any rate: only a few per watchdog period are sent.
    pub fn beat(&self) {
        let Some(watchdog) = self.notify.watchdog else {
            return;
        };
        let now = millis(self.begun.elapsed());
        if now < self.next_ms.load(Ordering::Relaxed) {
            return;
        }
        let next = now.saturating_add(millis(watchdog / BEATS));
        self.next_ms.store(next, Ordering::Relaxed);
        match self.notify.phase.load(Ordering::Relaxed) {
            // A start may take long as long as it makes progress: each sign of life extends its
            // time-out by one period.
            STARTING => {
                let more = u32::try_from(watchdog.as_micros()).unwrap_or(u32::MAX);
                self.notify.send(&[NotifyState::ExtendTimeoutUsec(more)]);
            }
            RUNNING => self.notify.send(&[NotifyState::Watchdog]),
            _ => {}
        }
    }
}

/// Saturates.
fn millis(time: Duration) -> u64 {
    u64::try_from(time.as_millis()).unwrap_or(u64::MAX)
}

/// Whether the signal has arrived; the default value never gets one. Cheap to clone.
#[derive(Clone, Debug, Default)]
pub struct StopSignal(Option<Arc<watch::Sender<bool>>>);

impl Caller {
    /// Ends the program as the stop signal does, where a service manager starts it anew.
    pub fn restart(&self) -> Option<Box<dyn Fn() + Send + Sync>> {
        let stop = self.stop.0.clone().filter(|_| self.notify.is_connected())?;
        Some(Box::new(move || {
            stop.send_replace(true);
        }))
    }
}

impl StopSignal {
    /// Catches the signals from now on.
    ///
    /// # Errors
    /// If the system does not deliver signals (exit code 70).
    pub fn listen() -> Result<Self> {
        let failed = Exit::Software.because("wait for a signal");
        let runtime = runtime()?;
        let listen = |kind| {
            let _inside = runtime.enter();
            signal(kind).map_err(&failed)
        };
        let mut interrupt = listen(SignalKind::interrupt())?;
        let mut terminate = listen(SignalKind::terminate())?;
        let arrive = Arc::new(watch::Sender::new(false));
        let signalled = arrive.clone();
        let wait = move || {
            runtime.block_on(async {
                tokio::select! {
                    _ = interrupt.recv() => {}
                    _ = terminate.recv() => {}
                }
            });
            signalled.send_replace(true);
        };
        std::thread::Builder::new()
            .name("signals".into())
            .spawn(wait)
            .map_err(&failed)?;
        Ok(Self(Some(arrive)))
    }

    /// Whether it has arrived.
    pub fn has_arrived(&self) -> bool {
        self.0.as_ref().is_some_and(|arrived| *arrived.borrow())
    }

    /// Waits until it arrives.
    pub async fn wait(&self) {
        if let Some(arrive) = &self.0
            && arrive
                .subscribe()
                .wait_for(|arrived| *arrived)
                .await
                .is_ok()
        {
            return;
        }
        pending::<()>().await;
    }
}
