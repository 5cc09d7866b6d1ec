//! One write of the PLC: fields first, then the CONTROL bits in their order, the trigger last.

use super::control::{self, BY_PART_NUMBER, ControlWrite};
use super::event::{Effect, Effects, RecipeKey, RecipeResult};
use super::machine::{Station, log, push};
use super::refusal::reject;
use super::state::{ClearedBy, Micros, State};

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

    /// Why a recipe cannot be loaded or taught now; it can be while offline.
    fn busy(&self) -> Option<u16> {
        match self.state {
            State::Ready | State::Offline => None,
            State::Fault(_) => Some(reject::FAULT),
            _ => Some(reject::NOT_READY),
        }
    }

    fn plc_load(&mut self, now: Micros, effects: &mut Effects) {
        let select = self.control.recipe_select;
        let key = match select {
            0 => return,
            BY_PART_NUMBER => RecipeKey::PartNumber(self.control.part_number_text().into()),
            number => RecipeKey::Number(number),
        };
        if let Some(reason) = self.load(key, now, effects) {
            self.requested_recipe = select;
            self.recipe_result = RecipeResult::Busy;
            self.reject_reason = reason;
        }
    }

    /// Orders a load; answers with the reason if that cannot be, and then nothing has changed.
    pub(super) fn load(
        &mut self,
        key: RecipeKey,
        now: Micros,
        effects: &mut Effects,
    ) -> Option<u16> {
        let refused = self.busy();
        if refused.is_some() {
            log(
                effects,
                format!("a recipe cannot be loaded while {}", self.state.word()),
            );
        } else {
            self.requested_recipe = match key {
                RecipeKey::Number(number) => number,
                RecipeKey::PartNumber(_) => BY_PART_NUMBER,
            };
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
        let active = self.recipe.as_ref().map(|recipe| recipe.number);
        let reason = match (self.control.recipe_select, active) {
            _ if !self.settings.teach_allowed => Some(reject::TEACH_NOT_ALLOWED),
            (0 | BY_PART_NUMBER, None) => Some(reject::NO_RECIPE),
            // It would replace the recipe of another part.
            (0 | BY_PART_NUMBER, Some(_)) if self.is_other_recipe_asked_for() => {
                Some(reject::OTHER_RECIPE)
            }
            // The PLC chose the number; what had it stays as the generation before.
            (0 | BY_PART_NUMBER, Some(number)) | (number, _) => {
                self.teach(number, false, now, effects)
            }
        };
        if let Some(reason) = reason {
            self.reject_reason = reason;
        }
    }

    /// Orders a teach; answers with the reason if that cannot be.
    pub(super) fn teach(
        &mut self,
        number: u16,
        keep_gauges: bool,
        now: Micros,
        effects: &mut Effects,
    ) -> Option<u16> {
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
            push(
                effects,
                Effect::Teach {
                    job,
                    number,
                    keep_gauges,
                },
            );
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
