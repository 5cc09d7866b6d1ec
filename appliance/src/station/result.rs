//! A result: the outcome of one cycle, as the worker reports it and as registers and page show it.

use std::sync::Arc;

use algo::inspect::{FoundFeature, MAX_FEATURES};
use serde::{Deserialize, Serialize};

use super::gauge::GaugeValue;
use super::stages::Stages;

/// The most gauges that a recipe can have: bits and registers of the map.
pub use algo::inspect::MAX_GAUGES;
/// Pixels of a cycle that were not computed, and those that needed the slower exact solution.
pub use algo::inspect::Skipped;

/// The verdict of one cycle: register 208.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "UPPERCASE")]
pub enum Verdict {
    /// 0: nothing was judged.
    #[default]
    None,
    /// 1: every gauge was measured and lies within its limits.
    Pass,
    /// 2: every gauge was measured or is absent, and at least one is absent or lies outside.
    Fail,
    /// 3: something could not be measured, or a value lies so close to a limit that neither PASS
    /// nor FAIL is proven.
    Invalid,
}

impl Verdict {
    /// The number of register 208.
    pub fn number(self) -> u16 {
        self as u16
    }

    /// The verdict of this number.
    pub fn of_number(number: u16) -> Option<Self> {
        let mut all = [Self::None, Self::Pass, Self::Fail, Self::Invalid].into_iter();
        all.find(|verdict| verdict.number() == number)
    }

    /// The judgement of this word: PASS, FAIL or INVALID.
    pub fn of_word(word: &str) -> Option<Self> {
        let mut all = [Self::Pass, Self::Fail, Self::Invalid].into_iter();
        all.find(|verdict| verdict.word() == word)
    }

    /// The word.
    pub fn word(self) -> &'static str {
        match self {
            Self::None => "NONE",
            Self::Pass => "PASS",
            Self::Fail => "FAIL",
            Self::Invalid => "INVALID",
        }
    }
}

/// RESULT flags, register 231.
pub mod flag {
    bits! {
        /// A pattern was retried.
        RETRIED = 0, "a pattern was taken again";
        /// A single level was used.
        SINGLE_LEVEL = 1, "a single level was used";
        /// Two levels were used.
        TWO_LEVELS = 2, "two levels were used";
        /// The full sequence was used.
        FULL_SEQUENCE = 3, "the full sequence was used";
        /// Stepped up from a shorter sequence.
        STEPPED_UP = 4, "measured again with a longer sequence";
        /// The head is simulated.
        SIMULATED = 5, "the head is simulated";
        /// Measured while warming up.
        WARM_UP = 6, "measured while warming up";
        /// At least one decision is doubtful; the station sets it from the gauges.
        DOUBTFUL = 7, "a decision is doubtful";
        /// The recipe has no limit that a part can miss: PASS says only that the part was measured.
        JUDGES_NOTHING = 8, "the recipe judges nothing: no gauge has a limit that a part can miss";
    }
}

/// The pose of a part relative to its pose at teaching.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Placement {
    /// Translation of the middle of its surface along x, y, z in mm, and rotation vector about it
    /// in degrees; `None` where the part's shape does not determine the component.
    pub values: [Option<f64>; 6],
    /// Displacement of the corner of the part's bounding box that moved farthest.
    pub reach_mm: f64,
    /// Share of the sampled points that do not fit: they lie on defects, or their fringe order is
    /// wrong.
    pub outliers: f64,
}

impl Placement {
    /// Names of the six components: shifts, then turns.
    pub const COMPONENTS: [&str; 6] = ["x", "y", "z", "about x", "about y", "about z"];

    /// The names of the components that the part's shape does not determine.
    pub fn undetermined(&self) -> Vec<&'static str> {
        let pairs = Self::COMPONENTS.into_iter().zip(self.values);
        pairs
            .filter(|(_, value)| value.is_none())
            .map(|(name, _)| name)
            .collect()
    }
}

/// Light that changed within a cycle, frame by frame against the mean of the frame's level; values
/// were corrected for it.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct UnsteadyLight {
    /// Other light, counts where the part is.
    pub other_counts: Vec<f64>,
    /// The projector's light, as a share.
    pub gain: Vec<f64>,
    /// By how much fringes were moved, turns: the part shook.
    pub shift_turns: Vec<f64>,
    /// The frequency of lamps that other light changes with, Hz, where the frames tell it.
    pub hz: Option<u32>,
}

/// The worker's report of one cycle; what the page shows of it as it is, under the fields' names.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Inspection {
    /// The worker's judgement; [`Inspection::verdict`] is what counts.
    #[serde(skip)]
    pub judged: Verdict,
    /// Why it is INVALID, in words; empty otherwise.
    pub reason: Option<Arc<str>>,
    /// 0, or why it is INVALID as a code.
    #[serde(skip)]
    pub error_code: u16,
    /// What the part's frames show of the head: WARNING bits `LOW_LIGHT`, `SATURATION`,
    /// `PATTERN_UNFIT`, `FRAME_SLIP`, `UNSTEADY_LIGHT`.
    #[serde(skip)]
    pub warnings: u16,
    /// The recipe's gauges, by ascending slots.
    #[serde(skip)]
    pub gauges: heapless::Vec<GaugeValue, MAX_GAUGES>,
    /// Resolved pixels.
    pub valid_points: u32,
    /// Share of the surface compared with golden that is resolved, ‰.
    pub coverage_permille: u16,
    /// Head temperature, °C.
    pub temperature_c: Option<f64>,
    /// Height noise from the measured modulation, 1 σ, mm.
    pub height_noise_mm: f64,
    /// Pattern fitness, ‰; 1000 = as taught.
    pub fitness_permille: u16,
    /// See [`flag`].
    #[serde(skip)]
    pub flags: u16,
    /// What was not computed.
    pub skipped: Skipped,
    /// What the measuring task knows of its stages' times; [`ResultRecord::stages`] adds the rest.
    pub stages: Stages,
    /// Processor time of the processing, summed over all computing threads, µs. Unlike the times
    /// above it does not grow when other programs use the processor.
    pub cpu_us: u32,
    /// The part's pose, if it was aligned.
    pub placement: Option<Placement>,
    /// How the light changed from frame to frame, if it did beyond noise.
    pub light: Option<Arc<UnsteadyLight>>,
    /// Its planes and contours.
    #[serde(skip)]
    pub features: heapless::Vec<FoundFeature, MAX_FEATURES>,
    /// Why the part should be measured again with the next longer sequence, if it should and there
    /// is one.
    #[serde(skip)]
    pub step_up: Option<&'static str>,
}

impl Inspection {
    /// The verdict that is shown. The worker's judgement can make it worse than the gauges say,
    /// never better: it is INVALID without a judgement, without gauges, or with a gauge that was
    /// neither measured nor found absent, whatever the others say; it is not PASS with a gauge that
    /// is absent, outside its limits, or in a guard band.
    pub fn verdict(&self) -> Verdict {
        let unseen =
            self.gauges.is_empty() || self.gauges.iter().any(|gauge| gauge.decision.unseen());
        match self.judged {
            Verdict::None | Verdict::Invalid => Verdict::Invalid,
            Verdict::Pass | Verdict::Fail if unseen => Verdict::Invalid,
            Verdict::Pass if self.gauges.iter().any(|gauge| !gauge.decision.pass) => {
                match self.guarded().next() {
                    Some(_) => Verdict::Invalid,
                    None => Verdict::Fail,
                }
            }
            judged => judged,
        }
    }

    /// The gauges whose values lie in a guard band, if none is absent or lies outside its limits.
    pub fn guarded(&self) -> impl Iterator<Item = &GaugeValue> {
        let none = !self.gauges.iter().any(|gauge| gauge.decision.failed());
        let guarded = move |gauge: &&GaugeValue| none && gauge.decision.guarded();
        self.gauges.iter().filter(guarded)
    }
}

/// A complete result: what registers 200–319 show.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct ResultRecord {
    /// RESULT_SEQ of this result.
    pub seq: u32,
    /// The token that triggered, 0 for an edge.
    pub token: u16,
    /// The token of a request by the API.
    pub request: Option<Arc<str>>,
    /// Recipe number.
    pub recipe: u16,
    /// The recipe's name at the trigger.
    pub recipe_name: Arc<str>,
    /// First 32 bits of the recipe's fingerprint.
    #[serde(skip)]
    pub recipe_crc: u32,
    /// PART_ID at the trigger.
    pub part_id: u32,
    /// PRESS_STROKE at the trigger.
    pub press_stroke: u32,
    /// Never [`Verdict::None`] in a result.
    pub verdict: Verdict,
    /// Why there is no measurement: 0 if there is one.
    pub error_code: u16,
    /// Trigger time in µs since 1970 UTC, 0 if the clock is not synchronised.
    pub time_utc_us: u64,
    /// Trigger time since the start of the daemon, s; also known while the clock is not
    /// synchronised.
    #[serde(skip)]
    pub uptime_s: u32,
    /// BOOT_ID of that start.
    #[serde(skip)]
    pub boot_id: u32,
    /// Trigger → exposure done, µs.
    pub exposure_us: u32,
    /// Trigger → result, µs.
    pub total_us: u32,
    /// The worker's report. After a failure it is empty but for `reason`.
    #[serde(flatten)]
    pub inspection: Arc<Inspection>,
}

impl ResultRecord {
    /// The stages from trigger to result; empty where nothing was measured.
    pub fn stages(&self) -> Stages {
        self.inspection.stages.of_cycle(self.total_us)
    }

    /// The flags of register 231.
    pub fn flags(&self) -> u16 {
        let doubtful = self
            .inspection
            .gauges
            .iter()
            .any(|gauge| gauge.decision.doubtful);
        self.inspection.flags | if doubtful { flag::DOUBTFUL } else { 0 }
    }
}

#[cfg(test)]
mod tests {
    use super::super::gauge::{GaugeLimits, Measured, Unit};
    use super::*;

    fn inspection(judged: Verdict, values: &[Option<f64>]) -> Inspection {
        let gauges = values
            .iter()
            .map(|&value| {
                GaugeValue::judged(
                    1,
                    "g",
                    Unit::Length,
                    Measured::new(value, None),
                    (Some(-1.0), Some(1.0)),
                )
            })
            .collect();
        Inspection {
            judged,
            gauges,
            ..Default::default()
        }
    }

    #[test]
    fn nothing_that_was_not_measured_can_read_as_pass() {
        assert_eq!(
            inspection(Verdict::Pass, &[Some(0.0)]).verdict(),
            Verdict::Pass
        );
        assert_eq!(inspection(Verdict::Pass, &[]).verdict(), Verdict::Invalid);
        assert_eq!(
            inspection(Verdict::Pass, &[Some(0.0), None]).verdict(),
            Verdict::Invalid
        );
        assert_eq!(
            inspection(Verdict::Pass, &[Some(f64::NAN)]).verdict(),
            Verdict::Invalid
        );
        assert_eq!(
            inspection(Verdict::Pass, &[Some(0.0), Some(1.1)]).verdict(),
            Verdict::Fail
        );
        let mut close = inspection(Verdict::Pass, &[Some(0.95), Some(0.0)]);
        let limits = GaugeLimits {
            low: Some(-1.0),
            high: Some(1.0),
            guard_k: 2.0,
        };
        let measured = Measured::new(Some(0.95), Some(0.05));
        close.gauges[0] = GaugeValue::judged(1, "g", Unit::Length, measured, limits);
        assert_eq!(close.verdict(), Verdict::Invalid);
        close.gauges[1] = inspection(Verdict::Pass, &[Some(1.1)]).gauges[0].clone();
        assert_eq!(close.verdict(), Verdict::Fail);
        assert_eq!(
            inspection(Verdict::None, &[Some(0.0)]).verdict(),
            Verdict::Invalid
        );
        assert_eq!(
            inspection(Verdict::Fail, &[Some(1.1), None]).verdict(),
            Verdict::Invalid
        );
    }

    #[test]
    fn what_is_absent_makes_fail_and_what_is_unseen_beside_it_makes_invalid() {
        let absent = |mut of: Inspection| {
            let measured = Measured {
                absent: true,
                ..Measured::default()
            };
            let gauge = GaugeValue::judged(2, "hole", Unit::Length, measured, (None, None));
            let _ = of.gauges.push(gauge);
            of.verdict()
        };
        for judged in [Verdict::Pass, Verdict::Fail] {
            assert_eq!(absent(inspection(judged, &[Some(0.0)])), Verdict::Fail);
            assert_eq!(absent(inspection(judged, &[])), Verdict::Fail);
            assert_eq!(absent(inspection(judged, &[Some(1.1)])), Verdict::Fail);
            assert_eq!(absent(inspection(judged, &[None])), Verdict::Invalid);
        }
        assert_eq!(
            absent(inspection(Verdict::Invalid, &[Some(0.0)])),
            Verdict::Invalid
        );
        let mut close = inspection(Verdict::Pass, &[]);
        let limits = GaugeLimits {
            low: None,
            high: Some(1.0),
            guard_k: 2.0,
        };
        let measured = Measured::new(Some(0.95), Some(0.05));
        let gauge = GaugeValue::judged(1, "g", Unit::Length, measured, limits);
        let _ = close.gauges.push(gauge);
        assert_eq!(close.verdict(), Verdict::Invalid, "in the guard band");
        assert_eq!(absent(close), Verdict::Fail);
    }
}
