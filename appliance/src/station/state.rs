//! The states of the station, each with the data that it needs.

use std::sync::Arc;

use super::clock::Micros;
use super::event::{Job, JobId};
use super::fault::Fault;
use super::recipes::RecipeKey;

/// One accepted trigger on its way to a verdict.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Cycle {
    /// What was latched when it was accepted.
    pub order: Job,
    /// When the last frame was exposed, as far as known.
    pub exposed: Option<Micros>,
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
        /// The present stage of teaching, for people.
        words: Arc<str>,
        /// The next sign of progress must come by then.
        deadline: Micros,
    },
    /// As ready, but the PLC does not ask for ONLINE.
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

    /// The deadline, where the state waits for the worker.
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
            Self::Acquiring { cycle, .. } | Self::Processing { cycle, .. } => Some(cycle.order.job),
            Self::Stopping { cycle } => cycle.as_ref().map(|cycle| cycle.order.job),
            Self::Loading { job, .. } | Self::Teaching { job, .. } => Some(*job),
            Self::Boot { .. } | Self::Ready | Self::Offline | Self::Fault(_) => None,
        }
    }
}
