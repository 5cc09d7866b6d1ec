//! One write of the PLC: fields first, then the CONTROL bits in their order, the trigger last.

use super::control::{self, BY_PART_NUMBER, ControlWrite};
use super::event::{Effect, Effects, RecipeKey, RecipeResult};
use super::machine::{Station, log, push};
use super::state::{ClearedBy, Micros, State};

/// REJECT_REASON, register 120: why the last rejected request was rejected.
pub mod reject {
    /// The station is busy, boots or stops.
    pub const NOT_READY: u16 = 1;
    /// The PLC does not ask for ONLINE.
    pub const OFFLINE: u16 = 2;
    /// No recipe is active.
    pub const NO_RECIPE: u16 = 3;
    /// The config does not let the PLC teach.
    pub const TEACH_NOT_ALLOWED: u16 = 4;
    /// The station has a fault, or the number of a result is still to be stored.
    pub const FAULT: u16 = 5;
}

impl Station {
    pub(super) fn plc_write(
        &mut self,
        write: &ControlWrite,
        rising: u16,
        now: Micros,
        effects: &mut Effects,
    ) {
        let before = self.control;
        self.control = before.written(write);
        if self.control.plc_heartbeat != before.plc_heartbeat {
            self.plc_seen = Some(now);
        }
        let rose = |bit: u16| rising & bit != 0;
        if rose(control::ERROR_RESET) {
            self.reset(effects);
        }
        let stopping = matches!(self.state, State::Stopping { .. });
        if let Some(job) = self
            .state
            .job()
            .filter(|_| rose(control::ABORT) && !stopping)
        {
            push(effects, Effect::Abort { job });
        }
        if matches!(self.state, State::Ready | State::Offline) {
            self.state = self.rest();
        }
        if rose(control::RESULT_ACK) {
            self.result_valid = false;
            self.queue.pop_front();
        }
        if rose(control::RECIPE_LOAD) {
            self.plc_load(now, effects);
        }
        if rose(control::TEACH) {
            self.plc_teach(now, effects);
        }
        // The token is compared with the last accepted one, whatever connection it comes from: a retry never measures twice.
        let token = write
            .token
            .filter(|&token| token != 0 && token != self.last_token);
        if rose(control::TRIGGER) || token.is_some() {
            match self.refusal() {
                None => self.begin(token.unwrap_or(0), now, effects),
                Some(reason) => {
                    self.reject_reason = reason;
                    self.missed = self.missed.wrapping_add(1);
                    self.missed_latch = true;
                }
            }
        }
    }

    /// Why a trigger would be rejected now.
    fn refusal(&self) -> Option<u16> {
        if self.is_ready() {
            return None;
        }
        Some(match self.state {
            _ if !self.wants_online() => reject::OFFLINE,
            State::Fault(_) => reject::FAULT,
            State::Ready if self.recipe.is_none() => reject::NO_RECIPE,
            State::Ready => reject::FAULT,
            _ => reject::NOT_READY,
        })
    }

    /// Why a recipe cannot be loaded or taught now; it can be while offline.
    fn busy(&self) -> Option<u16> {
        match self.state {
            State::Ready | State::Offline => None,
            State::Fault(_) => Some(reject::FAULT),
            _ => Some(reject::NOT_READY),
        }
    }

    fn plc_load(&mut self, now: Micros, effects: &mut Effects) {
        let key = match self.control.recipe_select {
            0 => return,
            BY_PART_NUMBER => RecipeKey::PartNumber(self.control.part_number_text().into()),
            number => RecipeKey::Number(number),
        };
        if let Some(reason) = self.load(key, now, effects) {
            self.reject_reason = reason;
        }
    }

    /// Orders a load; answers with the reason if that cannot be.
    pub(super) fn load(
        &mut self,
        key: RecipeKey,
        now: Micros,
        effects: &mut Effects,
    ) -> Option<u16> {
        self.requested_recipe = match key {
            RecipeKey::Number(number) => number,
            RecipeKey::PartNumber(_) => BY_PART_NUMBER,
        };
        let refused = self.busy();
        if refused.is_some() {
            self.recipe_result = RecipeResult::Busy;
            log(
                effects,
                format!("a recipe cannot be loaded while {}", self.state.word()),
            );
        } else {
            let job = self.next_job();
            push(
                effects,
                Effect::Load {
                    job,
                    key: key.clone(),
                },
            );
            self.state = State::Loading {
                job,
                key,
                deadline: now.after(self.settings.limits.loading),
            };
        }
        refused
    }

    fn plc_teach(&mut self, now: Micros, effects: &mut Effects) {
        let number = match self.control.recipe_select {
            0 | BY_PART_NUMBER => self.recipe.as_ref().map(|recipe| recipe.number),
            number => Some(number),
        };
        let reason = match number {
            _ if !self.settings.teach_allowed => Some(reject::TEACH_NOT_ALLOWED),
            None => Some(reject::NO_RECIPE),
            Some(number) => self.teach(number, now, effects),
        };
        if let Some(reason) = reason {
            self.reject_reason = reason;
        }
    }

    /// Orders a teach; answers with the reason if that cannot be.
    pub(super) fn teach(&mut self, number: u16, now: Micros, effects: &mut Effects) -> Option<u16> {
        let refused = self.busy();
        if refused.is_some() {
            log(
                effects,
                format!(
                    "recipe {number} cannot be taught while {}",
                    self.state.word()
                ),
            );
        } else {
            let job = self.next_job();
            push(effects, Effect::Teach { job, number });
            let deadline = now.after(self.settings.limits.teaching);
            self.state = State::Teaching {
                job,
                number,
                fraction: 0.0,
                words: "starting".into(),
                deadline,
            };
        }
        refused
    }

    /// ERROR_RESET: the latches fall, and the fault if its cause is gone.
    fn reset(&mut self, effects: &mut Effects) {
        self.missed_latch = false;
        self.overflow_latch = false;
        self.failure = None;
        if let State::Fault(fault) = &self.state {
            if fault.cleared_by == ClearedBy::SignOfLife && self.last_alive > fault.since {
                log(
                    effects,
                    format!("fault {} cleared by ERROR_RESET", fault.code),
                );
                self.state = self.rest();
            } else {
                log(
                    effects,
                    format!(
                        "fault {} stays: {}; {}",
                        fault.code, fault.cause, fault.remedy
                    ),
                );
            }
        }
    }
}
