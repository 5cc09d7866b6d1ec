//! A change of recipe or head: a load, a teach or a step of commissioning, from its order to the
//! worker's answer.

use super::control::BY_PART_NUMBER;
use super::error_code;
use super::event::{Effect, Effects, JobId, PlcOrder, Teaching};
use super::fault::LastFailure;
use super::machine::{Station, log, push};
use super::recipes::{ActiveRecipe, RecipeKey, RecipeResult};
use super::snapshot::reject;
use super::state::{LoadProgress, State, TeachProgress};
use super::triggers::Client;
use std::sync::Arc;

/// Has what the PLC ordered recorded.
fn ordered(client: Client, order: PlcOrder, effects: &mut Effects) {
    if let Some(from) = client.address() {
        push(effects, Effect::Ordered { from, order });
    }
}

impl Station {
    /// RECIPE_LOAD: a load that is refused counts as one that failed, because the PLC may trigger
    /// without looking at the answer.
    pub(super) fn plc_load(&mut self, client: Client, effects: &mut Effects) {
        let select = self.plc.registers.recipe_select;
        let key = match select {
            0 => return,
            BY_PART_NUMBER => RecipeKey::PartNumber(self.plc.registers.part_number_text().into()),
            number => RecipeKey::Number(number),
        };
        match self.load(key.clone(), effects) {
            Some(reason) => {
                self.recipes.refuse(select);
                self.requests.reject(reason);
            }
            None => ordered(client, PlcOrder::Load(key), effects),
        }
    }

    /// TEACH.
    pub(super) fn plc_teach(&mut self, client: Client, effects: &mut Effects) {
        let active = self.recipes.active.as_ref().map(|recipe| recipe.number);
        let reason = match (self.plc.registers.recipe_select, active) {
            _ if !self.settings.teach_allowed => Some(reject::TEACH_NOT_ALLOWED),
            (0 | BY_PART_NUMBER, None) => Some(reject::NO_RECIPE),
            // It would replace the recipe of another part.
            (0 | BY_PART_NUMBER, Some(_))
                if self.recipes.is_other_asked_for(&self.plc.registers) =>
            {
                Some(reject::OTHER_RECIPE)
            }
            // The PLC chose the number; the recipe that had it stays as the previous generation.
            (0 | BY_PART_NUMBER, Some(number)) | (number, _) => {
                let by = client
                    .address()
                    .map(|address| format!("PLC {address}").into());
                let teaching = Teaching {
                    by,
                    ..Teaching::of(number)
                };
                let refused = self.teach(teaching, effects);
                if refused.is_none() {
                    ordered(client, PlcOrder::Teach(number), effects);
                }
                refused
            }
        };
        if let Some(reason) = reason {
            self.requests.reject(reason);
        }
    }

    /// Orders a load. Answers with the reason if it is refused; then nothing has changed.
    pub(super) fn load(&mut self, key: RecipeKey, effects: &mut Effects) -> Option<u16> {
        let refused = self.busy();
        if refused.is_some() {
            let state = self.state.word();
            log(effects, format!("a recipe cannot be loaded while {state}"));
            return refused;
        }
        self.recipes.request(&key);
        let job = self.worker.next_job();
        let ordered = key.clone();
        push(effects, Effect::Load { job, key: ordered });
        self.state = State::Loading {
            job,
            key,
            progress: LoadProgress {
                fraction: 0.0,
                words: "starting".into(),
            },
            deadline: self.within(self.settings.limits.changing),
        };
        None
    }

    /// Orders a teach. Answers with the reason if it is refused; then nothing has changed.
    pub(super) fn teach(&mut self, teaching: Teaching, effects: &mut Effects) -> Option<u16> {
        let number = teaching.number;
        let refused = self.busy();
        if refused.is_some() {
            let state = self.state.word();
            log(
                effects,
                format!("recipe {number} cannot be taught while {state}"),
            );
            return refused;
        }
        let job = self.worker.next_job();
        push(effects, Effect::Teach { job, teaching });
        self.state = State::Teaching {
            job,
            progress: TeachProgress {
                number,
                fraction: 0.0,
                words: "starting".into(),
            },
            deadline: self.within(self.settings.limits.changing),
        };
        None
    }

    /// Orders a step of commissioning, unless the worker has something else to do.
    pub(super) fn commission(&mut self, effects: &mut Effects) {
        if self.busy().is_some() {
            let state = self.state.word();
            log(
                effects,
                format!("no step of commissioning can begin while {state}"),
            );
            return;
        }
        let job = self.worker.next_job();
        push(effects, Effect::Commission { job });
        let deadline = self.within(self.settings.limits.changing);
        self.state = State::Commissioning { job, deadline };
    }

    /// Has the worker end the step of commissioning that is under way, if there is one.
    pub(super) fn end_step(&self, effects: &mut Effects) {
        if let State::Commissioning { job, .. } = self.state {
            push(effects, Effect::Abort { job });
        }
    }

    /// Why no recipe can be loaded or taught now; it can be while offline.
    fn busy(&self) -> Option<u16> {
        match self.state {
            State::Ready | State::Offline => None,
            State::Fault(_) => Some(reject::FAULT),
            _ => Some(reject::NOT_READY),
        }
    }

    /// Whether the station waits for this job in a state of the kind; then the wait is over.
    /// Otherwise the answer is logged as late.
    fn ends(&mut self, waits: bool, job: JobId, what: &str, effects: &mut Effects) -> bool {
        let ends = waits && self.state.job() == Some(job);
        if ends {
            self.state = self.rest();
        } else {
            self.late(what, job, effects);
        }
        ends
    }

    fn is_loading(&self) -> bool {
        matches!(self.state, State::Loading { .. })
    }

    fn is_teaching(&self) -> bool {
        matches!(self.state, State::Teaching { .. })
    }

    /// The recipe is loaded.
    pub(super) fn loaded(&mut self, job: JobId, recipe: ActiveRecipe, effects: &mut Effects) {
        if self.ends(self.is_loading(), job, "a loaded recipe", effects) {
            self.recipes.activate(recipe);
            let failure = self.failure.take();
            self.failure = failure.filter(|failure| failure.code != error_code::RECIPE_UNUSABLE);
        }
    }

    /// The load failed.
    pub(super) fn load_failed(
        &mut self,
        job: JobId,
        result: RecipeResult,
        words: Arc<str>,
        effects: &mut Effects,
    ) {
        if self.ends(self.is_loading(), job, "a failed load", effects) {
            self.recipes.fail(result);
            log(effects, words.clone());
            if matches!(result, RecipeResult::Corrupt | RecipeResult::Unfit) {
                let code = error_code::RECIPE_UNUSABLE;
                self.failure = Some(LastFailure { code, words });
            }
        }
    }

    /// A load, a teach or a step of commissioning goes on.
    pub(super) fn progress(
        &mut self,
        job: JobId,
        reached: f32,
        doing: Arc<str>,
        effects: &mut Effects,
    ) {
        let awaited = self.state.job() == Some(job);
        let (fraction, words) = match &mut self.state {
            State::Loading { progress, .. } if awaited => {
                (&mut progress.fraction, &mut progress.words)
            }
            State::Teaching { progress, .. } if awaited => {
                (&mut progress.fraction, &mut progress.words)
            }
            // The page asks the step itself.
            State::Commissioning { .. } if awaited => return,
            _ => return self.late("progress", job, effects),
        };
        if reached.is_finite() {
            // A check between two stages counts from 0 again.
            *fraction = reached.clamp(*fraction, 1.0);
        }
        *words = doing;
    }

    /// The recipe is taught.
    pub(super) fn taught(&mut self, job: JobId, recipe: ActiveRecipe, effects: &mut Effects) {
        if self.ends(self.is_teaching(), job, "a taught recipe", effects) {
            let ActiveRecipe {
                number, name, crc, ..
            } = &recipe;
            log(
                effects,
                format!("taught recipe {number} \"{name}\", fingerprint {crc:08x}"),
            );
            self.recipes.activate(recipe);
            self.failure = None;
        }
    }

    /// A step of commissioning has ended. After one that changed the calibration no recipe is
    /// active.
    pub(super) fn commissioned(
        &mut self,
        job: JobId,
        recipe: Option<ActiveRecipe>,
        effects: &mut Effects,
    ) {
        let waits = matches!(self.state, State::Commissioning { .. });
        if self.ends(waits, job, "a step of commissioning", effects) {
            self.recipes.active = recipe;
        }
    }

    /// Teaching failed; the recipe before it stays active.
    pub(super) fn teach_failed(
        &mut self,
        job: JobId,
        code: u16,
        words: Arc<str>,
        effects: &mut Effects,
    ) {
        if self.ends(self.is_teaching(), job, "a failed teach", effects) {
            log(effects, words.clone());
            let code = error_code::or_unnamed(code);
            self.failure = Some(LastFailure { code, words });
        }
    }
}
