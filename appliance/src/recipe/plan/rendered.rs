//! Cycles of a part that is not there: golden as a displaced part would be measured, judged as
//! production would.

use super::Plan;
use super::laps::Laps;
use crate::station::Inspection;
use algo::geometry::Vector;
use algo::inspect::{Input, Maps, Motion, Signal};
use algo::units::Modulation;
use std::time::Instant;

impl Plan {
    /// Judges the part as taught after a motion, by one sequence after the other as production
    /// does. `light` is golden's modulation by each of the plan's sequences; other seeds give other
    /// noise. `None` for sequences of two frames.
    pub(in crate::recipe) fn inspect_rendered(
        &self,
        motion: &Motion,
        light: &[Vec<Modulation>],
        seed: u64,
    ) -> Option<Inspection> {
        let mut sequence = 0;
        loop {
            let run = self.runs.get(sequence).filter(|run| run.pair.is_none())?;
            let phases = run
                .production
                .rendered(motion, &light[sequence], Some(seed));
            let mut laps = Laps::since(Instant::now());
            let mut strips = self.strips();
            let input = (Input::Phases(&phases), Signal::None);
            let placed = run.production.place_rendered(&phases, &mut strips, motion);
            let findings = placed.and_then(|placed| {
                run.production
                    .inspect_placed(input, &mut strips, placed, Maps::default())
            });
            drop(strips);
            let findings = findings.map(|findings| (findings, None));
            let found = findings.map_err(|error| error.to_string().into());
            let inspection = self.judged((sequence, &[]), found, &mut laps);
            sequence += 1;
            if inspection.step_up.is_none() || sequence == self.runs.len() {
                return Some(inspection);
            }
        }
    }

    /// Corners of the box around the part as taught; none if parts are not aligned.
    pub(in crate::recipe) fn corners(&self) -> &[Vector] {
        self.production().corners()
    }
}
