//! The step: `(station, event, now) → (station, effects)`, pure.
//!
//! In a write of the PLC the fields act first, then the CONTROL bits in their order, the trigger last.

use super::clock::Micros;
use super::control::{self, ControlWrite};
use super::error_code;
use super::event::{Effect, Effects, Event, Request};
use super::fault::{ClearedBy, Fault};
use super::machine::{Station, push};
use super::snapshot::reject;
use super::state::State;
use super::triggers::{Client, Trigger};

/// Takes one event. Every state takes every event; an event that makes no sense in a state changes
/// nothing and is logged.
///
/// `now` must not run backwards; if it does, the last time is kept.
pub fn step(mut station: Station, event: Event, now: Micros) -> (Station, Effects) {
    let mut effects = Effects::new();
    station.clock.advance(now);
    if event.from_worker() {
        station.lives(&mut effects);
    }
    station.take(event, &mut effects);
    (station, effects)
}

impl Station {
    fn take(&mut self, event: Event, effects: &mut Effects) {
        match event {
            Event::Write {
                write,
                rising,
                client,
            } => self.written(&write, rising, client, effects),
            Event::Request(Request::Trigger(trigger)) => self.triggered(&trigger, effects),
            Event::Request(Request::Load(key)) => {
                self.load(key, effects);
            }
            Event::Request(Request::Teach(teaching)) => {
                self.teach(teaching, effects);
            }
            Event::Request(Request::Commission) => self.commission(effects),
            Event::Request(Request::EndStep) => self.end_step(effects),
            Event::Started => self.started(effects),
            Event::ExposureDone { job } => self.exposed(job, effects),
            Event::Finished { job, inspection } => self.finished(job, inspection, effects),
            Event::MeasureFailed {
                job,
                error_code,
                message,
            } => {
                self.measure_failed(job, error_code, message, effects);
            }
            Event::RecipeLoaded { job, recipe } => self.loaded(job, recipe, effects),
            Event::LoadFailed {
                job,
                result,
                message,
            } => {
                self.load_failed(job, result, message, effects);
            }
            Event::Progress {
                job,
                fraction,
                words,
            } => {
                self.progress(job, fraction, words, effects);
            }
            Event::Taught { job, recipe } => self.taught(job, recipe, effects),
            Event::TeachFailed {
                job,
                error_code,
                message,
            } => {
                self.teach_failed(job, error_code, message, effects);
            }
            Event::Commissioned { job, recipe } => self.commissioned(job, recipe, effects),
            Event::Condition(condition) => self.condition = condition,
            Event::Faulted {
                error_code,
                cause,
                remedy,
            } => {
                let fault = Fault {
                    code: error_code::or_unnamed(error_code),
                    cause,
                    remedy,
                    since: self.clock.now(),
                    cleared_by: ClearedBy::Recovery,
                };
                self.fault(fault, effects);
            }
            Event::Recovered { recipe } => self.recovered(recipe, effects),
            Event::Paced(pace) => self.health.paced(pace),
            Event::Projector(projector) => self.health.projector = projector,
            Event::CameraTemperature(celsius) => self.health.camera_temperature_c = celsius,
            Event::Drift(drift) => self.health.drift = drift,
            Event::Surveyed(system) => self.surveyed(system, effects),
            Event::Stored { seq, failed } => self.stored(seq, failed, effects),
            Event::History { problem } => self.history_changed(problem, effects),
            Event::Alive => {}
            Event::Tick { utc_us } => self.tick(utc_us, effects),
            Event::Stop => self.stop(effects),
        }
    }

    fn stop(&mut self, effects: &mut Effects) {
        self.abort(effects);
        let cycle = match std::mem::replace(&mut self.state, State::Offline) {
            State::Acquiring { cycle, .. } | State::Processing { cycle, .. } => Some(cycle),
            State::Stopping { cycle: Some(cycle) } => {
                let words = "measure: the stop ended it before the measuring task answered: trigger again after the start";
                self.fail_cycle(cycle, error_code::ABORTED, words.into(), effects);
                None
            }
            _ => None,
        };
        self.state = State::Stopping { cycle };
    }
}

impl Station {
    /// Takes a write; `rising` are the CONTROL bits that rose on its connection.
    pub(super) fn written(
        &mut self,
        write: &ControlWrite,
        rising: u16,
        client: Client,
        effects: &mut Effects,
    ) {
        self.plc.write(write, self.clock.now());
        let rose = |bit: u16| rising & bit != 0;
        if rose(control::ERROR_RESET) {
            self.reset(effects);
        }
        if rose(control::ABORT) {
            self.abort(effects);
        }
        if matches!(self.state, State::Ready | State::Offline) {
            self.state = self.rest();
        }
        let mut buffering = self.plc.holds(control::BUFFERED) && self.results.buffer();
        if rose(control::UNBUFFERED) {
            buffering |= self.results.buffered.take().is_some();
        }
        if rose(control::RESULT_ACK) {
            buffering |= self.results.acknowledge();
        }
        if buffering {
            push(effects, Effect::Buffered(self.results.buffered));
        }
        if rose(control::RECIPE_LOAD) {
            self.plc_load(client, effects);
        }
        if rose(control::TEACH) {
            self.plc_teach(client, effects);
        }
        let token = self.requests.new_token(write.token);
        if rose(control::TRIGGER) || token.is_some() {
            let trigger = Trigger {
                client,
                token: token.unwrap_or(0),
                ..Trigger::default()
            };
            self.triggered(&trigger, effects);
        }
    }

    /// Takes a trigger, or counts it as missed.
    fn triggered(&mut self, trigger: &Trigger, effects: &mut Effects) {
        let (now, client) = (self.clock.now(), trigger.client);
        let active = self.recipes.active.as_ref().map(|recipe| recipe.number);
        let other = trigger.recipe.is_some() && trigger.recipe != active;
        match self.refusal().or(other.then_some(reject::OTHER_RECIPE)) {
            None if self.turns.may(client, now) => {
                self.turns.granted(client);
                self.begin(trigger, effects);
            }
            None => self.requests.miss(reject::NOT_READY),
            Some(reason) => {
                if reason == reject::NOT_READY {
                    self.turns.rejected(client, now);
                }
                self.requests.miss(reason);
            }
        }
    }

    /// Asks the worker to end its job early; a station that stops has done so already.
    pub(super) fn abort(&self, effects: &mut Effects) {
        if let Some(job) = self.job()
            && !matches!(self.state, State::Stopping { .. })
        {
            push(effects, Effect::Abort { job });
        }
    }
}
