//! A cycle of the measuring task: one sequence after the other until one is good enough, then the
//! result.

use super::{ABORTED, DEVICE_TIMEOUT, Worker};
use crate::error::code_of;
use crate::history::JudgedPart;
use crate::recipe::plan::{Arriving, Plan};
use crate::station::result::flag::{RETRIED, STEPPED_UP, WARM_UP};
use crate::station::snapshot::warning;
use crate::station::{
    Event, Inspection, Job, JobId, Pace, ResultRecord, Stage, Stages, error_code,
};
use crate::system::computing::timed_on;
use hal::frame::Frame;
use hal::head::Exposure;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// So often a sequence is taken again whose light changed too much.
const RETAKES: u32 = 2;

/// The sequence that a part was judged by.
#[derive(Default)]
pub struct JudgedBy {
    /// Index among the recipe's sequences.
    pub sequence: usize,
    /// The frames of the sequence; empty if the part was not judged.
    pub frames: Vec<Frame>,
}

impl Worker {
    /// Runs a cycle; returns the frames that the part was judged by.
    pub(super) fn measure(&mut self, job: &Job) -> JudgedBy {
        let id = job.job;
        let Some(plan) = self.plan.clone() else {
            // Not reached: the station accepts triggers only with an active recipe, whose plan this
            // is.
            let message = "measure: no recipe is loaded: load or teach one".into();
            self.station.event(failed(id, error_code::RIG, message));
            return JudgedBy::default();
        };
        let plan = &plan;
        let (mut sequence, mut flags, mut cpu) = (0, 0, Duration::ZERO);
        let (mut stages, mut retakes) = (Stages::default(), 0);
        let waited = self.station.now().since(job.accepted);
        stages.add(Stage::Waiting, waited.to_u32());
        loop {
            let began = Instant::now();
            let mut arriving = plan.arriving(sequence);
            let taken = self.take(plan, sequence, &mut arriving, id);
            let Some((frames, exposure, spent)) = taken else {
                return JudgedBy::default();
            };
            cpu += spent;
            stages.add(Stage::Exposure, us(began.elapsed()));
            if exposure.retaken > 0 {
                flags |= RETRIED;
            }
            let (broken, spent) =
                timed_on(&self.pool, || plan.is_light_broken(&mut arriving, &frames));
            cpu += spent;
            if broken && retakes < RETAKES {
                self.progress
                    .log("measuring again: the light changed within the sequence");
                flags |= RETRIED;
                retakes += 1;
                continue;
            }
            let last = sequence + 1 >= plan.sequence_count();
            // Not before the judgement if another sequence may follow: the part must stay in place
            // until then.
            if last {
                self.station.event(Event::ExposureDone { job: id });
            }
            let inspect = || plan.inspect_arrived(&frames, arriving, Instant::now());
            let (mut inspection, spent) = timed_on(&self.pool, inspect);
            cpu += spent;
            stages.extend(&inspection.stages);
            if let Some(reason) = inspection.step_up.filter(|_| !last) {
                self.progress
                    .log(&format!("measuring again with more frames: {reason}"));
                flags |= STEPPED_UP;
                sequence += 1;
                continue;
            }
            if !last {
                self.station.event(Event::ExposureDone { job: id });
            }
            inspection.flags |= flags;
            if exposure.retaken > 0 {
                inspection.warnings |= warning::FRAME_SLIP;
            }
            if retakes > 0 {
                inspection.warnings |= warning::UNSTEADY_LIGHT;
            }
            if self.warm_up.is_under_way() {
                inspection.flags |= WARM_UP;
            }
            if inspection.error_code == error_code::OUT_OF_PLACE {
                // A head that was knocked sees each part out of place.
                self.watch.due.suspect();
            }
            inspection.stages = stages;
            inspection.cpu_us = us(cpu);
            let judged_by = JudgedBy { sequence, frames };
            self.publish(id, inspection, plan, &judged_by);
            return judged_by;
        }
    }

    /// Takes the frames of a sequence and decodes each level on arrival; the time is the
    /// processor's for decoding. `None` if frames are missing; the station has then got the reason.
    fn take(
        &mut self,
        plan: &Plan,
        sequence: usize,
        arriving: &mut Arriving,
        job: JobId,
    ) -> Option<(Vec<Frame>, Exposure, Duration)> {
        let indices = plan.indices(sequence);
        let mut frames: Vec<Frame> = Vec::with_capacity(indices.len());
        let mut spent = Duration::ZERO;
        let (station, aborts, pool) = (&self.station, &self.aborts, &self.pool);
        let pulse = &self.pulse;
        let mut keep = |_, frame| {
            frames.push(frame);
            station.event(Event::Alive);
            pulse.beat();
            while plan.can_arrive(arriving, frames.len()) {
                spent += timed_on(pool, || plan.arrive(arriving, &frames)).1;
            }
            !aborts.has(job)
        };
        let head = &mut self.opened.head;
        match head.acquire_while(indices, DEVICE_TIMEOUT, &mut keep) {
            Ok(_) if frames.len() < indices.len() => {
                let message = format!("measure: {ABORTED}: trigger again");
                self.station
                    .event(failed(job, error_code::ABORTED, message));
                None
            }
            Ok(exposure) => {
                self.paced(indices.len(), &exposure);
                Some((frames, exposure, spent))
            }
            Err(error) => {
                let failed = failed(job, code_of(&error), error.to_string());
                self.fail(error, failed);
                None
            }
        }
    }

    /// Hands the result to the station, and the frames of a part that did not pass to the history.
    fn publish(&self, job: JobId, inspection: Inspection, plan: &Arc<Plan>, judged_by: &JudgedBy) {
        let inspection = Arc::new(inspection);
        let after = self.station.event(Event::Finished {
            job,
            inspection: inspection.clone(),
        });
        // The station ignores an inspection that it no longer waits for.
        let published = |record: &Arc<ResultRecord>| Arc::ptr_eq(&record.inspection, &inspection);
        if let Some(record) = after.result.clone().filter(published) {
            self.history.keep(&record, || JudgedPart {
                record: record.clone(),
                sequence: judged_by.sequence,
                frames: judged_by.frames.clone(),
                plan: plan.clone(),
                calibration: self.opened.calibration.clone(),
            });
        }
    }

    /// Reports how well the head kept its timing.
    fn paced(&self, frames: usize, exposure: &Exposure) {
        let span = exposure.done.since(exposure.started).as_secs_f64();
        let refresh = self.opened.head.refresh().as_secs_f64();
        // Saturating casts; a span of 0 gives the largest number.
        self.station.event(Event::Paced(Pace {
            camera_centihertz: (frames.saturating_sub(1) as f64 / span * 100.0) as u32,
            refresh_millihertz: (1000.0 / refresh).round() as u32,
            lag_us: us(exposure.lag),
            dropped: exposure.dropped,
            missed_flips: exposure.missed_flips,
            retaken: exposure.retaken,
            sync_error_us: us(exposure.sync_error),
        }));
    }
}

/// µs, saturating at about 71 minutes.
fn us(time: Duration) -> u32 {
    u32::try_from(time.as_micros()).unwrap_or(u32::MAX)
}

fn failed(job: JobId, error_code: u16, message: String) -> Event {
    Event::MeasureFailed {
        job,
        error_code,
        message: message.into(),
    }
}
