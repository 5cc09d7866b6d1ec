//! The states of the station, each with the data that it needs.

use std::sync::Arc;

use serde::Serialize;

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

/// How far a load has come.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LoadProgress {
    /// 0…1.
    pub fraction: f32,
    /// The present stage, for people.
    pub words: Arc<str>,
}

/// How far teaching has come.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TeachProgress {
    /// The recipe being taught.
    pub number: u16,
    /// 0…1.
    pub fraction: f32,
    /// The present stage of teaching, for people.
    pub words: Arc<str>,
}

/// What the station is doing. The numbers of register 104 are in [`State::named`].
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
        /// Which recipe is loaded.
        key: RecipeKey,
        /// How far it has come.
        progress: LoadProgress,
        /// The next sign of life must come by then.
        deadline: Micros,
    },
    /// The worker teaches a recipe.
    Teaching {
        /// What the worker quotes in its answers.
        job: JobId,
        /// How far it has come.
        progress: TeachProgress,
        /// The next sign of life must come by then.
        deadline: Micros,
    },
    /// The worker carries out a step of commissioning.
    Commissioning {
        /// What the worker quotes in its answers.
        job: JobId,
        /// The next sign of life must come by then.
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
    /// Number and word of register 104, as the map and the page use them.
    pub fn named(&self) -> (u16, &'static str) {
        match self {
            Self::Boot { .. } => (0, "boot"),
            Self::Ready => (1, "ready"),
            Self::Acquiring { .. } => (2, "acquiring"),
            Self::Processing { .. } => (3, "processing"),
            Self::Loading { .. } => (4, "loading"),
            Self::Teaching { .. } => (5, "teaching"),
            Self::Offline => (6, "offline"),
            Self::Fault(_) => (7, "fault"),
            Self::Stopping { .. } => (8, "stopping"),
            Self::Commissioning { .. } => (9, "commissioning"),
        }
    }

    /// The word of register 104.
    pub fn word(&self) -> &'static str {
        self.named().1
    }

    /// The deadline, where the state waits for the worker.
    pub fn deadline(&self) -> Option<Micros> {
        match self {
            Self::Boot { deadline }
            | Self::Acquiring { deadline, .. }
            | Self::Processing { deadline, .. }
            | Self::Loading { deadline, .. }
            | Self::Teaching { deadline, .. }
            | Self::Commissioning { deadline, .. } => Some(*deadline),
            Self::Ready | Self::Offline | Self::Fault(_) | Self::Stopping { .. } => None,
        }
    }

    /// Moves the deadline, where the state waits for the worker.
    pub(super) fn set_deadline(&mut self, to: Micros) {
        match self {
            Self::Boot { deadline }
            | Self::Acquiring { deadline, .. }
            | Self::Processing { deadline, .. }
            | Self::Loading { deadline, .. }
            | Self::Teaching { deadline, .. }
            | Self::Commissioning { deadline, .. } => *deadline = to,
            Self::Ready | Self::Offline | Self::Fault(_) | Self::Stopping { .. } => {}
        }
    }

    /// The trigger being served.
    pub fn cycle(&self) -> Option<&Cycle> {
        match self {
            Self::Acquiring { cycle, .. } | Self::Processing { cycle, .. } => Some(cycle),
            Self::Stopping { cycle } => cycle.as_ref(),
            _ => None,
        }
    }

    /// The job that the worker is doing in this state.
    pub fn job(&self) -> Option<JobId> {
        match self {
            Self::Loading { job, .. }
            | Self::Teaching { job, .. }
            | Self::Commissioning { job, .. } => Some(*job),
            _ => self.cycle().map(|cycle| cycle.order.job),
        }
    }
}
