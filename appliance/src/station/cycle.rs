//! The cycle: from an accepted trigger to its one result.

use std::sync::Arc;

use super::control;
use super::event::{Effect, Effects, Job, JobId};
use super::machine::{Station, log, push};
use super::result::{Inspection, ResultRecord, Verdict};
use super::stages::Stages;
use super::state::{Cycle, Micros, State};
use super::step::named;

impl Station {
    /// Accepts a trigger: latches what belongs to it and orders the measurement. Only while READY.
    pub(super) fn begin(&mut self, token: u16, now: Micros, effects: &mut Effects) {
        let Some(recipe) = self.recipe.clone() else {
            return;
        };
        let job = self.next_job();
        let (part_id, press_stroke) = (self.control.part_id, self.control.press_stroke);
        self.triggers = self.triggers.wrapping_add(1);
        if token != 0 {
            self.last_token = token;
        }
        self.exposure_done = false;
        self.result_valid = false;
        push(
            effects,
            Effect::Measure(Job {
                job,
                token,
                part_id,
                press_stroke,
                recipe: recipe.clone(),
                accepted: now,
            }),
        );
        let cycle = Cycle {
            job,
            token,
            part_id,
            press_stroke,
            recipe,
            accepted: now,
            exposed: None,
        };
        self.state = State::Acquiring {
            cycle,
            deadline: now.after(self.settings.limits.acquiring),
        };
    }

    pub(super) fn exposed(&mut self, job: JobId, now: Micros, effects: &mut Effects) {
        match std::mem::replace(&mut self.state, State::Offline) {
            State::Acquiring { mut cycle, .. } if cycle.job == job => {
                cycle.exposed = Some(now);
                self.exposure_done = true;
                self.state = State::Processing {
                    cycle,
                    deadline: now.after(self.settings.limits.processing),
                };
            }
            other => {
                self.state = other;
                self.late("exposure done", job, effects);
            }
        }
    }

    pub(super) fn finished(
        &mut self,
        job: JobId,
        inspection: Arc<Inspection>,
        now: Micros,
        effects: &mut Effects,
    ) {
        if let Some(cycle) = self.take_cycle(job, "a result", effects) {
            if inspection.error_code == 0 {
                self.failure = None;
            }
            self.publish(cycle, inspection, now, effects);
        }
    }

    pub(super) fn measure_failed(
        &mut self,
        job: JobId,
        error_code: u16,
        message: Arc<str>,
        now: Micros,
        effects: &mut Effects,
    ) {
        if let Some(cycle) = self.take_cycle(job, "a failed measurement", effects) {
            log(effects, message.clone());
            self.fail_cycle(cycle, named(error_code), message, now, effects);
        }
    }

    /// Ends a cycle with an INVALID result that says why.
    pub(super) fn fail_cycle(
        &mut self,
        cycle: Cycle,
        error_code: u16,
        reason: Arc<str>,
        now: Micros,
        effects: &mut Effects,
    ) {
        self.failure = Some((error_code, reason.clone()));
        let inspection = Inspection {
            judged: Verdict::Invalid,
            error_code,
            reason: Some(reason),
            ..Default::default()
        };
        self.publish(cycle, Arc::new(inspection), now, effects);
    }

    /// The cycle that `job` answers for, taken out of the state; the state becomes the one after it.
    fn take_cycle(&mut self, job: JobId, what: &str, effects: &mut Effects) -> Option<Cycle> {
        match std::mem::replace(&mut self.state, State::Offline) {
            State::Acquiring { cycle, .. } | State::Processing { cycle, .. }
                if cycle.job == job =>
            {
                self.state = self.rest();
                Some(cycle)
            }
            State::Stopping { cycle: Some(cycle) } if cycle.job == job => {
                self.state = State::Stopping { cycle: None };
                Some(cycle)
            }
            other => {
                self.state = other;
                self.late(what, job, effects);
                None
            }
        }
    }

    /// The result as one unit: block, RESULT_VALID, RESULT_TOGGLE, SEQ, queue.
    fn publish(
        &mut self,
        cycle: Cycle,
        inspection: Arc<Inspection>,
        now: Micros,
        effects: &mut Effects,
    ) {
        let verdict = inspection.verdict();
        let total = now.since(cycle.accepted);
        self.last_seq = self.last_seq.wrapping_add(1);
        let record = Arc::new(ResultRecord {
            seq: self.last_seq,
            token: cycle.token,
            recipe: cycle.recipe.number,
            recipe_name: cycle.recipe.name,
            recipe_crc: cycle.recipe.crc,
            part_id: cycle.part_id,
            press_stroke: cycle.press_stroke,
            verdict,
            error_code: inspection.error_code,
            time_utc_us: self
                .utc_at_zero
                .map_or(0, |zero| zero.saturating_add(cycle.accepted.0)),
            uptime_s: cycle.accepted.seconds(),
            boot_id: self.settings.boot_id,
            exposure_us: cycle
                .exposed
                .map_or(total, |exposed| exposed.since(cycle.accepted))
                .to_u32(),
            total_us: total.to_u32(),
            inspection,
        });
        let stages = record.stages();
        if stages != Stages::default() {
            self.health.processed(stages.processing_us());
        }
        push(effects, Effect::PersistSeq(record.seq));
        push(effects, Effect::Publish(record.clone()));
        if self.control.control & control::BUFFERED != 0
            && self.queue.push_back(record.clone()).is_err()
        {
            self.overflow_latch = true;
            log(
                effects,
                format!(
                    "result {} was not queued: {} results wait for RESULT_ACK",
                    record.seq,
                    self.queue.len()
                ),
            );
        }
        self.result = Some(record);
        self.result_valid = true;
        self.result_toggle = !self.result_toggle;
        self.exposure_done = true;
    }
}
