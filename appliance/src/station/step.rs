//! The step: `(station, event, now) → (station, effects)`, pure.

use super::error_code;
use super::event::{Effect, Effects, Event, JobId, RecipeResult, Request};
use super::machine::{BEAT, Station, log, push};
use super::state::{ActiveRecipe, ClearedBy, Fault, Micros, State};

/// Takes one event. Every state takes every event; an event that makes no sense in a state changes nothing and is logged.
///
/// `now` must not run backwards; if it does, the last time is kept.
pub fn step(mut station: Station, event: Event, now: Micros) -> (Station, Effects) {
    let mut effects = Effects::new();
    let now = now.max(station.now);
    station.now = now;
    if event.from_worker() {
        station.last_alive = now;
        station.lives(&mut effects);
    }
    match event {
        Event::Write { write, rising } => station.plc_write(&write, rising, now, &mut effects),
        Event::Request(Request::Load(key)) => {
            station.load(key, now, &mut effects);
        }
        Event::Request(Request::Teach {
            number,
            keep_gauges,
        }) => {
            station.teach(number, keep_gauges, now, &mut effects);
        }
        Event::Started => station.started(&mut effects),
        Event::ExposureDone { job } => station.exposed(job, now, &mut effects),
        Event::Finished { job, inspection } => station.finished(job, inspection, now, &mut effects),
        Event::MeasureFailed {
            job,
            error_code,
            message,
        } => station.measure_failed(job, error_code, message, now, &mut effects),
        Event::RecipeLoaded { job, recipe } => {
            if matches!(&station.state, State::Loading { job: awaited, .. } if *awaited == job) {
                station.requested_recipe = recipe.number;
                station.recipe_result = RecipeResult::Ok;
                station.recipe = Some(recipe);
                let unusable = |(code, _): &(u16, _)| *code == error_code::RECIPE_UNUSABLE;
                station.failure = station.failure.take().filter(|failure| !unusable(failure));
                station.state = station.rest();
            } else {
                station.late("a loaded recipe", job, &mut effects);
            }
        }
        Event::LoadFailed {
            job,
            result,
            message,
        } => {
            if matches!(&station.state, State::Loading { job: awaited, .. } if *awaited == job) {
                station.recipe_result = result;
                if result == RecipeResult::Corrupt {
                    station.failure = Some((error_code::RECIPE_UNUSABLE, message.clone()));
                }
                station.state = station.rest();
                log(&mut effects, message);
            } else {
                station.late("a failed load", job, &mut effects);
            }
        }
        Event::Progress {
            job,
            fraction: reached,
            words: doing,
        } => {
            let limit = station.settings.limits.teaching;
            match &mut station.state {
                State::Teaching {
                    job: awaited,
                    fraction,
                    words,
                    deadline,
                    ..
                } if *awaited == job => {
                    *fraction = if reached.is_finite() {
                        reached.clamp(0.0, 1.0)
                    } else {
                        *fraction
                    };
                    *words = doing;
                    *deadline = now.after(limit);
                }
                _ => station.late("progress", job, &mut effects),
            }
        }
        Event::Taught { job, recipe } => {
            if matches!(&station.state, State::Teaching { job: awaited, .. } if *awaited == job) {
                log(
                    &mut effects,
                    format!(
                        "taught recipe {} \"{}\", fingerprint {:08x}",
                        recipe.number, recipe.name, recipe.crc
                    ),
                );
                station.requested_recipe = recipe.number;
                station.recipe_result = RecipeResult::Ok;
                station.recipe = Some(recipe);
                station.failure = None;
                station.state = station.rest();
            } else {
                station.late("a taught recipe", job, &mut effects);
            }
        }
        Event::TeachFailed {
            job,
            error_code,
            message,
        } => {
            if matches!(&station.state, State::Teaching { job: awaited, .. } if *awaited == job) {
                station.failure = Some((named(error_code), message.clone()));
                station.state = station.rest();
                log(&mut effects, message);
            } else {
                station.late("a failed teach", job, &mut effects);
            }
        }
        Event::Condition(condition) => station.condition = condition,
        Event::Faulted {
            error_code,
            cause,
            remedy,
        } => {
            let cleared_by = ClearedBy::Recovery;
            station.fault(
                Fault {
                    code: named(error_code),
                    cause,
                    remedy,
                    since: now,
                    cleared_by,
                },
                now,
                &mut effects,
            );
        }
        Event::Recovered { recipe } => station.recovered(recipe, &mut effects),
        Event::Paced(pace) => station.health.paced(pace),
        Event::Surveyed(system) => station.surveyed(system, now, &mut effects),
        Event::Stored { seq, failed } => station.stored(seq, failed, now, &mut effects),
        Event::History { problem } => station.history_told(problem, &mut effects),
        Event::Alive => {}
        Event::Tick { utc_us } => station.tick(utc_us, now, &mut effects),
        Event::Stop => station.stop(&mut effects),
    }
    (station, effects)
}

/// A failure always has a code.
pub(super) fn named(error_code: u16) -> u16 {
    if error_code == 0 {
        error_code::UNNAMED
    } else {
        error_code
    }
}

impl Station {
    fn started(&mut self, effects: &mut Effects) {
        match &self.state {
            State::Boot { .. } => self.state = self.rest(),
            // It booted too slowly, but it booted; or it was started anew and holds no recipe any more.
            State::Fault(fault) if fault.cleared_by == ClearedBy::SignOfLife => {
                self.recipe = None;
                self.state = self.rest();
            }
            // The stop came while the head was being opened.
            State::Stopping { .. } => {}
            _ => log(effects, "the measuring task started twice; ignored"),
        }
    }

    /// A lost device is back, and the worker holds `recipe`.
    fn recovered(&mut self, recipe: Option<ActiveRecipe>, effects: &mut Effects) {
        let State::Fault(fault) = &self.state else {
            return;
        };
        if fault.cleared_by == ClearedBy::Recovery {
            log(
                effects,
                format!("recovered from error {}: {}", fault.code, fault.cause),
            );
            self.recipe = recipe;
            self.state = self.rest();
        }
    }

    /// The worker gave a sign of life.
    fn lives(&mut self, effects: &mut Effects) {
        if let State::Fault(fault) = &self.state
            && fault.cleared_by == ClearedBy::Life
        {
            log(effects, "the measuring task lives again");
            self.state = self.rest();
        }
    }

    /// An answer that nobody waits for: of an order that ran into its deadline, or from before.
    pub(super) fn late(&self, what: &str, job: JobId, effects: &mut Effects) {
        // A stop ends what is under way, and that it ended needs no remark.
        if matches!(self.state, State::Stopping { .. }) {
            return;
        }
        log(
            effects,
            format!(
                "{what} of job {} came while {}; ignored",
                job.0,
                self.state.word()
            ),
        );
    }

    /// Enters a fault; what was under way ends here.
    pub(super) fn fault(&mut self, fault: Fault, now: Micros, effects: &mut Effects) {
        let words = format!("fault {}: {}; {}", fault.code, fault.cause, fault.remedy);
        push(effects, Effect::Alarm(words.into()));
        match std::mem::replace(&mut self.state, State::Offline) {
            State::Acquiring { cycle, .. } | State::Processing { cycle, .. } => {
                self.fail_cycle(cycle, fault.code, fault.cause.clone(), now, effects);
            }
            // Nobody knows what the worker holds now: no recipe is better than half a recipe.
            State::Loading { .. } | State::Teaching { .. } => {
                self.recipe = None;
                self.recipe_result = RecipeResult::Busy;
            }
            State::Stopping { cycle } => {
                self.state = State::Stopping { cycle };
                return;
            }
            State::Boot { .. } | State::Ready | State::Offline | State::Fault(_) => {}
        }
        self.state = State::Fault(fault);
    }

    fn tick(&mut self, utc_us: Option<u64>, now: Micros, effects: &mut Effects) {
        self.utc_at_zero = utc_us.map(|utc| utc.saturating_sub(now.0));
        if self.worker_meets_deadlines(now) {
            let beats = (now.since(self.next_beat).0 / BEAT.0)
                .saturating_add(u64::from(self.next_beat <= now));
            // The register is the low 16 bits of the count.
            self.heartbeat = self.heartbeat.wrapping_add((beats & 0xFFFF) as u16);
            self.next_beat = self.next_beat.after(Micros(beats.saturating_mul(BEAT.0)));
        } else {
            // Beats that were missed are not made up for.
            self.next_beat = now.after(BEAT);
        }
        let limits = self.settings.limits;
        let (deadline, waiting_for, limit) = match &self.state {
            State::Boot { deadline } => (deadline, "open the head", limits.boot),
            State::Acquiring { deadline, .. } => {
                (deadline, "expose the sequence", limits.acquiring)
            }
            State::Processing { deadline, .. } => {
                (deadline, "process the frames", limits.processing)
            }
            State::Loading { deadline, .. } => (deadline, "load a recipe", limits.loading),
            State::Teaching { deadline, .. } => (deadline, "get on with teaching", limits.teaching),
            State::Ready | State::Offline => {
                self.watch_idle(now, effects);
                return;
            }
            State::Fault(_) | State::Stopping { .. } => return,
        };
        if now > *deadline {
            let job = self.state.job();
            let fault = self.deadline_fault(waiting_for, limit, now);
            self.fault(fault, now, effects);
            if let Some(job) = job {
                push(effects, Effect::Abort { job });
            }
        }
    }

    /// The history fails or works again: a warning, no fault. Verdicts go on.
    fn history_told(&mut self, problem: Option<std::sync::Arc<str>>, effects: &mut Effects) {
        self.history_fails = problem.is_some();
        let works = || "the history is written again".into();
        log(effects, problem.unwrap_or_else(works));
    }

    /// A worker without orders that gives no sign of life would not take one either.
    fn watch_idle(&mut self, now: Micros, effects: &mut Effects) {
        let silent = now.since(self.last_alive);
        if silent > self.settings.limits.silent {
            let fault = Fault {
                code: error_code::DEADLINE,
                cause: format!(
                    "the measuring task gave no sign of life for {} ms",
                    silent.0 / 1000
                )
                .into(),
                remedy:
                    "it clears by itself with the next sign of life; if it stays, restart fringed"
                        .into(),
                since: now,
                cleared_by: ClearedBy::Life,
            };
            self.fault(fault, now, effects);
        }
    }

    fn stop(&mut self, effects: &mut Effects) {
        if let Some(job) = self
            .state
            .job()
            .filter(|_| !matches!(self.state, State::Stopping { .. }))
        {
            push(effects, Effect::Abort { job });
        }
        self.state = match std::mem::replace(&mut self.state, State::Offline) {
            State::Acquiring { cycle, .. } | State::Processing { cycle, .. } => {
                State::Stopping { cycle: Some(cycle) }
            }
            State::Stopping { cycle } => State::Stopping { cycle },
            _ => State::Stopping { cycle: None },
        };
    }
}
