//! The part that comes in front of a simulated head once a good one is taught.

use super::Worker;
use crate::station::{Event, JobId};

impl Worker {
    /// Puts the part in place that waited for a good one to be taught.
    pub(super) fn place_waiting(&mut self, job: JobId) {
        let Some((stage, placed)) = self.opened.stage.as_ref().zip(self.waiting.take()) else {
            return;
        };
        let (station, pulse) = (&self.station, &self.pulse);
        let progress = |share: f64| {
            pulse.beat();
            station.event(Event::Progress {
                job,
                fraction: share as f32,
                words: "putting the part in front of the head".into(),
            });
        };
        let place = || stage.place_with_progress(&placed.part, &placed.placement, &progress);
        let shown = self.computing.on(|| self.pool.install(place));
        if let Err(error) = shown {
            self.progress.warn(&error.to_string());
        }
    }
}
