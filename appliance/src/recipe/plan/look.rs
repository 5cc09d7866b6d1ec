//! A part that is judged, with what is said and drawn of its features.

use super::Plan;
use super::laps::Laps;
use crate::recipe::Seen;
use crate::station::Inspection;
use algo::inspect::{Drawing, Maps};
use hal::frame::Frame;
use std::time::Instant;

impl Plan {
    /// Judges a part as [`Self::inspect`] does, and says what became of the features that gauges
    /// need.
    pub fn look(&self, sequence: usize, frames: &[Frame]) -> (Inspection, Vec<Seen<'_>>) {
        let mut laps = Laps::since(Instant::now());
        let mut strips = self.strips();
        let of = (self.arriving(sequence), frames);
        let found = self.run(&mut strips, of, Maps::default(), &mut laps);
        let inspection = self.judged((sequence, frames), found, &mut laps);
        let seen = self.runs.get(sequence).map(|run| {
            let drawing = Drawing::new(&run.production, &strips);
            self.outline.features(&inspection, &drawing)
        });
        let seen = seen.unwrap_or_default();
        drop(strips);
        (inspection, seen)
    }
}
