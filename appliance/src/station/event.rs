//! What reaches the station (events) and what it wants done (effects).

use core::net::IpAddr;
use std::sync::Arc;

use super::clock::Micros;
use super::control::ControlWrite;
use super::health::{Drift, Pace, ProjectorHealth, System};
use super::recipes::{ActiveRecipe, RecipeKey, RecipeResult};
use super::result::{Inspection, ResultRecord};
use super::triggers::{Client, Trigger};
use algo::inspect::Marking;

/// The number of one order to the worker. Each answer carries it, so that a late answer is
/// recognised.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct JobId(pub u64);

/// A request that does not come from the PLC: from the daemon's start, the command line or the
/// page.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Request {
    /// Measure.
    Trigger(Trigger),
    /// Load a recipe.
    Load(RecipeKey),
    /// Teach a recipe; allowed also where the PLC must not teach.
    Teach(Teaching),
    /// Carry out the step of commissioning that is waiting for the worker.
    Commission,
    /// End the step of commissioning that is under way.
    EndStep,
}

/// As what the part in front of the head is taught.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Teaching {
    /// The recipe's number, 1–9999.
    pub number: u16,
    /// Whether regions, gauges and limits of the recipe that it replaces stay.
    pub keep_gauges: bool,
    /// Whether everything that is seen is the part; as in the recipe that it replaces if it is not said.
    pub everything: Option<bool>,
    /// What is marked in the picture; as in the recipe that it replaces if it is not said.
    pub marking: Option<Marking>,
    /// The limit of the deviation, ± µm; as in the recipe that it replaces if it is not said.
    pub limit_um: Option<u32>,
    /// Who ordered it, in words.
    pub by: Option<Arc<str>>,
}

/// What a PLC ordered, and the station does.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum PlcOrder {
    /// To load a recipe.
    Load(RecipeKey),
    /// To teach a recipe.
    Teach(u16),
}

impl Teaching {
    /// A recipe with this number; everything else as in the recipe that it replaces, or by default.
    pub fn of(number: u16) -> Self {
        Self {
            number,
            ..Self::default()
        }
    }
}

/// What the worker knows about the head, sent whenever it changes.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Condition {
    /// STATUS bit 14.
    pub warming_up: bool,
    /// STATUS bit 15.
    pub calibration_valid: bool,
    /// WARNING bits, see [`super::snapshot::warning`]; `PLC_LOST` and `CLOCK_UNSYNCED` are the
    /// station's own and ignored here. Those of the next inspection replace them.
    pub warnings: u16,
}

/// Something that happened.
#[derive(Debug, Clone)]
pub enum Event {
    /// The PLC wrote. `rising` are the CONTROL bits that rose on the writing connection.
    Write {
        /// What it wrote.
        write: ControlWrite,
        /// The edges, see [`super::ConnectionEdges`].
        rising: u16,
        /// Who wrote.
        client: Client,
    },
    /// A request that does not come from the PLC.
    Request(Request),
    /// The worker has opened its head: the boot is over.
    Started,
    /// The last frame is exposed; the part may move.
    ExposureDone {
        /// Quoted.
        job: JobId,
    },
    /// A measurement ended with an inspection, which may say INVALID.
    Finished {
        /// Quoted.
        job: JobId,
        /// The inspection's gauges, verdict and times.
        inspection: Arc<Inspection>,
    },
    /// A measurement ended without an inspection.
    MeasureFailed {
        /// Quoted.
        job: JobId,
        /// 1xx camera … 8xx internal; 0 becomes [`super::error_code::UNNAMED`].
        error_code: u16,
        /// What was attempted with what, and the remedy.
        message: Arc<str>,
    },
    /// The recipe is active: everything a trigger needs is prepared.
    RecipeLoaded {
        /// Quoted.
        job: JobId,
        /// Which.
        recipe: ActiveRecipe,
    },
    /// The recipe could not be loaded; the one before is still active.
    LoadFailed {
        /// Quoted.
        job: JobId,
        /// Why.
        result: RecipeResult,
        /// Why, in words.
        message: Arc<str>,
    },
    /// Teaching or a step of commissioning goes on.
    Progress {
        /// Quoted.
        job: JobId,
        /// 0…1.
        fraction: f32,
        /// What it is doing.
        words: Arc<str>,
    },
    /// The recipe is taught, stored and active.
    Taught {
        /// Quoted.
        job: JobId,
        /// Which.
        recipe: ActiveRecipe,
    },
    /// Teaching failed; the recipe before is still active.
    TeachFailed {
        /// Quoted.
        job: JobId,
        /// 1xx camera … 8xx internal.
        error_code: u16,
        /// Why.
        message: Arc<str>,
    },
    /// A step of commissioning has ended, however it ended.
    Commissioned {
        /// Quoted.
        job: JobId,
        /// The recipe that the worker is ready to measure with now.
        recipe: Option<ActiveRecipe>,
    },
    /// The head's condition changed.
    Condition(Condition),
    /// A device is lost; [`Event::Recovered`] follows when it works again.
    Faulted {
        /// 1xx camera … 8xx internal.
        error_code: u16,
        /// What happened.
        cause: Arc<str>,
        /// What to do about it.
        remedy: Arc<str>,
    },
    /// The broken device works again.
    Recovered {
        /// The recipe that the worker is ready to measure with now.
        recipe: Option<ActiveRecipe>,
    },
    /// The history cannot be written, or can again.
    History {
        /// Why not, and the remedy; `None` if it can.
        problem: Option<Arc<str>>,
    },
    /// A sequence was exposed: its timing.
    Paced(Pace),
    /// What the projector's controller says of itself.
    Projector(ProjectorHealth),
    /// The temperature of the camera's sensor, °C; none if it does not say.
    CameraTemperature(Option<f64>),
    /// What the last check of the geometry has found; none if there was none with this calibration.
    Drift(Option<Drift>),
    /// A survey of the system.
    Surveyed(System),
    /// The answer to [`Effect::PersistSeq`].
    Stored {
        /// Which.
        seq: u32,
        /// Why it is not stored.
        failed: Option<Unstored>,
    },
    /// The worker's sign of life.
    Alive,
    /// Time passes: about every 100 ms.
    Tick {
        /// The time in µs since 1970 UTC, if the clock is synchronised.
        utc_us: Option<u64>,
    },
    /// The daemon is asked to end; sent again once the measuring task no longer answers, which ends
    /// the cycle in flight.
    Stop,
}

impl Event {
    /// Whether the worker sent it: every one of these is a sign of life.
    pub fn from_worker(&self) -> bool {
        !matches!(
            self,
            Self::Write { .. }
                | Self::Request(_)
                | Self::History { .. }
                | Self::Drift(_)
                | Self::Surveyed(_)
                | Self::Stored { .. }
                | Self::Tick { .. }
                | Self::Stop
        )
    }
}

/// An order to measure.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Job {
    /// To quote.
    pub job: JobId,
    /// The token that triggered, 0 for an edge.
    pub token: u16,
    /// The token of a request by the API.
    pub request: Option<Arc<str>>,
    /// The piece's serial.
    pub part_id: u32,
    /// Stroke or pallet counter.
    pub press_stroke: u32,
    /// The recipe to measure with: the active one.
    pub recipe: ActiveRecipe,
    /// When the trigger was accepted.
    pub accepted: Micros,
}

/// Why no RESULT_SEQ may be used after the last one.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Unstored {
    /// The storage has not answered for this many milliseconds.
    Busy(u128),
    /// What the storage answered.
    Refused(Arc<str>),
}

/// Something for the daemon's threads, files and sockets to do. Carried out in order.
#[derive(Debug, Clone, PartialEq)]
pub enum Effect {
    /// Measure now.
    Measure(Job),
    /// Load a recipe.
    Load {
        /// To quote.
        job: JobId,
        /// Which.
        key: RecipeKey,
    },
    /// Teach a recipe.
    Teach {
        /// To quote.
        job: JobId,
        /// As what.
        teaching: Teaching,
    },
    /// Carry out the step of commissioning that is waiting for the worker.
    Commission {
        /// To quote.
        job: JobId,
    },
    /// Record what a PLC ordered.
    Ordered {
        /// Its address.
        from: IpAddr,
        /// What.
        order: PlcOrder,
    },
    /// End the running job early; the station still waits for its answer.
    Abort {
        /// The running job.
        job: JobId,
    },
    /// Make sure that this RESULT_SEQ is stored as used and that another one may follow, and answer
    /// with [`Event::Stored`]. Always directly before the [`Effect::Publish`] of that result; again
    /// while none may follow.
    PersistSeq(u32),
    /// A result is complete: for the history.
    Publish(Arc<ResultRecord>),
    /// Remember over a restart which SEQ was acknowledged last in BUFFERED mode, `None` outside of it.
    Buffered(Option<u32>),
    /// For the log.
    Log(Arc<str>),
    /// For the log: nothing is measured until this has ended.
    Alarm(Arc<str>),
}

/// The most effects that one event can cause (held by the random walk test).
pub const MAX_EFFECTS: usize = 16;

/// What one step wants done, in order.
pub type Effects = heapless::Vec<Effect, MAX_EFFECTS>;
