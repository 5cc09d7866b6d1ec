//! Faults: when worker, devices and storage put the station into one, and what takes it out.

use std::sync::Arc;

use super::clock::Micros;
use super::event::{Effect, Effects, Unstored};
use super::fault::{ClearedBy, Fault};
use super::health::{FULL_STORAGE_MIB, System};
use super::machine::{Station, log, push};
use super::recipes::ActiveRecipe;
use super::state::State;

/// Writes a fault into the log.
fn alarm(fault: &Fault, effects: &mut Effects) {
    let words = format!("fault {}: {}; {}", fault.code, fault.cause, fault.remedy);
    push(effects, Effect::Alarm(words.into()));
}

impl Station {
    /// Enters a fault; what was under way ends here. A station that stops only ends its cycle.
    pub(super) fn fault(&mut self, fault: Fault, effects: &mut Effects) {
        alarm(&fault, effects);
        match std::mem::replace(&mut self.state, State::Offline) {
            State::Acquiring { cycle, .. } | State::Processing { cycle, .. } => {
                self.fail_cycle(cycle, fault.code, fault.words(), effects);
            }
            State::Loading { .. } => self.recipes.interrupt(),
            // No other recipe was asked for: the one before may come back with the head.
            State::Teaching { .. } => self.recipes.active = None,
            State::Stopping { cycle } => {
                self.state = State::Stopping { cycle: None };
                if let Some(cycle) = cycle {
                    self.fail_cycle(cycle, fault.code, fault.words(), effects);
                }
                return;
            }
            State::Boot { .. }
            | State::Ready
            | State::Offline
            | State::Commissioning { .. }
            | State::Fault(_) => {}
        }
        self.state = State::Fault(fault);
    }

    /// The fault, if only this clears it.
    fn fault_cleared_by(&self, by: ClearedBy) -> Option<&Fault> {
        match &self.state {
            State::Fault(fault) if fault.cleared_by == by => Some(fault),
            _ => None,
        }
    }

    /// The worker has opened its head.
    pub(super) fn started(&mut self, effects: &mut Effects) {
        match &self.state {
            State::Boot { .. } => self.state = self.rest(),
            // It booted too slowly, but it booted; or it was started anew and holds no recipe any
            // more.
            State::Fault(fault) if fault.cleared_by == ClearedBy::SignOfLife => {
                self.recipes.active = None;
                self.state = self.rest();
            }
            // The stop came while the head was being opened.
            State::Stopping { .. } => {}
            _ => log(effects, "the measuring task started twice; ignored"),
        }
    }

    /// A lost device is back, and the worker holds `recipe`.
    pub(super) fn recovered(&mut self, recipe: Option<ActiveRecipe>, effects: &mut Effects) {
        if let Some(fault) = self.fault_cleared_by(ClearedBy::Recovery) {
            let (code, cause) = (fault.code, &fault.cause);
            log(effects, format!("recovered from error {code}: {cause}"));
            self.recipes.active = recipe;
            self.state = self.rest();
        }
    }

    /// The worker gave a sign of life: a load or teach in which it was silent goes on.
    pub(super) fn lives(&mut self, effects: &mut Effects) {
        let now = self.clock.now();
        self.worker.last_alive = now;
        if self.fault_cleared_by(ClearedBy::Life).is_some() {
            log(effects, "the measuring task lives again");
            self.state = self.suspended.take().unwrap_or_else(|| self.rest());
        }
        self.state.set_deadline(now.after(self.limit()));
    }

    /// ERROR_RESET: the latches fall, and the fault if its cause is gone.
    pub(super) fn reset(&mut self, effects: &mut Effects) {
        self.requests.reset();
        self.results.reset();
        self.failure = None;
        if let State::Fault(fault) = &self.state {
            let Fault {
                code,
                cause,
                remedy,
                ..
            } = fault;
            if fault.cleared_by == ClearedBy::SignOfLife && self.worker.last_alive > fault.since {
                log(effects, format!("fault {code} cleared by ERROR_RESET"));
                self.state = self.rest();
            } else {
                log(effects, format!("fault {code} stays: {cause}; {remedy}"));
            }
        }
    }

    /// Time passes: heartbeat, deadlines.
    pub(super) fn tick(&mut self, utc_us: Option<u64>, effects: &mut Effects) {
        let now = self.clock.now();
        self.clock.synchronise(utc_us);
        let in_time = self.worker_is_in_time();
        self.worker.beat(in_time, now);
        let limit = self.limit();
        let silent = now.since(self.worker.last_alive);
        let waiting_for = match &self.state {
            State::Boot { .. } => "open the head",
            State::Acquiring { .. } => "expose the sequence",
            State::Processing { .. } => "process the frames",
            State::Loading { .. } | State::Teaching { .. } | State::Commissioning { .. } => {
                if !in_time {
                    self.suspend(silent, effects);
                }
                return;
            }
            State::Ready | State::Offline => {
                // A worker without orders that gives no sign of life would not take one either.
                if silent > limit {
                    self.fault(Fault::silence(silent, now), effects);
                }
                return;
            }
            State::Fault(_) | State::Stopping { .. } => return,
        };
        if !in_time {
            let job = self.state.job();
            self.fault(Fault::deadline(waiting_for, limit, now), effects);
            if let Some(job) = job {
                push(effects, Effect::Abort { job });
            }
        }
    }

    /// The worker is silent in a load, a teach or a step of commissioning: a fault until its next
    /// sign of life, with which the job goes on. The recipe before stays the active one.
    fn suspend(&mut self, silent: Micros, effects: &mut Effects) {
        let fault = Fault::silence(silent, self.clock.now());
        alarm(&fault, effects);
        let suspended = std::mem::replace(&mut self.state, State::Fault(fault));
        self.suspended = Some(suspended);
    }

    /// Takes a survey: full storage is a fault between two jobs, and clears by itself when there is
    /// room again.
    pub(super) fn surveyed(&mut self, system: System, effects: &mut Effects) {
        let free = system.free_storage_mib;
        self.health.system = system;
        if self.results.unstored {
            // Tried until it succeeds; the answer comes as `Stored`.
            push(effects, Effect::PersistSeq(self.results.last_seq));
        }
        match free {
            Some(room) if room < FULL_STORAGE_MIB => {
                if self.is_at_rest() {
                    self.fault(Fault::storage_full(room, self.clock.now()), effects);
                }
            }
            _ => self.storage_settled(effects),
        }
    }

    /// Takes the answer to [`Effect::PersistSeq`].
    pub(super) fn stored(&mut self, seq: u32, failed: Option<Unstored>, effects: &mut Effects) {
        match failed {
            None => {
                self.results.stored(seq);
                if !self.health.storage_is_full() {
                    self.storage_settled(effects);
                }
            }
            Some(why) => {
                self.health.storage_failed();
                self.results.not_stored();
                if self.is_at_rest() {
                    self.fault(Fault::seq_not_stored(seq, why, self.clock.now()), effects);
                }
            }
        }
    }

    /// There is room, and the last number may be stored by now.
    fn storage_settled(&mut self, effects: &mut Effects) {
        if let Some(fault) = self.fault_cleared_by(ClearedBy::Storage)
            && !self.results.unstored
        {
            let code = fault.code;
            log(effects, format!("storage works again after error {code}"));
            self.state = self.rest();
        }
    }

    /// The history fails or works again: a warning, no fault. Verdicts go on.
    pub(super) fn history_changed(&mut self, problem: Option<Arc<str>>, effects: &mut Effects) {
        self.history_fails = problem.is_some();
        let works = || "the history is written again".into();
        log(effects, problem.unwrap_or_else(works));
    }
}
