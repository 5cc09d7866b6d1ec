//! The states of the station, each with the data that it needs, and the station's time.

use std::sync::Arc;

use super::event::{JobId, RecipeKey};

/// Time since the start of the daemon in µs, on a clock that never runs backwards. Always an argument, never read.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Micros(pub u64);

impl Micros {
    /// A span of `ms` milliseconds.
    pub const fn from_millis(ms: u64) -> Self {
        Self(ms.saturating_mul(1000))
    }

    /// This time plus a span; saturates.
    pub const fn after(self, span: Self) -> Self {
        Self(self.0.saturating_add(span.0))
    }

    /// The span from `earlier` to this time; zero if `earlier` is later.
    pub const fn since(self, earlier: Self) -> Self {
        Self(self.0.saturating_sub(earlier.0))
    }

    /// Whole seconds; saturates at 136 years.
    pub fn seconds(self) -> u32 {
        u32::try_from(self.0 / 1_000_000).unwrap_or(u32::MAX)
    }

    /// The number of µs for a 32-bit register; saturates at about 71 minutes.
    pub fn to_u32(self) -> u32 {
        u32::try_from(self.0).unwrap_or(u32::MAX)
    }
}

/// The recipe that the worker has ready in its hands.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ActiveRecipe {
    /// 1–9999.
    pub number: u16,
    /// First 32 bits of the recipe's fingerprint.
    pub crc: u32,
    /// What RECIPE_SELECT 65535 selects it by.
    pub part_number: Arc<str>,
    /// For people.
    pub name: Arc<str>,
}

/// One accepted trigger on its way to a verdict: what was latched when it was accepted.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Cycle {
    /// What the worker quotes in its answers.
    pub job: JobId,
    /// The token that triggered, 0 for an edge.
    pub token: u16,
    /// PART_ID at the trigger.
    pub part_id: u32,
    /// PRESS_STROKE at the trigger.
    pub press_stroke: u32,
    /// The recipe active at the trigger.
    pub recipe: ActiveRecipe,
    /// When the trigger was accepted.
    pub accepted: Micros,
    /// When the last frame was exposed, as far as known.
    pub exposed: Option<Micros>,
}

/// What must happen before a fault can be cleared.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ClearedBy {
    /// The worker missed a deadline: ERROR_RESET, once the worker has given a sign of life since.
    SignOfLife,
    /// The worker reported a broken device: clears by itself when the worker reports its recovery.
    Recovery,
    /// Results cannot be stored: clears by itself when they can.
    Storage,
    /// The worker was silent while it had nothing to do: clears by itself with its next sign of life.
    Life,
}

/// A lasting condition that keeps the station from measuring.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Fault {
    /// ERROR_CODE.
    pub code: u16,
    /// What happened, with numbers.
    pub cause: Arc<str>,
    /// What clears it.
    pub remedy: Arc<str>,
    /// Since when.
    pub since: Micros,
    /// What must happen first.
    pub cleared_by: ClearedBy,
}

/// What the station is doing. The numbers of register 104 are [`State::number`].
#[derive(Debug, Clone, PartialEq)]
pub enum State {
    /// The worker has not reported its head yet.
    Boot {
        /// A fault follows when the worker is silent until then.
        deadline: Micros,
    },
    /// Waiting for a trigger; READY if there is a recipe.
    Ready,
    /// The head exposes.
    Acquiring {
        /// The trigger being served.
        cycle: Cycle,
        /// The exposure must be done by then.
        deadline: Micros,
    },
    /// The part may move; the worker computes.
    Processing {
        /// The trigger being served.
        cycle: Cycle,
        /// The result must be there by then.
        deadline: Micros,
    },
    /// The worker prepares a recipe.
    Loading {
        /// What the worker quotes in its answer.
        job: JobId,
        /// Which recipe.
        key: RecipeKey,
        /// It must be ready by then.
        deadline: Micros,
    },
    /// The worker teaches a recipe.
    Teaching {
        /// What the worker quotes in its answers.
        job: JobId,
        /// The recipe being taught.
        number: u16,
        /// 0…1.
        fraction: f32,
        /// What it is doing.
        words: Arc<str>,
        /// The next sign of progress must come by then.
        deadline: Micros,
    },
    /// Ready but for the PLC, which does not ask for ONLINE.
    Offline,
    /// A lasting condition; triggers are rejected with reason 5.
    Fault(Fault),
    /// The daemon ends; the cycle in flight may still bring its result.
    Stopping {
        /// The cycle in flight.
        cycle: Option<Cycle>,
    },
}

impl State {
    /// The number of register 104.
    pub fn number(&self) -> u16 {
        match self {
            Self::Boot { .. } => 0,
            Self::Ready => 1,
            Self::Acquiring { .. } => 2,
            Self::Processing { .. } => 3,
            Self::Loading { .. } => 4,
            Self::Teaching { .. } => 5,
            Self::Offline => 6,
            Self::Fault(_) => 7,
            Self::Stopping { .. } => 8,
        }
    }

    /// The word for register 104's number, as the map and the page use it.
    pub fn word(&self) -> &'static str {
        match self {
            Self::Boot { .. } => "boot",
            Self::Ready => "ready",
            Self::Acquiring { .. } => "acquiring",
            Self::Processing { .. } => "processing",
            Self::Loading { .. } => "loading",
            Self::Teaching { .. } => "teaching",
            Self::Offline => "offline",
            Self::Fault(_) => "fault",
            Self::Stopping { .. } => "stopping",
        }
    }

    /// The deadline of the wait that this state is, if it is one.
    pub fn deadline(&self) -> Option<Micros> {
        match self {
            Self::Boot { deadline }
            | Self::Acquiring { deadline, .. }
            | Self::Processing { deadline, .. }
            | Self::Loading { deadline, .. }
            | Self::Teaching { deadline, .. } => Some(*deadline),
            Self::Ready | Self::Offline | Self::Fault(_) | Self::Stopping { .. } => None,
        }
    }

    /// The job that the worker is doing in this state.
    pub fn job(&self) -> Option<JobId> {
        match self {
            Self::Acquiring { cycle, .. } | Self::Processing { cycle, .. } => Some(cycle.job),
            Self::Stopping { cycle } => cycle.as_ref().map(|cycle| cycle.job),
            Self::Loading { job, .. } | Self::Teaching { job, .. } => Some(*job),
            Self::Boot { .. } | Self::Ready | Self::Offline | Self::Fault(_) => None,
        }
    }
}
