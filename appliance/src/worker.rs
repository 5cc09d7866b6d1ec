//! The measuring task: one thread that owns the head, the plan and the computing threads.

use crate::backend::Opened;
use crate::latest::LastMaps;
use crate::plan::{Plan, PlanError};
use crate::progress::Progress;
use crate::recipe::teach::{Naming, TeachError, teach};
use crate::recipe::{LoadError, Store};
use crate::station::result::flag::STEPPED_UP;
use crate::station::{
    ActiveRecipe, Condition, Event, Job, JobId, RecipeKey, RecipeResult, Request, StationHandle,
};
use hal::error::ErrorKind;
use hal::frame::Frame;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::{Duration, Instant};

/// What the worker is told to do.
#[derive(Debug)]
pub enum Order {
    /// Measure a part.
    Measure(Job),
    /// Load a recipe.
    Load(JobId, RecipeKey),
    /// Teach a recipe from the part in front of the head.
    Teach(JobId, u16),
    /// End.
    Stop,
}

/// Idle, the worker gives a sign of life this often.
const SIGN_OF_LIFE: Duration = Duration::from_millis(100);
/// How far parts may lie from where they were taught, unless a recipe says otherwise.
const PLACEMENT_TOLERANCE_MM: f64 = 1.0;
/// Longest wait for one flip, one pulse or one frame.
const DEVICE_TIMEOUT: Duration = Duration::from_secs(2);

/// Error codes of the worker; the README has the table.
mod code {
    pub const CAMERA_LOST: u16 = 101;
    pub const UNSUPPORTED: u16 = 102;
    pub const TIMEOUT: u16 = 301;
    pub const PROTOCOL: u16 = 302;
    pub const NOTHING_TO_TEACH: u16 = 401;
    pub const RIG: u16 = 501;
    pub const NOT_STORED: u16 = 601;
}

/// Everything that the measuring task owns.
pub struct Worker {
    /// The head and its calibration.
    pub opened: Opened,
    /// Computing threads.
    pub pool: rayon::ThreadPool,
    /// The station's recipes.
    pub recipes: Store,
    /// The way to the station.
    pub station: StationHandle,
    /// Where the last maps go.
    pub maps: LastMaps,
    /// Shows how far teaching is, and the log.
    pub progress: Progress,
}

impl Worker {
    /// Works until told to stop, or until nobody can tell it anything any more. `first` is asked of the
    /// station as soon as it is ready for it.
    pub fn run(mut self, orders: &Receiver<Order>, first: Option<Request>) {
        self.station.event(Event::Condition(Condition {
            calibration_valid: true,
            ..Condition::default()
        }));
        self.progress.clear();
        self.station.event(Event::Started);
        if let Some(first) = first {
            self.station.event(Event::Request(first));
        }
        let mut plan = None;
        let mut frames = Vec::new();
        loop {
            if self.maps.wanted() {
                let shown = plan.as_ref().and_then(|plan: &Plan| {
                    let show = || plan.heights(&frames);
                    self.pool.install(show)
                });
                self.maps.set(shown);
            }
            match orders.recv_timeout(SIGN_OF_LIFE) {
                Ok(Order::Measure(job)) => {
                    // The memory of the frames before is what these are written to.
                    drop(frames);
                    frames = self.measure(plan.as_ref(), &job);
                }
                Ok(Order::Load(job, key)) => {
                    frames = self.forget();
                    self.load(job, &key, &mut plan);
                }
                Ok(Order::Teach(job, number)) => {
                    frames = self.forget();
                    self.teach(job, number, &mut plan);
                }
                Ok(Order::Stop) | Err(RecvTimeoutError::Disconnected) => return,
                Err(RecvTimeoutError::Timeout) => {
                    self.station.event(Event::Alive);
                }
            }
        }
    }

    /// No frames: those of the last cycle are nothing to another recipe.
    fn forget(&self) -> Vec<Frame> {
        self.maps.forget();
        Vec::new()
    }

    /// Runs a cycle; the frames that it was judged by.
    fn measure(&mut self, plan: Option<&Plan>, job: &Job) -> Vec<Frame> {
        let id = job.job;
        let failed = |error_code, message: String| Event::MeasureFailed {
            job: id,
            error_code,
            message: message.into(),
        };
        let Some(plan) = plan else {
            // The station triggers only with an active recipe, and that is this plan's.
            self.station
                .event(failed(code::RIG, "measure: no recipe is loaded".into()));
            return Vec::new();
        };
        let mut flags = 0;
        for step in 0.. {
            let frames = match self.take(plan.indices(step)) {
                Ok(frames) => frames,
                Err(error) => {
                    self.station
                        .event(failed(code_of(&error), error.to_string()));
                    return Vec::new();
                }
            };
            let exposed = Instant::now();
            let last = step + 1 >= plan.steps();
            // The part must stay while another sequence may follow.
            if last {
                self.station.event(Event::ExposureDone { job: id });
            }
            let mut inspection = self.pool.install(|| plan.inspect(&frames, exposed));
            if let Some(reason) = inspection.step_up.filter(|_| !last) {
                self.progress
                    .log(&format!("measuring again with more frames: {reason}"));
                flags = STEPPED_UP;
                continue;
            }
            if !last {
                self.station.event(Event::ExposureDone { job: id });
            }
            inspection.flags |= flags;
            self.maps.outdated();
            self.station.event(Event::Finished {
                job: id,
                inspection: Arc::new(inspection),
            });
            return frames;
        }
        Vec::new()
    }

    /// The frames of some of the patterns.
    fn take(&mut self, indices: &[usize]) -> Result<Vec<Frame>, hal::error::Error> {
        let mut frames: Vec<Frame> = Vec::with_capacity(indices.len());
        let station = &self.station;
        self.opened
            .head
            .acquire(indices, DEVICE_TIMEOUT, &mut |_, frame| {
                frames.push(frame);
                station.event(Event::Alive);
            })?;
        Ok(frames)
    }

    /// Loads a recipe; the one before stays active unless everything went well.
    fn load(&mut self, job: JobId, key: &RecipeKey, plan: &mut Option<Plan>) {
        let (result, message) = match self.prepare(key) {
            Ok((ready, fallback)) => {
                let recipe = active(&ready);
                *plan = Some(ready);
                if let Some(fallback) = fallback {
                    self.progress.log(&fallback);
                }
                self.station.event(Event::RecipeLoaded { job, recipe });
                return;
            }
            Err(refused) => refused,
        };
        self.restore(plan);
        let message = Arc::from(message);
        self.station.event(Event::LoadFailed {
            job,
            result,
            message,
        });
    }

    /// Puts the patterns of the active recipe back into the projector, after another one's may have
    /// replaced them. Without them the recipe cannot measure: then each trigger ends INVALID.
    fn restore(&mut self, plan: &mut Option<Plan>) {
        let Some(before) = plan else { return };
        let shown = before.rasters(&self.opened.calibration);
        if let Err(error) = shown.and_then(|rasters| self.opened.head.load(rasters)) {
            self.progress.log(&error.to_string());
            *plan = None;
        }
    }

    fn prepare(
        &mut self,
        key: &RecipeKey,
    ) -> Result<(Plan, Option<String>), (RecipeResult, String)> {
        let refuse = |error: LoadError| {
            let result = match error {
                LoadError::Unknown(_) => RecipeResult::Unknown,
                LoadError::Corrupt { .. } => RecipeResult::Corrupt,
            };
            (result, error.to_string())
        };
        let number = match key {
            RecipeKey::Number(number) => *number,
            RecipeKey::PartNumber(part_number) => self.recipes.find(part_number).map_err(refuse)?,
        };
        let loaded = self.recipes.load(number).map_err(refuse)?;
        let simulated = self.opened.stage.is_some();
        let (pool, calibration) = (&self.pool, &self.opened.calibration);
        let plan = pool
            .install(|| Plan::new(loaded.recipe, calibration, simulated))
            .map_err(|error| {
                let result = match error {
                    PlanError::OtherCalibration { .. } => RecipeResult::OtherCalibration,
                    PlanError::Unfit { .. } => RecipeResult::Corrupt,
                };
                (result, error.to_string())
            })?;
        plan.rasters(&self.opened.calibration)
            .and_then(|rasters| self.opened.head.load(rasters))
            .map_err(|error| (RecipeResult::Corrupt, error.to_string()))?;
        Ok((plan, loaded.fallback))
    }

    fn teach(&mut self, job: JobId, number: u16, plan: &mut Option<Plan>) {
        let naming = Naming {
            number,
            part_number: format!("PART-{number:04}"),
            name: format!("Part {number}"),
            taught_at_unix_s: crate::clock::utc_us().unwrap_or(0) / 1_000_000,
            placement_tolerance_mm: PLACEMENT_TOLERANCE_MM,
        };
        let (station, bar) = (self.station.clone(), self.progress.clone());
        let progress = |fraction: f64, words: &str| {
            bar.tell(fraction, words);
            station.event(Event::Progress {
                job,
                fraction: fraction as f32,
                words: words.into(),
            });
        };
        let Opened {
            head, calibration, ..
        } = &mut self.opened;
        let taught = self
            .pool
            .install(|| teach(head, calibration, &naming, DEVICE_TIMEOUT, &progress));
        self.progress.clear();
        let stored = taught
            .map_err(|error| (code_of_teaching(&error), error.to_string()))
            .and_then(|taught| {
                for reason in &taught.choice.reasons {
                    self.progress.log(reason);
                }
                self.recipes.save(number, &taught.bytes).map_err(|error| {
                    (
                        code::NOT_STORED,
                        format!("store recipe {number}: {error}: free space"),
                    )
                })
            });
        let ready = stored.and_then(|()| {
            let key = RecipeKey::Number(number);
            self.prepare(&key)
                .map_err(|(_, message)| (code::RIG, message))
        });
        match ready {
            Ok((ready, _)) => {
                let recipe = active(&ready);
                *plan = Some(ready);
                self.station.event(Event::Taught { job, recipe });
            }
            Err((error_code, message)) => {
                self.restore(plan);
                self.station.event(Event::TeachFailed {
                    job,
                    error_code,
                    message: message.into(),
                });
            }
        }
    }
}

fn active(plan: &Plan) -> ActiveRecipe {
    ActiveRecipe {
        number: plan.file().number,
        crc: plan.crc(),
        name: plan.file().name.as_str().into(),
    }
}

fn code_of(error: &hal::error::Error) -> u16 {
    match error.kind() {
        ErrorKind::Timeout => code::TIMEOUT,
        ErrorKind::Disconnected => code::CAMERA_LOST,
        ErrorKind::Unsupported => code::UNSUPPORTED,
        ErrorKind::Protocol => code::PROTOCOL,
    }
}

fn code_of_teaching(error: &TeachError) -> u16 {
    match error {
        TeachError::Device(error) => code_of(error),
        TeachError::Scene(_) => code::NOTHING_TO_TEACH,
        TeachError::Rig(_) => code::RIG,
    }
}
