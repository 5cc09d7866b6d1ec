//! An output line that starts exposures with pulses of a given width.
//!
//! The caller begins a pulse, and a thread of this module ends it. A camera may expose for as long
//! as the pulse lasts, so the width must not depend on how long a sleeping thread takes to wake:
//! the thread wakes a little early and then polls the clock. The caller gives it a real-time
//! priority and a core of its own, as far as the system permits. Both threads may still be
//! interrupted by other work of the computer, so the clock is read before and after each edge, and
//! a pulse that was too long or too short is reported.

use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

use super::line::{LineError, find, means};
use crate::clock::monotonic;
use crate::error::Error;
use crate::setup::TriggerSetup;
use crate::trigger::{Edges, Spoiled, SpoiledPulses, Trigger, decides, keep_latest};
use crate::units::Timestamp;

/// How long before the end of a pulse the thread wakes: longer than waking usually takes, short
/// enough to poll the clock meanwhile.
const EARLY: Duration = Duration::from_micros(200);

/// A trigger that makes pulses. When dropped, its line becomes idle, also in the middle of a pulse.
pub struct Pulse {
    line: Arc<Pulsed>,
    ending: Option<JoinHandle<()>>,
}

/// Begins a pulse, or ends it.
type Put = dyn Fn(bool) -> Result<(), LineError> + Send + Sync;

/// The line and the state that both threads share.
struct Pulsed {
    put: Box<Put>,
    /// The width of a pulse for one exposure of the length that the camera is set to.
    width: Duration,
    /// Locked from before an edge until its times are stored, so that a thread that locks it later
    /// knows them.
    state: Mutex<State>,
    changed: Condvar,
}

struct State {
    /// The width of the pulses that are made now.
    width: Duration,
    /// Times before and after the rising edge of the pulse that is on.
    rise: Option<(Timestamp, Timestamp)>,
    /// Spoiled pulses that were not fetched yet.
    spoiled: SpoiledPulses,
    /// Why the last pulse could not be ended.
    failed: Option<LineError>,
    /// The trigger is being dropped.
    over: bool,
}

impl Pulse {
    /// Opens the line `name` of the chip as it is set up; it is idle. The thread that ends its
    /// pulses calls `prepare` first, to get the priority and the core that it is to have.
    ///
    /// # Errors
    /// Why it cannot be opened.
    pub fn open(
        setup: &TriggerSetup,
        name: &str,
        prepare: impl FnOnce() + Send + 'static,
    ) -> Result<Self, LineError> {
        let handle = find(&setup.chip, name)?.output(setup.active_low, false)?;
        let line: Box<str> = name.into();
        let put = move |on| {
            let put = handle.set_value(u8::from(on));
            put.map_err(|error| means(&error, &line, None))
        };
        Self::of(Box::new(put), setup.pulse(), prepare)
            .map_err(|error| LineError::failed(name, error))
    }

    fn of(
        put: Box<Put>,
        width: Duration,
        prepare: impl FnOnce() + Send + 'static,
    ) -> std::io::Result<Self> {
        let line = Arc::new(Pulsed {
            put,
            width,
            state: Mutex::new(State {
                width,
                rise: None,
                spoiled: SpoiledPulses::new(),
                failed: None,
                over: false,
            }),
            changed: Condvar::new(),
        });
        let ended = Arc::clone(&line);
        let ending = std::thread::Builder::new()
            .name("pulse".into())
            .spawn(move || {
                prepare();
                ended.end_pulses();
            })?;
        Ok(Self {
            line,
            ending: Some(ending),
        })
    }
}

impl Trigger for Pulse {
    /// A pulse while the previous one is still on is lost, as it would be to a camera that still
    /// exposes.
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

    fn expose(&mut self, exposure: Duration, times: u32) {
        let width = self.line.width;
        let longer = match decides(width, exposure) {
            true => exposure.saturating_mul(times.saturating_sub(1)),
            false => Duration::ZERO,
        };
        self.line.lock().width = width + longer;
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
            // If the thread panicked, the line is set idle below all the same.
            let _ = ending.join();
        }
        // Nothing is left that could report an error.
        let _ = (self.line.put)(false);
    }
}

impl Pulsed {
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Ends every pulse at its time, until the trigger is dropped.
    fn end_pulses(&self) {
        let mut state = self.lock();
        while !state.over {
            let Some(rise) = state.rise else {
                state = self.wait(state, Duration::MAX);
                continue;
            };
            // From the reading before the rise to the reading before the fall: both edges are
            // delayed alike by their system calls.
            let ends = rise.0 + state.width;
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
            if let Some(spoiled) = Spoiled::by(&Edges { rise, fall }, state.width) {
                keep_latest(&mut state.spoiled, spoiled);
            }
        }
    }

    fn wait<'a>(&self, state: MutexGuard<'a, State>, time: Duration) -> MutexGuard<'a, State> {
        let woken = self.changed.wait_timeout(state, time);
        woken.unwrap_or_else(PoisonError::into_inner).0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trigger::REMEMBERED;

    const WIDTH: Duration = Duration::from_millis(20);
    /// How long an edge is interrupted.
    const STALL: Duration = Duration::from_millis(5);

    /// Fires one pulse on a line whose edges take so long. Returns its time, and the report of it
    /// if it was spoiled, fetched as soon as its falling edge has begun.
    fn first(rise: Duration, fall: Duration) -> (Timestamp, Option<Spoiled>) {
        let (ends, ended) = std::sync::mpsc::channel();
        let put = move |on: bool| {
            if !on {
                // The receiver is gone at the falling edge that the drop makes.
                let _ = ends.send(());
            }
            std::thread::sleep(if on { rise } else { fall });
            Ok(())
        };
        let mut pulse = Pulse::of(Box::new(put), WIDTH, || ()).unwrap();
        let fired = pulse.fire().unwrap();
        ended.recv().unwrap();
        let reported = pulse.poll_spoiled();
        assert_eq!(pulse.poll_spoiled(), None, "reported twice");
        (fired, reported)
    }

    #[test]
    fn a_pulse_with_an_interrupted_edge_is_told_once_it_ended_and_by_how_much_it_was_off() {
        // Other work of this computer can only make the error larger.
        let (fired, reported) = first(STALL, Duration::ZERO);
        let reported = reported.expect("an interrupted rise");
        assert_eq!((reported.fired, reported.width), (fired, WIDTH));
        assert!(
            reported.shorter >= STALL || reported.longer >= STALL,
            "{reported:?}"
        );
        let (fired, reported) = first(Duration::ZERO, STALL);
        let reported = reported.expect("an interrupted fall");
        assert_eq!((reported.fired, reported.width), (fired, WIDTH));
        assert!(reported.longer >= STALL, "{reported:?}");
    }

    #[test]
    fn a_pulse_that_sets_the_exposure_lasts_as_much_longer_and_one_that_starts_it_does_not() {
        let us = Duration::from_micros;
        for (width, twice) in [(us(16_653), us(33_320)), (us(100), us(100))] {
            let mut pulse = Pulse::of(Box::new(|_| Ok(())), width, || ()).unwrap();
            for (times, wanted) in [(2, twice), (1, width)] {
                pulse.expose(us(16_667), times);
                assert_eq!(pulse.line.lock().width, wanted);
            }
        }
    }

    #[test]
    fn a_trigger_that_nobody_asks_remembers_its_latest_spoiled_pulses_only() {
        let fall = Duration::from_millis(1);
        let put = move |on| {
            std::thread::sleep(if on { Duration::ZERO } else { fall });
            Ok(())
        };
        let mut pulse = Pulse::of(Box::new(put), Duration::from_micros(1), || ()).unwrap();
        let mut fired = Vec::new();
        for _ in 0..REMEMBERED + 3 {
            fired.push(pulse.fire().unwrap());
            while pulse.line.lock().rise.is_some() {
                std::thread::yield_now();
            }
        }
        let reported: Vec<_> = std::iter::from_fn(|| pulse.poll_spoiled()).collect();
        let reported: Vec<_> = reported.iter().map(|spoiled| spoiled.fired).collect();
        assert_eq!(reported, fired[3..]);
    }
}
