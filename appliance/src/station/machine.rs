//! What the station remembers between two events, its settings, and the few changes that several
//! events share.
//!
//! A measuring task (the worker) that is silent for longer than its [`Limits`] is stuck: fault 801.

use super::clock::{Clock, Micros};
use super::control::{self, Plc};
use super::event::{Condition, Effect, Effects, JobId, MAX_EFFECTS};
use super::fault::LastFailure;
use super::health::Health;
use super::recipes::Recipes;
use super::results::{Buffered, Results};
use super::state::State;
use super::triggers::{Requests, Turns};
use serde::Serialize;
use std::sync::Arc;

/// The HEARTBEAT register advances once in this time.
const BEAT: Micros = Micros::from_millis(100);

/// The worker as seen from the station.
#[derive(Debug, Clone)]
pub(super) struct WorkerState {
    /// The last order.
    pub(super) last_job: JobId,
    /// The time of its last event.
    pub(super) last_alive: Micros,
    /// HEARTBEAT.
    pub(super) heartbeat: u16,
    next_beat: Micros,
}

impl WorkerState {
    /// A worker that was started at `now` and has no orders yet.
    pub(super) fn new(now: Micros) -> Self {
        Self {
            last_job: JobId(0),
            last_alive: now,
            heartbeat: 0,
            next_beat: now.after(BEAT),
        }
    }

    /// The number of a new order.
    pub(super) fn next_job(&mut self) -> JobId {
        self.last_job = JobId(self.last_job.0.wrapping_add(1));
        self.last_job
    }

    /// Advances HEARTBEAT to `now`, or holds it while the worker misses its deadlines. Beats missed
    /// that way are not made up for.
    pub(super) fn beat(&mut self, in_time: bool, now: Micros) {
        if !in_time {
            self.next_beat = now.after(BEAT);
        } else if self.next_beat <= now {
            let beats = now.since(self.next_beat).0 / BEAT.0 + 1;
            // The register is the low 16 bits of the count.
            self.heartbeat = self.heartbeat.wrapping_add((beats & 0xFFFF) as u16);
            self.next_beat = self.next_beat.after(Micros(beats.saturating_mul(BEAT.0)));
        }
    }
}

/// How long the worker may be silent, by what it does: a slow one tells how far it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Limits {
    /// The worker opens its head.
    pub boot: Micros,
    /// Trigger → exposure done.
    pub acquiring: Micros,
    /// Exposure done → result.
    pub processing: Micros,
    /// Loading, teaching and commissioning.
    pub changing: Micros,
    /// While it waits for orders, before HEARTBEAT stands still.
    pub idle: Micros,
    /// While it waits for orders, before that is a fault.
    pub silent: Micros,
    /// PLC_HEARTBEAT may stand still for this long.
    pub plc: Micros,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            boot: Micros::from_millis(30_000),
            acquiring: Micros::from_millis(10_000),
            processing: Micros::from_millis(10_000),
            changing: Micros::from_millis(30_000),
            idle: Micros::from_millis(1_000),
            silent: Micros::from_millis(10_000),
            plc: Micros::from_millis(5_000),
        }
    }
}

/// Names of this device.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Identity {
    /// For FC43/14.
    #[serde(skip)]
    pub vendor: String,
    /// For FC43/14.
    pub product: String,
    /// At most 32 ASCII characters are shown.
    pub serial: String,
    /// At most 32 ASCII characters are shown.
    pub version: String,
}

/// What does not change after the start.
#[derive(Debug, Clone)]
pub struct Settings {
    /// The SEQ of the next result: one more than the last that was stored.
    pub next_seq: u32,
    /// What the run before has left of BUFFERED mode.
    pub buffered: Buffered,
    /// BOOT_ID: random, new with each start.
    pub boot_id: u32,
    /// Whether the PLC may teach.
    pub teach_allowed: bool,
    /// Names of this device.
    pub identity: Arc<Identity>,
    /// Deadlines.
    pub limits: Limits,
}

/// The station: plain values, each part with the transitions that only it decides.
/// [`super::step()`] is its only entry.
#[derive(Debug, Clone)]
pub struct Station {
    pub(super) settings: Settings,
    pub(super) clock: Clock,
    pub(super) state: State,
    pub(super) plc: Plc,
    pub(super) requests: Requests,
    pub(super) turns: Turns,
    pub(super) recipes: Recipes,
    pub(super) worker: WorkerState,
    pub(super) results: Results,
    pub(super) failure: Option<LastFailure>,
    /// The load, teach or step of commissioning in which the worker fell silent; it goes on with the
    /// next sign of life.
    pub(super) suspended: Option<State>,
    pub(super) condition: Condition,
    pub(super) health: Health,
    /// Whether the history cannot be written.
    pub(super) history_fails: bool,
}

impl Station {
    /// A station that boots at `now`.
    pub fn new(settings: Settings, now: Micros) -> Self {
        let mut clock = Clock::default();
        clock.advance(now);
        Self {
            clock,
            state: State::Boot {
                deadline: now.after(settings.limits.boot),
            },
            plc: Plc::default(),
            requests: Requests::default(),
            turns: Turns::default(),
            recipes: Recipes::default(),
            worker: WorkerState::new(now),
            results: Results::new(settings.next_seq, &settings.buffered),
            failure: None,
            suspended: None,
            condition: Condition::default(),
            health: Health::default(),
            history_fails: false,
            settings,
        }
    }

    /// What the station is doing.
    pub fn state(&self) -> &State {
        &self.state
    }

    /// The state between two jobs.
    pub(super) fn rest(&self) -> State {
        if self.plc.holds(control::ONLINE) {
            State::Ready
        } else {
            State::Offline
        }
    }

    /// The job that the worker is doing, or was doing when it fell silent.
    pub(super) fn job(&self) -> Option<JobId> {
        let suspended = self.suspended.as_ref();
        self.state.job().or_else(|| suspended?.job())
    }

    /// How long the worker may be silent in the present state.
    pub(super) fn limit(&self) -> Micros {
        let limits = &self.settings.limits;
        match self.state {
            State::Boot { .. } => limits.boot,
            State::Acquiring { .. } => limits.acquiring,
            State::Processing { .. } => limits.processing,
            State::Loading { .. } | State::Teaching { .. } | State::Commissioning { .. } => {
                limits.changing
            }
            State::Ready | State::Offline | State::Fault(_) | State::Stopping { .. } => {
                limits.silent
            }
        }
    }

    /// Whether the station is between two jobs.
    pub(super) fn is_at_rest(&self) -> bool {
        matches!(self.state, State::Ready | State::Offline)
    }

    /// The deadline of a wait that begins now.
    pub(super) fn within(&self, limit: Micros) -> Micros {
        self.clock.now().after(limit)
    }

    /// Whether the worker meets its deadlines: the deadline of the order that the station waits
    /// for; without an order, that of its signs of life.
    pub(super) fn worker_is_in_time(&self) -> bool {
        let now = self.clock.now();
        match self.state.deadline() {
            Some(deadline) => now <= deadline,
            None => now.since(self.worker.last_alive) <= self.settings.limits.idle,
        }
    }

    /// Logs an answer that nothing waits for: of an order that missed its deadline, or from before.
    pub(super) fn late(&self, what: &str, job: JobId, effects: &mut Effects) {
        // A stop ends what is under way; that it ended needs no line.
        if !matches!(self.state, State::Stopping { .. }) {
            let (job, state) = (job.0, self.state.word());
            log(
                effects,
                format!("{what} of job {job} came while {state}; ignored"),
            );
        }
    }
}

/// Queues an effect.
pub(super) fn push(effects: &mut Effects, effect: Effect) {
    // One event causes far fewer than the capacity; the random walk test holds that nothing is ever
    // dropped here.
    let pushed = effects.push(effect);
    debug_assert!(
        pushed.is_ok(),
        "more than {MAX_EFFECTS} effects of one event"
    );
}

/// Queues a line for the log.
pub(super) fn log(effects: &mut Effects, line: impl Into<Arc<str>>) {
    push(effects, Effect::Log(line.into()));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn late_ticks_are_made_up_for_and_missed_deadlines_are_not() {
        let mut worker = WorkerState::new(Micros(0));
        let ms = Micros::from_millis;
        worker.beat(true, ms(99));
        assert_eq!(worker.heartbeat, 0);
        worker.beat(true, ms(350));
        assert_eq!(worker.heartbeat, 3);
        worker.beat(false, ms(1000));
        worker.beat(true, ms(1099));
        assert_eq!(worker.heartbeat, 3);
        worker.beat(true, ms(1100));
        assert_eq!(worker.heartbeat, 4);
    }
}
