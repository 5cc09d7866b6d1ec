//! The cycle: from an accepted trigger to its one result.

use std::sync::Arc;

use super::error_code;
use super::event::{Effect, Effects, Job, JobId};
use super::fault::LastFailure;
use super::machine::{Station, log, push};
use super::result::{Inspection, ResultRecord, Verdict};
use super::stages::Stages;
use super::state::{Cycle, State};
use super::triggers::Trigger;

impl Station {
    /// Accepts a trigger: latches what belongs to it and orders the measurement. Only while READY.
    pub(super) fn begin(&mut self, trigger: &Trigger, effects: &mut Effects) {
        let Some(recipe) = self.recipes.active.clone() else {
            return;
        };
        self.requests.accept(trigger.token);
        self.results.begin();
        let written = &self.plc.registers;
        let order = Job {
            job: self.worker.next_job(),
            token: trigger.token,
            request: trigger.request.clone(),
            part_id: trigger.part_id.unwrap_or(written.part_id),
            press_stroke: trigger.press_stroke.unwrap_or(written.press_stroke),
            recipe,
            accepted: self.clock.now(),
        };
        push(effects, Effect::Measure(order.clone()));
        self.state = State::Acquiring {
            cycle: Cycle {
                order,
                exposed: None,
            },
            deadline: self.within(self.settings.limits.acquiring),
        };
    }

    /// The last frame is exposed.
    pub(super) fn exposed(&mut self, job: JobId, effects: &mut Effects) {
        match std::mem::replace(&mut self.state, State::Offline) {
            State::Acquiring { mut cycle, .. } if cycle.order.job == job => {
                cycle.exposed = Some(self.clock.now());
                self.results.exposed();
                let deadline = self.within(self.settings.limits.processing);
                self.state = State::Processing { cycle, deadline };
            }
            other => {
                self.state = other;
                self.late("exposure done", job, effects);
            }
        }
    }

    /// The measurement ended with an inspection.
    pub(super) fn finished(
        &mut self,
        job: JobId,
        inspection: Arc<Inspection>,
        effects: &mut Effects,
    ) {
        if let Some(cycle) = self.take_cycle(job, "a result", effects) {
            if inspection.error_code == 0 || error_code::is_of_part(inspection.error_code) {
                self.failure = None;
            }
            self.condition.warnings = inspection.warnings;
            self.publish(cycle, inspection, effects);
        }
    }

    /// The measurement ended without an inspection.
    pub(super) fn measure_failed(
        &mut self,
        job: JobId,
        code: u16,
        words: Arc<str>,
        effects: &mut Effects,
    ) {
        if let Some(cycle) = self.take_cycle(job, "a failed measurement", effects) {
            log(effects, words.clone());
            self.fail_cycle(cycle, error_code::or_unnamed(code), words, effects);
        }
    }

    /// Ends a cycle with an INVALID result that says why.
    pub(super) fn fail_cycle(
        &mut self,
        cycle: Cycle,
        code: u16,
        words: Arc<str>,
        effects: &mut Effects,
    ) {
        let inspection = Inspection {
            judged: Verdict::Invalid,
            error_code: code,
            reason: Some(words.clone()),
            ..Default::default()
        };
        self.failure = Some(LastFailure { code, words });
        self.publish(cycle, Arc::new(inspection), effects);
    }

    /// The cycle that `job` answers for, taken out of the state; the state becomes the one after
    /// it.
    fn take_cycle(&mut self, job: JobId, what: &str, effects: &mut Effects) -> Option<Cycle> {
        match std::mem::replace(&mut self.state, State::Offline) {
            State::Acquiring { cycle, .. } | State::Processing { cycle, .. }
                if cycle.order.job == job =>
            {
                self.state = self.rest();
                Some(cycle)
            }
            State::Stopping { cycle: Some(cycle) } if cycle.order.job == job => {
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

    /// Makes the cycle's result and shows it as one unit.
    fn publish(&mut self, cycle: Cycle, inspection: Arc<Inspection>, effects: &mut Effects) {
        let Cycle { order, exposed } = cycle;
        let accepted = order.accepted;
        let total = self.clock.now().since(accepted);
        let exposure = exposed.map_or(total, |exposed| exposed.since(accepted));
        let record = Arc::new(ResultRecord {
            seq: self.results.next_seq(),
            token: order.token,
            request: order.request,
            recipe: order.recipe.number,
            recipe_name: order.recipe.name,
            recipe_crc: order.recipe.crc,
            part_id: order.part_id,
            press_stroke: order.press_stroke,
            verdict: inspection.verdict(),
            error_code: inspection.error_code,
            time_utc_us: self.clock.utc_us(accepted).unwrap_or(0),
            uptime_s: accepted.seconds(),
            boot_id: self.settings.boot_id,
            exposure_us: exposure.to_u32(),
            total_us: total.to_u32(),
            inspection,
        });
        let stages = record.stages();
        if stages != Stages::default() {
            self.health.processed(stages.processing_us());
        }
        push(effects, Effect::PersistSeq(record.seq));
        push(effects, Effect::Publish(record.clone()));
        let seq = record.seq;
        if !self.results.publish(record) {
            let waiting = self.results.queue.len();
            log(
                effects,
                format!("result {seq} was not queued: {waiting} results wait for RESULT_ACK"),
            );
        }
    }
}
