//! How long the stages of an inspection take.

use crate::station::{Stage, Stages};
use std::time::Instant;

/// Measures how long stages take, each from the end of the one before.
pub(super) struct Laps {
    pub stages: Stages,
    since: Instant,
}

impl Laps {
    pub fn since(since: Instant) -> Self {
        let stages = Stages::default();
        Self { stages, since }
    }

    pub fn end(&mut self, stage: Stage) {
        let now = Instant::now();
        let us = (now - self.since).as_micros();
        self.stages
            .add(stage, u32::try_from(us).unwrap_or(u32::MAX));
        self.since = now;
    }
}
