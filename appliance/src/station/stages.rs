//! The stages of a cycle, and how much wall time each took.

use serde::{Deserialize, Serialize};

/// A stage of a cycle, in the order in which they happen. In JSON it is its name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Stage {
    /// From the trigger to the measuring task.
    Waiting,
    /// From the first flip to the last frame.
    Exposure,
    /// The part's pose: some rows are decoded and a rigid motion is fitted to them.
    Alignment,
    /// Phase, height and gauges in one pass over the frames.
    Strips,
    /// Limits, verdict, and whether a longer sequence is needed.
    Judgement,
    /// The rest: between the stages above, and from the measuring task to the result.
    HandOver,
}

impl Stage {
    /// Number of stages.
    pub const COUNT: usize = 6;

    /// What it is called in JSON, CSV and metrics.
    pub fn name(self) -> &'static str {
        match self {
            Self::Waiting => "waiting",
            Self::Exposure => "exposure",
            Self::Alignment => "alignment",
            Self::Strips => "strips",
            Self::Judgement => "judgement",
            Self::HandOver => "hand-over",
        }
    }

    /// Whether the stage works on frames that are complete.
    pub fn is_processing(self) -> bool {
        !matches!(self, Self::Waiting | Self::Exposure)
    }
}

/// How long one stage took.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct StageTime {
    /// Which.
    #[serde(rename = "name")]
    pub stage: Stage,
    /// µs.
    pub us: u32,
}

/// The times of a cycle's stages, in the order in which they first happened. A stage that happens
/// again, with a longer sequence, adds to its time.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Stages(heapless::Vec<StageTime, { Stage::COUNT }>);

impl Stages {
    /// Adds time to a stage.
    pub fn add(&mut self, stage: Stage, us: u32) {
        match self.0.iter_mut().find(|known| known.stage == stage) {
            Some(known) => known.us = known.us.saturating_add(us),
            // Each stage is stored once, so the vector never overflows.
            None => drop(self.0.push(StageTime { stage, us })),
        }
    }

    /// Adds the times of others.
    pub fn extend(&mut self, others: &Self) {
        for time in others.iter() {
            self.add(time.stage, time.us);
        }
    }

    /// The times.
    pub fn iter(&self) -> impl Iterator<Item = StageTime> {
        self.0.iter().copied()
    }

    /// Their sum, µs.
    pub fn sum_us(&self) -> u32 {
        self.iter().fold(0, |sum, time| sum.saturating_add(time.us))
    }

    /// The sum of the processing stages, µs.
    pub fn processing_us(&self) -> u32 {
        let processing = self.iter().filter(|time| time.stage.is_processing());
        processing.fold(0, |sum, time| sum.saturating_add(time.us))
    }

    /// The stages of a cycle that took `total_us`: the time of no other stage is hand-over. Empty
    /// if no stage is known.
    pub fn of_cycle(&self, total_us: u32) -> Self {
        let mut all = self.clone();
        if !all.0.is_empty() {
            all.add(Stage::HandOver, total_us.saturating_sub(self.sum_us()));
        }
        all
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_stages_of_a_cycle_add_up_to_its_time_also_where_one_happened_twice() {
        let mut stages = Stages::default();
        assert_eq!(stages.of_cycle(1000), Stages::default());
        for (stage, us) in [
            (Stage::Waiting, 10),
            (Stage::Exposure, 400),
            (Stage::Strips, 50),
            (Stage::Exposure, 300),
            (Stage::Strips, 60),
        ] {
            stages.add(stage, us);
        }
        let cycle = stages.of_cycle(1000);
        let times: Vec<_> = cycle
            .iter()
            .map(|time| (time.stage.name(), time.us))
            .collect();
        let expected = [
            ("waiting", 10),
            ("exposure", 700),
            ("strips", 110),
            ("hand-over", 180),
        ];
        assert_eq!(times, expected);
        assert_eq!((cycle.sum_us(), cycle.processing_us()), (1000, 290));
    }

    #[test]
    fn every_stage_has_room() {
        let all = [
            Stage::Waiting,
            Stage::Exposure,
            Stage::Alignment,
            Stage::Strips,
            Stage::Judgement,
            Stage::HandOver,
        ];
        let mut stages = Stages::default();
        for stage in all {
            stages.add(stage, 1);
        }
        assert_eq!((all.len(), stages.sum_us()), (Stage::COUNT, 6));
    }
}
