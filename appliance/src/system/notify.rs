//! What a service manager is told (`sd_notify`): READY, signs of life of the measuring task, how things stand, the end.
//!
//! Where no service manager started the program nobody is told anything. A manager that cannot be told is no reason to stop
//! measuring: it finds out by itself.

use sd_notify::NotifyState;
use std::sync::Arc;
use std::sync::atomic::{AtomicU8, AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// Signs of life in the time after which the manager takes silence for a hang.
const BEATS: u32 = 4;

/// The way to the service manager. Cheap to clone.
#[derive(Clone, Debug, Default)]
pub struct Notify {
    listened_to: bool,
    /// Silence that the manager takes for a hang; none if it does not watch.
    watchdog: Option<Duration>,
    phase: Arc<AtomicU8>,
}

/// Phases, in order.
const STARTING: u8 = 0;
const RUNNING: u8 = 1;
const STOPPING: u8 = 2;

impl Notify {
    /// To the manager that the environment names; to nobody where it names none.
    pub fn from_environment() -> Self {
        Self {
            listened_to: std::env::var_os("NOTIFY_SOCKET").is_some(),
            watchdog: sd_notify::watchdog_enabled(),
            phase: Arc::default(),
        }
    }

    /// Whether a service manager started the program.
    pub fn is_listened_to(&self) -> bool {
        self.listened_to
    }

    /// The start is over. From now on silence of the measuring task is a hang.
    pub fn ready(&self) {
        self.phase.fetch_max(RUNNING, Ordering::Relaxed);
        self.tell(&[NotifyState::Ready]);
    }

    /// How things stand, in one line for people.
    pub fn status(&self, words: &str) {
        self.tell(&[NotifyState::Status(&words.replace('\n', " "))]);
    }

    /// The end has begun.
    pub fn stopping(&self) {
        self.phase.store(STOPPING, Ordering::Relaxed);
        self.tell(&[NotifyState::Stopping, NotifyState::Status("stopping")]);
    }

    /// The measuring task's signs of life. There must be one owner only.
    pub fn pulse(&self) -> Pulse {
        Pulse {
            notify: self.clone(),
            begun: Instant::now(),
            next_ms: AtomicU64::new(0),
        }
    }

    fn tell(&self, states: &[NotifyState<'_>]) {
        if self.listened_to {
            drop(sd_notify::notify(states));
        }
    }
}

/// The measuring task's signs of life: what feeds the watchdog, and nothing else does. No clones: whoever owns it is the
/// measuring task.
#[derive(Debug)]
pub struct Pulse {
    notify: Notify,
    begun: Instant,
    /// When the manager is told next, in ms since `begun`.
    next_ms: AtomicU64,
}

impl Pulse {
    /// A sign of life. The manager is told of a few of them only, so that it may come at any rate.
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
            // As long as there is something to do a start may take; one that hangs may not.
            STARTING => {
                let more = u32::try_from(watchdog.as_micros()).unwrap_or(u32::MAX);
                self.notify.tell(&[NotifyState::ExtendTimeoutUsec(more)]);
            }
            RUNNING => self.notify.tell(&[NotifyState::Watchdog]),
            _ => {}
        }
    }
}

/// Saturates.
fn millis(time: Duration) -> u64 {
    u64::try_from(time.as_millis()).unwrap_or(u64::MAX)
}
