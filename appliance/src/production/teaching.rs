//! Teaching on the station: from the part in front of the head to a stored recipe that is ready to
//! measure.

use super::job::Telling;
use super::{ABORTED, DEVICE_TIMEOUT, Worker, active, broken, opening};
use crate::head::calibrated::EmptyStation;
use crate::recipe::RecipeFile;
use crate::recipe::teach::{TaughtRecipe, TeachError, replace, teach_showing};
use crate::station::{Event, JobId, RecipeKey, Teaching, error_code};
use crate::system::computing;
use crate::system::headway::Headway;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

/// The shares of a teach's time after which the recipe is taught, its gauges are settled, the
/// geometry is checked, and it is stored.
const TAUGHT: f64 = 0.8;
const SETTLED: f64 = 0.9;
const CHECKED: f64 = 0.93;
const STORED: f64 = 0.94;

impl Worker {
    /// Teaches the part in front of the head and stores its recipe, which is the active one
    /// then. Where that fails the recipe before stays active.
    pub(super) fn teach(&mut self, job: JobId, teaching: &Teaching) {
        let (number, keep_gauges) = (teaching.number, teaching.keep_gauges);
        let replaced = self.recipes.present(number);
        let taught = catch_unwind(AssertUnwindSafe(|| {
            self.taught(job, teaching, replaced.as_ref())
        }));
        let taught = taught
            .unwrap_or_else(|panic| Err(TeachError::Rig(broken("teach: the part", &*panic))))
            .and_then(|taught| self.check_taught(job, SETTLED..CHECKED).map(|()| taught));
        self.progress.clear();
        self.telling(job).tell(CHECKED, "storing the recipe");
        let stored = match taught {
            Ok(taught) => self.store(&taught, replaced.filter(|_| keep_gauges)),
            Err(error) => Err(self.refuse_teaching(error)),
        };
        let ready = stored.and_then(|()| {
            // Teaching has shown patterns of its own.
            self.prepare((job, STORED), &RecipeKey::Number(number), None)
                .map_err(|(_, message)| (error_code::RIG, message))
        });
        match ready {
            Ok((ready, _)) => {
                let recipe = active(&ready);
                self.plan = Some(ready);
                self.place_waiting(job);
                self.station.event(Event::Taught { job, recipe });
            }
            Err((error_code, message)) => {
                self.restore();
                // The fault of a lost head ends the job.
                if self.lost.is_none() {
                    self.station.event(Event::TeachFailed {
                        job,
                        error_code,
                        message: message.into(),
                    });
                }
            }
        }
    }

    /// Measures the part and makes its recipe.
    fn taught(
        &mut self,
        job: JobId,
        teaching: &Teaching,
        replaced: Option<&RecipeFile>,
    ) -> Result<TaughtRecipe, TeachError> {
        let &Teaching {
            number,
            keep_gauges,
            everything,
            ref marking,
            limit_um,
            ref by,
        } = teaching;
        if let Some(problem) = &self.opened.problem {
            return Err(TeachError::NotCalibrated(problem.clone()));
        }
        let (width, height, _) = self.opened.calibration.frames();
        let kept = replaced.filter(|_| keep_gauges);
        if let Some(file) = kept {
            replace::check_kept(file, (width, height))?;
        }
        let mut naming = replace::naming(number, replaced, keep_gauges);
        naming.everything = everything.unwrap_or(naming.everything);
        naming.marking = marking.clone().unwrap_or(naming.marking);
        naming.empty = self.empty_station();
        if let Some(by) = by {
            naming.taught_by = by.to_string();
        }
        naming.limit_mm = limit_um
            .map(|um| f64::from(um) / 1000.0)
            .or(naming.limit_mm);
        let shared = self.recipes.refuse_shared(number, &naming.part_number);
        shared?;
        let (aborts, bar) = (&self.aborts, &self.progress);
        let telling = Telling::new(&self.station, &self.pulse, bar, aborts, job);
        let tell = |share: f64, words: &str| telling.tell(share, words);
        let headway = Headway::new(&tell, "teaching");
        let (head, calibration) = (&mut self.opened.head, &self.opened.calibration);
        let marked = (&self.computing, &self.seen);
        let taught = self.pool.install(|| {
            let headway = headway.part(0.0, TAUGHT);
            teach_showing(head, calibration, &naming, DEVICE_TIMEOUT, marked, headway)
        })?;
        let headway = headway.part(TAUGHT, SETTLED);
        let round = headway.part(0.0, 0.8);
        let settled = match kept {
            Some(file) => {
                let headway = round.called("working out the limits of the gauges");
                let kept = || replace::keep_gauges(taught, file, headway);
                self.computing.on(|| self.pool.install(kept))
            }
            None => {
                let headway = round.called("looking for round openings and slots");
                let rims = || taught.with_rims(headway);
                self.computing.on(|| self.pool.install(rims))
            }
        };
        let packing = headway.part(0.8, 1.0).called("packing the recipe");
        packing.done(0.0);
        computing::trim_memory();
        let packed =
            settled.and_then(|settled| self.computing.on(|| settled.seal_telling(packing)));
        Ok(packed?)
    }

    /// What the station shows without a part, if it was recorded.
    fn empty_station(&self) -> Option<Arc<EmptyStation>> {
        let place = self.config.calibration.as_deref()?;
        let loaded = EmptyStation::load(place, &self.opened.calibration);
        let loaded = loaded.map_err(|failure| self.progress.warn(&failure.to_string()));
        loaded.ok()?.map(Arc::new)
    }

    fn telling(&self, job: JobId) -> Telling<'_> {
        let (aborts, bar) = (&self.aborts, &self.progress);
        Telling::new(&self.station, &self.pulse, bar, aborts, job)
    }

    /// ERROR_CODE and words of a failure; a lost head is remembered.
    fn refuse_teaching(&mut self, error: TeachError) -> (u16, String) {
        let words = match error {
            TeachError::Ended => format!("teach: {ABORTED}"),
            _ => error.to_string(),
        };
        let failed = (error.code(), words);
        if let TeachError::Limit { place, .. } = error {
            self.seen.refuse(place);
        }
        if let TeachError::Device(error) = error {
            self.lost = Some(error).filter(opening::is_lost);
        }
        failed
    }

    /// Stores a recipe. `kept` is the recipe whose gauges it has taken over. It must still be the
    /// stored one: an edit that was stored meanwhile must not be lost.
    fn store(&self, taught: &TaughtRecipe, kept: Option<RecipeFile>) -> Result<(), (u16, String)> {
        for reason in &taught.choice.reasons {
            self.progress.log(reason);
        }
        let (number, bytes) = (taught.manifest.number, &taught.bytes);
        let stored = match kept {
            None => self.recipes.save(number, bytes).map(|()| true),
            Some(file) => self.recipes.replace(number, &file.fingerprint, bytes),
        };
        let problem = match stored {
            Ok(true) => return Ok(()),
            Ok(false) => "it was changed while it was taught: teach it again".into(),
            Err(error) => format!("{error}: free space"),
        };
        let words = format!("store recipe {number}: {problem}");
        Err((error_code::NOT_STORED, words))
    }

    /// Puts the part that was to wait for teaching in front of a simulated head.
    fn place_waiting(&mut self, job: JobId) {
        let Some((stage, placed)) = self.opened.stage.as_ref().zip(self.waiting.take()) else {
            return;
        };
        let telling = self.telling(job);
        let words = "putting the part in front of the head";
        let progress = |share: f64| {
            telling.tell(share, words);
        };
        let (part, lies) = (&placed.part, &placed.placement);
        let place = || {
            if let Some(floor) = &placed.floor {
                stage.surround(floor.clone())?;
            }
            if let Some(unsteady) = placed.unsteady {
                stage.unsettle(unsteady)?;
            }
            stage.place_with_progress(part, placed.material, lies, &progress)
        };
        let shown = self.computing.on(|| self.pool.install(place));
        if let Err(error) = shown {
            self.progress.warn(&error.to_string());
        }
    }
}
