//! A line out that starts exposures: a pulse of a given width.
//!
//! The caller begins a pulse, a thread of its own ends it. A camera may expose for as long as the pulse lasts, so the width must
//! not wander with the time that a sleeping thread takes to wake: the thread wakes a little early and watches the clock.

use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

use gpio_cdev::LineHandle;

use super::chip::find;
use super::failure::{LineError, means};
use crate::clock::monotonic;
use crate::error::Error;
use crate::setup::TriggerSetup;
use crate::trigger::Trigger;
use crate::units::Timestamp;

/// How much too early the thread wakes: more than what it usually takes to, and little processor time to watch the clock for.
const EARLY: Duration = Duration::from_micros(200);

/// A trigger of pulses. Dropped, its line is idle, also in the middle of a pulse.
#[derive(Debug)]
pub struct Pulse {
    line: Arc<Pulsed>,
    ending: Option<JoinHandle<()>>,
    width: Duration,
}

/// The line and what both threads know of it.
#[derive(Debug)]
struct Pulsed {
    handle: LineHandle,
    name: String,
    state: Mutex<State>,
    changed: Condvar,
}

#[derive(Debug, Default)]
struct State {
    /// When the pulse that is on has to end.
    ends: Option<Timestamp>,
    /// Why the last one could not be ended.
    failed: Option<LineError>,
    /// Nobody fires any more.
    over: bool,
}

impl Pulse {
    /// Takes the line `name` of the chip as it is set up; it is idle.
    ///
    /// # Errors
    /// Why it cannot be taken.
    pub fn open(setup: &TriggerSetup, name: &str) -> Result<Self, LineError> {
        let line = Arc::new(Pulsed {
            handle: find(&setup.chip, name)?.output(setup.active_low, false)?,
            name: name.into(),
            state: Mutex::default(),
            changed: Condvar::new(),
        });
        let ended = Arc::clone(&line);
        let ending = std::thread::Builder::new()
            .name("pulse".into())
            .spawn(move || ended.end_pulses())
            .map_err(|error| LineError::Failed {
                line: name.into(),
                cause: error.to_string(),
            })?;
        Ok(Self {
            line,
            ending: Some(ending),
            width: setup.pulse(),
        })
    }
}

impl Trigger for Pulse {
    /// A pulse while the one before is still on is lost, as it is to a camera that still exposes.
    fn fire(&mut self) -> Result<Timestamp, Error> {
        let mut state = self.line.lock();
        if let Some(failed) = &state.failed {
            return Err(failed.clone().into());
        }
        if state.ends.is_none() {
            self.line.put(true)?;
            state.ends = Some(monotonic() + self.width);
            self.line.changed.notify_one();
        }
        Ok(monotonic())
    }
}

impl Drop for Pulse {
    fn drop(&mut self) {
        self.line.lock().over = true;
        self.line.changed.notify_one();
        if let Some(ending) = self.ending.take() {
            // A panic there leaves nothing behind that the next line would not set right.
            let _ = ending.join();
        }
        // Nobody is left to be told.
        let _ = self.line.put(false);
    }
}

impl Pulsed {
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn put(&self, on: bool) -> Result<(), LineError> {
        let put = self.handle.set_value(u8::from(on));
        put.map_err(|error| means(&error, &self.name, None))
    }

    /// Ends every pulse in its time, until nobody fires any more.
    fn end_pulses(&self) {
        let mut state = self.lock();
        while !state.over {
            let Some(ends) = state.ends else {
                state = self.wait(state, Duration::MAX);
                continue;
            };
            let left = ends.since(monotonic());
            if left > EARLY {
                state = self.wait(state, left - EARLY);
                continue;
            }
            while monotonic() < ends {
                std::hint::spin_loop();
            }
            state.failed = self.put(false).err();
            state.ends = None;
        }
    }

    fn wait<'a>(&self, state: MutexGuard<'a, State>, time: Duration) -> MutexGuard<'a, State> {
        let woken = self.changed.wait_timeout(state, time);
        woken.unwrap_or_else(PoisonError::into_inner).0
    }
}
