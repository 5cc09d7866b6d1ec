//! The measuring task: one thread that owns the head, the plan and the computing threads.

pub mod backend;
pub mod commissioning;
mod cycle;
pub mod drift;
mod job;
pub mod latest;
pub mod opening;
pub mod shelf;
pub mod simulation;
mod teaching;
pub mod warm_up;

pub use cycle::JudgedBy;
pub use job::Aborts;

use crate::config::HeadConfig;
use crate::head::calibration::Current;
use crate::head::placed::Placed;
use crate::history::{History, JudgedPart};
use crate::production::backend::OpenedHead;
use crate::production::commissioning::Commission;
use crate::production::commissioning::live::Look;
use crate::production::drift::Watch;
use crate::production::latest::LastCycleRequests;
use crate::production::shelf::Shelf;
use crate::production::simulation::Placing;
use crate::recipe::plan::{Plan, PlanError};
use crate::recipe::store::Stamp;
use crate::recipe::{LoadError, Store};
use crate::station::snapshot::warning;
use crate::station::{
    ActiveRecipe, Condition, Event, Job, JobId, ProjectorHealth, RecipeKey, RecipeResult, Request,
    StationHandle, Teaching,
};
use crate::system::caller::Pulse;
use crate::system::computing::{self, Computing};
use crate::system::headway::Headway;
use crate::system::progress::Progress;
use hal::error::Error;
use hal::projector::{ControllerState, fault};
use job::Telling;
use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, TryRecvError};
use std::time::{Duration, Instant};
use warm_up::WarmUp;

/// What the measuring task is to do.
pub enum Order {
    /// Measure a part.
    Measure(Job),
    /// Load a recipe.
    Load(JobId, RecipeKey),
    /// Teach the part in front of the head.
    Teach(JobId, Teaching),
    /// Carry out the step of commissioning that waits.
    Commission(JobId),
    /// Take a live picture.
    Look(Look),
    /// Put another part in front of a simulated head.
    Place(Placing),
    /// End.
    Stop,
}

/// Period of the signs of life while the task is idle.
const SIGN_OF_LIFE: Duration = Duration::from_millis(100);
/// How long a sequence may take beyond its planned duration.
const DEVICE_TIMEOUT: Duration = Duration::from_secs(2);

/// Why an aborted job ended.
const ABORTED: &str = "the PLC or a stop ended it";

/// Everything that the measuring task owns.
pub struct Worker {
    /// The head and its calibration.
    pub opened: OpenedHead,
    /// Where the calibration is published for the page.
    pub calibration: Current,
    /// Computing threads.
    pub pool: rayon::ThreadPool,
    /// The station's recipes.
    pub recipes: Store,
    /// The station.
    pub station: StationHandle,
    /// Requests about the last cycle.
    pub last_cycle: LastCycleRequests,
    /// Where the frames of failed parts go.
    pub history: History,
    /// Progress and log.
    pub progress: Progress,
    /// The plan of the active recipe.
    pub plan: Option<Arc<Plan>>,
    /// What the last part was judged by.
    pub last: JudgedBy,
    /// The configured head, to open it again.
    pub config: HeadConfig,
    /// The job that the station wants to be ended early.
    pub aborts: Aborts,
    /// The error since which the head is lost.
    pub lost: Option<Error>,
    /// The plans used last.
    pub shelf: Shelf,
    /// The heartbeat for the service manager's watchdog.
    pub pulse: Pulse,
    /// Marked while the task computes without using a device.
    pub computing: Computing,
    /// The part that is put in front of a simulated head once a good one is taught.
    pub waiting: Option<Placed>,
    /// What teaching took for the part.
    pub seen: crate::recipe::teach::part::LastSeen,
    /// Steps of commissioning, and what they have found.
    pub commission: Commission,
    /// Whether the projector has the patterns for live pictures behind those of the recipe.
    pub live: bool,
    /// When the geometry is checked.
    pub watch: Watch,
    /// Whether the head is warming up.
    pub warm_up: WarmUp,
}

impl Worker {
    /// Works until [`Order::Stop`] or until all senders of orders are gone. `begin` tells the
    /// station that the task is ready; `first` is then requested of the station.
    pub fn run(mut self, orders: &Receiver<Order>, begin: Event, first: Option<Request>) {
        self.progress.clear();
        self.tell_condition();
        let begun = self.station.event(begin);
        if let Some(first) = first.filter(|_| begun.state_word != "stopping") {
            self.station.event(Event::Request(first));
        }
        loop {
            self.pulse.beat();
            // Pictures are computed only while no order waits.
            let order = match orders.try_recv() {
                Err(TryRecvError::Empty) => {
                    if self.last_cycle.wanted() {
                        self.answer();
                    }
                    orders.recv_timeout(SIGN_OF_LIFE)
                }
                Err(TryRecvError::Disconnected) => Err(RecvTimeoutError::Disconnected),
                Ok(order) => Ok(order),
            };
            if order.is_ok() {
                self.watch.due.disturbed();
            }
            match order {
                Ok(Order::Measure(job)) => {
                    self.watch.due.cycle();
                    // Freed first: the head reuses the memory for the new frames.
                    self.last = JudgedBy::default();
                    self.last = self.measure(&job);
                }
                Ok(Order::Load(job, key)) => {
                    self.forget();
                    self.load(job, &key);
                    computing::trim_memory();
                }
                Ok(Order::Teach(job, teaching)) => {
                    self.forget();
                    self.teach(job, &teaching);
                    computing::trim_memory();
                }
                Ok(Order::Commission(job)) => {
                    self.forget();
                    self.commission(job);
                }
                Ok(Order::Look(look)) => {
                    // Pictures that are asked for one after another leave no time for the sign of
                    // life below.
                    self.station.event(Event::Alive);
                    self.look(look);
                }
                Ok(Order::Place(placing)) => {
                    placing.carry_out();
                    computing::trim_memory();
                }
                Ok(Order::Stop) | Err(RecvTimeoutError::Disconnected) => return,
                Err(RecvTimeoutError::Timeout) => {
                    self.station.event(Event::Alive);
                    self.lost = self.opened.head.rest().err();
                    self.tell_projector(self.opened.head.controller());
                    self.tell_camera(self.opened.head.camera_temperature_c());
                    self.tell_warm_up();
                    if self.lost.is_none() {
                        self.rest_and_check();
                    }
                }
            }
            if let Some(error) = self.lost.take() {
                self.forget();
                if self.recover(&error, orders).is_break() {
                    return;
                }
            }
        }
    }

    /// Forgets the frames of the last part and the patterns in the projector for live pictures.
    fn forget(&mut self) {
        (self.last, self.live) = (JudgedBy::default(), false);
    }

    /// Reports what the projector's controller says of itself, if that has changed; nothing is
    /// known of one that is lost.
    fn tell_projector(&self, state: Option<ControllerState>) {
        let known = state.map_or_else(ProjectorHealth::default, |state| ProjectorHealth {
            temperature_c: state.temperature_c,
            led_current: Some(state.led_current),
            faults: Some(state.faults),
            fault_words: Some(fault::words(state.faults).collect()),
        });
        if self.station.snapshot().health.projector != known {
            self.station.event(Event::Projector(known));
        }
    }

    /// Reports the temperature of the camera's sensor, if that has changed.
    fn tell_camera(&self, celsius: Option<f64>) {
        if self.station.snapshot().health.camera_temperature_c != celsius {
            self.station.event(Event::CameraTemperature(celsius));
        }
    }

    /// Reports whether the head is warming up, if that has changed.
    fn tell_warm_up(&mut self) {
        let health = &self.station.snapshot().health;
        let celsius = [health.camera_temperature_c, health.projector.temperature_c];
        if self.warm_up.note(celsius, Instant::now()) {
            let warnings = self.station.snapshot().warnings & warning::OF_A_PART;
            self.tell_station(warnings);
        }
    }

    /// Reports whether the head's calibration can be trusted, and what is known of the head.
    fn tell_condition(&mut self) {
        self.tell_head();
        let OpenedHead {
            problem,
            fallback,
            dark,
            calibration,
            ..
        } = &self.opened;
        let trusted = problem.is_none().then_some(calibration);
        self.calibration.set(trusted);
        for words in [problem, fallback, dark].into_iter().flatten() {
            self.progress.warn(words);
        }
        self.tell_station(0);
        self.tell_drift();
    }

    /// Tells the station what is known of the head; `warnings` are those of the last part.
    fn tell_station(&self, warnings: u16) {
        self.station.event(Event::Condition(Condition {
            warming_up: self.warm_up.is_under_way(),
            calibration_valid: self.opened.problem.is_none(),
            warnings,
        }));
    }

    /// Answers the requests about the last cycle.
    fn answer(&self) {
        let (last, result) = (&self.last, self.station.snapshot().result.clone());
        let plan = self.plan.as_ref().filter(|_| !last.frames.is_empty());
        let measured = plan.zip(result);
        let cycle = measured.map(|(plan, record)| JudgedPart {
            record,
            plan: plan.clone(),
            sequence: last.sequence,
            frames: last.frames.clone(),
            calibration: self.opened.calibration.clone(),
        });
        let requests = &self.last_cycle;
        self.pool.install(|| requests.answer(cycle.as_ref()));
    }

    /// Loads a recipe; if that fails, the one before stays active.
    fn load(&mut self, job: JobId, key: &RecipeKey) {
        let shown = self.plan.clone();
        let (result, message) = match caught(|| self.prepare((job, 0.0), key, shown)) {
            Ok(_) if self.aborts.has(job) => (RecipeResult::Busy, format!("load: {ABORTED}")),
            Ok((ready, fallback)) => {
                let recipe = active(&ready);
                self.plan = Some(ready);
                if let Some(fallback) = fallback {
                    self.progress.warn(&fallback);
                }
                self.station.event(Event::RecipeLoaded { job, recipe });
                return;
            }
            Err(refused) => refused,
        };
        self.restore();
        // The fault of a lost head ends the job.
        if self.lost.is_none() {
            let message = Arc::from(message);
            self.station.event(Event::LoadFailed {
                job,
                result,
                message,
            });
        }
    }

    /// Loads the patterns of the active recipe into the projector again, after those of another one
    /// may have replaced them. If that fails, there is no plan any more, and each trigger ends
    /// INVALID.
    fn restore(&mut self) {
        let Some(before) = &self.plan else { return };
        let (head, calibration) = (&mut self.opened.head, &self.opened.calibration);
        match self.pool.install(|| before.load(head, calibration)) {
            Ok(()) => {}
            Err(error) if opening::is_lost(&error) => self.lost = Some(error),
            Err(error) => {
                self.progress.warn(&error.to_string());
                self.plan = None;
            }
        }
    }

    /// Makes a recipe ready to measure: plans it and loads its patterns. `shown` is the plan whose
    /// patterns the head holds; if it is the one that is asked for, there is nothing to do. `from` is
    /// the share of the job that is done before. The
    /// second result warns that the previous generation of the recipe is used.
    fn prepare(
        &mut self,
        (job, from): (JobId, f64),
        key: &RecipeKey,
        shown: Option<Arc<Plan>>,
    ) -> Result<(Arc<Plan>, Option<String>), (RecipeResult, String)> {
        if let Some(problem) = &self.opened.problem {
            return Err((RecipeResult::OtherCalibration, problem.clone()));
        }
        let refuse = |error: LoadError| {
            let result = match error {
                LoadError::Unknown(_) => RecipeResult::Unknown,
                LoadError::Corrupt { .. } => RecipeResult::Corrupt,
                LoadError::Unfit { .. } | LoadError::Shared { .. } => RecipeResult::Unfit,
            };
            (result, error.to_string())
        };
        let number = match key {
            RecipeKey::Number(number) => *number,
            RecipeKey::PartNumber(part_number) => self.recipes.find(part_number).map_err(refuse)?,
        };
        let telling = Telling::new(
            &self.station,
            &self.pulse,
            &self.progress,
            &self.aborts,
            job,
        );
        let tell = |share: f64, words: &str| telling.tell(share, words);
        let headway = Headway::new(&tell, "reading the recipe").part(from, 1.0);
        headway.done(0.0);
        let stamp = self.recipes.stamp(number);
        let (pool, calibration) = (&self.pool, &self.opened.calibration);
        let fingerprint = calibration.fingerprint();
        let kept = stamp
            .as_ref()
            .and_then(|stamp| self.shelf.take(stamp, &fingerprint))
            .filter(|plan| plan.conditions().set_otherwise(calibration).is_none());
        let (plan, fallback) = match kept {
            Some(plan) => (plan, None),
            None => {
                // Before the arrays of the next recipe are read.
                self.shelf.make_room(stamp.as_ref().map_or(0, Stamp::bytes));
                let loaded = self.recipes.load(number).map_err(refuse)?;
                let headway = headway.part(0.2, 0.8).called("planning");
                let (played, simulated) = (&self.opened.played, self.opened.stage.is_some());
                let planned = pool.install(|| match played {
                    Some(played) => played.plan(loaded.recipe, calibration),
                    None => Plan::telling(loaded.recipe, calibration, simulated, headway),
                });
                let plan = Arc::new(planned.map_err(refuse_plan)?);
                // The plan of the previous generation does not belong to the stamp of the newest
                // file.
                if let Some(stamp) = stamp.filter(|_| loaded.fallback.is_none()) {
                    self.shelf.put(stamp, fingerprint, plan.clone());
                }
                (plan, loaded.fallback)
            }
        };
        if shown.is_some_and(|shown| Arc::ptr_eq(&shown, &plan)) {
            return Ok((plan, fallback));
        }
        headway.called("loading the patterns").done(0.8);
        let head = &mut self.opened.head;
        pool.install(|| plan.load(head, calibration))
            .map_err(|error| {
                let message = error.to_string();
                self.lost = Some(error).filter(opening::is_lost);
                (RecipeResult::Unfit, message)
            })?;
        Ok((plan, fallback))
    }
}

fn refuse_plan(error: PlanError) -> (RecipeResult, String) {
    let result = match error {
        PlanError::OtherCalibration { .. }
        | PlanError::OtherExposing { .. }
        | PlanError::OtherHead { .. } => RecipeResult::OtherCalibration,
        PlanError::Unfit { .. } => RecipeResult::Unfit,
    };
    (result, error.to_string())
}

/// Runs what makes a recipe ready, and turns a panic into a refusal of the recipe.
///
/// Recipes are imported from outside. One that makes the computation panic must not end the
/// process: the next start would load it again, and so on.
pub(crate) fn caught<T>(
    prepare: impl FnOnce() -> Result<T, (RecipeResult, String)>,
) -> Result<T, (RecipeResult, String)> {
    catch_unwind(AssertUnwindSafe(prepare)).unwrap_or_else(|panic| {
        let words = broken("load: the recipe", &*panic);
        let message = format!(
            "{words}: it stays stored and is not used; teach it again, and send its file with the diagnostic bundle"
        );
        Err((RecipeResult::Unfit, message))
    })
}

/// What made the computation panic, in words.
fn broken(what: &str, panic: &(dyn Any + Send)) -> String {
    let said = panic.downcast_ref::<String>().map(String::as_str);
    let said = said.or(panic.downcast_ref::<&str>().copied());
    let said = said.unwrap_or("the log has more");
    format!("{what} breaks the computation ({said})")
}

fn active(plan: &Plan) -> ActiveRecipe {
    let id = plan.id();
    ActiveRecipe {
        number: id.number,
        crc: id.crc(),
        part_number: id.part_number.as_str().into(),
        name: id.name.as_str().into(),
    }
}
