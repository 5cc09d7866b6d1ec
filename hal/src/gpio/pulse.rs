//! A line out that starts exposures: a pulse of a given width.
//!
//! The caller begins a pulse, a thread of its own ends it. A camera may expose for as long as the pulse lasts, so the width must
//! not wander with the time that a sleeping thread takes to wake: the thread wakes a little early and watches the clock. Either
//! may still be interrupted by whatever else the computer does, so the clock is read around both edges, and a pulse that did not
//! last as long as it should is told.

use std::collections::VecDeque;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

use super::chip::find;
use super::failure::{LineError, means};
use crate::clock::monotonic;
use crate::error::Error;
use crate::setup::TriggerSetup;
use crate::trigger::{Edges, REMEMBERED, Spoiled, Trigger};
use crate::units::Timestamp;

/// How much too early the thread wakes: more than what it usually takes to, and little processor time to watch the clock for.
const EARLY: Duration = Duration::from_micros(200);

/// A trigger of pulses. Dropped, its line is idle, also in the middle of a pulse.
pub struct Pulse {
    line: Arc<Pulsed>,
    ending: Option<JoinHandle<()>>,
}

/// Begins a pulse, or ends it.
type Put = dyn Fn(bool) -> Result<(), LineError> + Send + Sync;

/// The line and what both threads know of it.
struct Pulsed {
    put: Box<Put>,
    width: Duration,
    /// Locked from before an edge until what is known of it is written down: whoever locks it later knows it.
    state: Mutex<State>,
    changed: Condvar,
}

struct State {
    /// The clock before and after the rise of the pulse that is on.
    rise: Option<(Timestamp, Timestamp)>,
    /// Pulses that nobody has asked about.
    spoiled: VecDeque<Spoiled>,
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
        let handle = find(&setup.chip, name)?.output(setup.active_low, false)?;
        let line: Box<str> = name.into();
        let put = move |on| {
            let put = handle.set_value(u8::from(on));
            put.map_err(|error| means(&error, &line, None))
        };
        Self::of(Box::new(put), setup.pulse()).map_err(|error| LineError::Failed {
            line: name.into(),
            cause: error.to_string(),
        })
    }

    fn of(put: Box<Put>, width: Duration) -> std::io::Result<Self> {
        let line = Arc::new(Pulsed {
            put,
            width,
            state: Mutex::new(State {
                rise: None,
                spoiled: VecDeque::with_capacity(REMEMBERED),
                failed: None,
                over: false,
            }),
            changed: Condvar::new(),
        });
        let ended = Arc::clone(&line);
        let ending = std::thread::Builder::new()
            .name("pulse".into())
            .spawn(move || ended.end_pulses())?;
        Ok(Self {
            line,
            ending: Some(ending),
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
        if state.rise.is_some() {
            return Ok(monotonic());
        }
        let before = monotonic();
        (self.line.put)(true)?;
        let after = monotonic();
        state.rise = Some((before, after));
        self.line.changed.notify_one();
        Ok(after)
    }

    fn poll_spoiled(&mut self) -> Option<Spoiled> {
        self.line.lock().spoiled.pop_front()
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
        let _ = (self.line.put)(false);
    }
}

impl Pulsed {
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Ends every pulse in its time, until nobody fires any more.
    fn end_pulses(&self) {
        let mut state = self.lock();
        while !state.over {
            let Some(rise) = state.rise else {
                state = self.wait(state, Duration::MAX);
                continue;
            };
            // From the reading before the rise to the one before the fall, so that the way into the kernel counts for neither.
            let ends = rise.0 + self.width;
            let left = ends.since(monotonic());
            if left > EARLY {
                state = self.wait(state, left - EARLY);
                continue;
            }
            let mut before = monotonic();
            while before < ends {
                std::hint::spin_loop();
                before = monotonic();
            }
            state.failed = (self.put)(false).err();
            let fall = (before, monotonic());
            state.rise = None;
            state.judge(&Edges { rise, fall }, self.width);
        }
    }

    fn wait<'a>(&self, state: MutexGuard<'a, State>, time: Duration) -> MutexGuard<'a, State> {
        let woken = self.changed.wait_timeout(state, time);
        woken.unwrap_or_else(PoisonError::into_inner).0
    }
}

impl State {
    /// Remembers a pulse that did not last as long as it should.
    fn judge(&mut self, edges: &Edges, width: Duration) {
        if let Some(spoiled) = Spoiled::by(edges, width) {
            if self.spoiled.len() == REMEMBERED {
                self.spoiled.pop_front();
            }
            self.spoiled.push_back(spoiled);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WIDTH: Duration = Duration::from_millis(20);
    /// How long an edge is interrupted.
    const STALL: Duration = Duration::from_millis(5);

    /// The first pulse of a line whose edges take so long, if it was spoiled; asked as soon as its end has begun.
    fn first(rise: Duration, fall: Duration) -> (Timestamp, Option<Spoiled>) {
        let (ends, ended) = std::sync::mpsc::channel();
        let put = move |on: bool| {
            if !on {
                // The last one, of the drop, is awaited by nobody.
                let _ = ends.send(());
            }
            std::thread::sleep(if on { rise } else { fall });
            Ok(())
        };
        let mut pulse = Pulse::of(Box::new(put), WIDTH).unwrap();
        let fired = pulse.fire().unwrap();
        ended.recv().unwrap();
        let told = pulse.poll_spoiled();
        assert_eq!(pulse.poll_spoiled(), None, "told twice");
        (fired, told)
    }

    #[test]
    fn a_pulse_with_an_interrupted_edge_is_told_once_it_ended_and_by_how_much_it_was_off() {
        // Whatever else this computer does can only make it worse.
        let (fired, told) = first(STALL, Duration::ZERO);
        let told = told.expect("an interrupted rise");
        assert_eq!((told.fired, told.width), (fired, WIDTH));
        assert!(told.shorter >= STALL || told.longer >= STALL, "{told:?}");
        let (fired, told) = first(Duration::ZERO, STALL);
        let told = told.expect("an interrupted fall");
        assert_eq!((told.fired, told.width), (fired, WIDTH));
        assert!(told.longer >= STALL, "{told:?}");
    }

    #[test]
    fn a_trigger_that_nobody_asks_remembers_its_latest_spoiled_pulses_only() {
        let fall = Duration::from_millis(1);
        let put = move |on| {
            std::thread::sleep(if on { Duration::ZERO } else { fall });
            Ok(())
        };
        let mut pulse = Pulse::of(Box::new(put), Duration::from_micros(1)).unwrap();
        let mut fired = Vec::new();
        for _ in 0..REMEMBERED + 3 {
            fired.push(pulse.fire().unwrap());
            while pulse.line.lock().rise.is_some() {
                std::thread::yield_now();
            }
        }
        let told: Vec<_> = std::iter::from_fn(|| pulse.poll_spoiled()).collect();
        let told: Vec<_> = told.iter().map(|spoiled| spoiled.fired).collect();
        assert_eq!(told, fired[3..]);
    }
}
