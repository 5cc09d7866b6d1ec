//! A result: what one cycle found, as the worker reports it and as the registers and the page show it.

use std::sync::Arc;

/// The most gauges that a recipe can have: bits and registers of the map.
pub const MAX_GAUGES: usize = 16;
/// The most stages whose time is shown.
pub const MAX_STAGES: usize = 12;

/// The judgement of one cycle: register 208.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Verdict {
    /// 0: nothing was judged.
    #[default]
    None,
    /// 1: every gauge was measured and lies within its limits.
    Pass,
    /// 2: every gauge was measured and at least one lies outside.
    Fail,
    /// 3: something could not be measured.
    Invalid,
}

impl Verdict {
    /// The number of register 208.
    pub fn number(self) -> u16 {
        match self {
            Self::None => 0,
            Self::Pass => 1,
            Self::Fail => 2,
            Self::Invalid => 3,
        }
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

/// What a gauge's value is: registers 554–569.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Unit {
    /// 0: a bare number; register step 0.0001.
    #[default]
    None,
    /// 1: mm; register step 0.1 µm.
    Length,
    /// 2: degrees; register step 0.0001°.
    Angle,
    /// 3: mm³; register step 0.01 mm³.
    Volume,
    /// 4: 0…1; register step 0.1 ‰.
    Share,
}

impl Unit {
    /// The number of registers 554–569.
    pub fn number(self) -> u16 {
        match self {
            Self::None => 0,
            Self::Length => 1,
            Self::Angle => 2,
            Self::Volume => 3,
            Self::Share => 4,
        }
    }

    /// Register steps per mm, °, mm³ or 1.
    pub fn steps(self) -> f64 {
        match self {
            Self::Volume => 100.0,
            Self::None | Self::Length | Self::Angle | Self::Share => 10_000.0,
        }
    }

    /// The symbol behind a value.
    pub fn symbol(self) -> &'static str {
        match self {
            Self::None | Self::Share => "",
            Self::Length => "mm",
            Self::Angle => "°",
            Self::Volume => "mm³",
        }
    }
}

/// What was decided about one gauge: bits 0–4 of registers 296–311.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Decision {
    /// Measured and within its limits.
    pub pass: bool,
    /// Measured.
    pub valid: bool,
    /// Below its lower limit.
    pub low: bool,
    /// Above its upper limit.
    pub high: bool,
    /// A limit lies within 2 σ of the value.
    pub doubtful: bool,
}

impl Decision {
    /// The bits of registers 296–311.
    pub fn bits(self) -> u16 {
        [self.pass, self.valid, self.low, self.high, self.doubtful]
            .iter()
            .enumerate()
            .fold(0, |bits, (k, &set)| bits | (u16::from(set) << k))
    }

    /// The decision that a value, its σ and its limits (inclusive) lead to. No value, or one that is not finite: nothing but
    /// invalid.
    pub fn of(value: Option<f64>, sigma: Option<f64>, low: Option<f64>, high: Option<f64>) -> Self {
        let Some(value) = value.filter(|value| value.is_finite()) else {
            return Self::default();
        };
        let below = low.is_some_and(|limit| value < limit);
        let above = high.is_some_and(|limit| value > limit);
        let near = |limit: Option<f64>| {
            limit
                .zip(sigma)
                .is_some_and(|(limit, sigma)| (value - limit).abs() < 2.0 * sigma)
        };
        Self {
            pass: !below && !above,
            valid: true,
            low: below,
            high: above,
            doubtful: near(low) || near(high),
        }
    }
}

/// One gauge of a result. Values in mm, °, mm³ or as a share 0…1.
#[derive(Debug, Clone, PartialEq)]
pub struct GaugeValue {
    /// The gauge's name in the recipe.
    pub name: Arc<str>,
    /// What the value is.
    pub unit: Unit,
    /// `None` if it could not be measured.
    pub value: Option<f64>,
    /// One standard deviation of the value, as far as predicted.
    pub sigma: Option<f64>,
    /// The lower limit.
    pub low: Option<f64>,
    /// The upper limit.
    pub high: Option<f64>,
    /// What was decided.
    pub decision: Decision,
}

impl GaugeValue {
    /// A gauge with the decision that its numbers lead to.
    pub fn judged(
        name: &str,
        unit: Unit,
        value: Option<f64>,
        sigma: Option<f64>,
        limits: (Option<f64>, Option<f64>),
    ) -> Self {
        let (low, high) = limits;
        Self {
            name: name.into(),
            unit,
            value,
            sigma,
            low,
            high,
            decision: Decision::of(value, sigma, low, high),
        }
    }
}

/// How long one stage of a cycle took.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct StageTime {
    /// The stage's name.
    pub name: &'static str,
    /// µs.
    pub us: u32,
}

/// RESULT flags, register 231.
pub mod flag {
    /// A pattern was retried.
    pub const RETRIED: u16 = 1 << 0;
    /// A single level was used.
    pub const SINGLE_LEVEL: u16 = 1 << 1;
    /// Two levels were used.
    pub const TWO_LEVELS: u16 = 1 << 2;
    /// The full sequence was used.
    pub const FULL_SEQUENCE: u16 = 1 << 3;
    /// Stepped up from a shorter sequence.
    pub const STEPPED_UP: u16 = 1 << 4;
    /// The head is simulated.
    pub const SIMULATED: u16 = 1 << 5;
    /// Measured while warming up.
    pub const WARM_UP: u16 = 1 << 6;
    /// At least one decision is doubtful; the station sets it from the gauges.
    pub const DOUBTFUL: u16 = 1 << 7;
}

/// What the worker found in one cycle.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Inspection {
    /// The worker's judgement; [`Inspection::verdict`] is what counts.
    pub judged: Verdict,
    /// Why it is INVALID, in words; empty otherwise.
    pub reason: Option<Arc<str>>,
    /// 0, or why it is INVALID as a code.
    pub error_code: u16,
    /// The recipe's gauges, in its order.
    pub gauges: heapless::Vec<GaugeValue, MAX_GAUGES>,
    /// Resolved pixels.
    pub valid_points: u32,
    /// Share of the regions that is resolved, ‰.
    pub coverage_permille: u16,
    /// Head temperature, °C.
    pub temperature_c: Option<f64>,
    /// Height noise from the measured modulation, 1 σ, mm.
    pub height_noise_mm: f64,
    /// Pattern fitness, ‰; 1000 = as taught.
    pub fitness_permille: u16,
    /// See [`flag`].
    pub flags: u16,
    /// Times of the stages, in their order.
    pub stages: heapless::Vec<StageTime, MAX_STAGES>,
}

impl Inspection {
    /// The verdict that may be shown. The worker can judge more sharply than the gauges say, never more kindly: without a
    /// judgement, without gauges or with a gauge that was not measured it is INVALID, with a gauge outside its limits it is no PASS.
    pub fn verdict(&self) -> Verdict {
        let unmeasured =
            self.gauges.is_empty() || self.gauges.iter().any(|gauge| !gauge.decision.valid);
        match self.judged {
            Verdict::None | Verdict::Invalid => Verdict::Invalid,
            Verdict::Pass | Verdict::Fail if unmeasured => Verdict::Invalid,
            Verdict::Pass if self.gauges.iter().any(|gauge| !gauge.decision.pass) => Verdict::Fail,
            judged => judged,
        }
    }
}

/// A complete result: what registers 200–319 show.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ResultRecord {
    /// RESULT_SEQ of this result.
    pub seq: u32,
    /// The token that triggered, 0 for an edge.
    pub token: u16,
    /// Recipe number.
    pub recipe: u16,
    /// First 32 bits of the recipe's fingerprint.
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
    /// Trigger → exposure done, µs.
    pub exposure_us: u32,
    /// Trigger → result, µs.
    pub total_us: u32,
    /// What the worker found; empty after a failure, with `reason` saying why.
    pub inspection: Arc<Inspection>,
}

impl ResultRecord {
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
    use super::*;

    fn inspection(judged: Verdict, values: &[Option<f64>]) -> Inspection {
        let gauges = values
            .iter()
            .map(|&value| {
                GaugeValue::judged("g", Unit::Length, value, None, (Some(-1.0), Some(1.0)))
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
    fn a_limit_within_two_sigma_makes_a_decision_doubtful() {
        let near = Decision::of(Some(0.9), Some(0.06), Some(-1.0), Some(1.0));
        assert!(near.doubtful && near.pass);
        assert!(!Decision::of(Some(0.9), Some(0.04), Some(-1.0), Some(1.0)).doubtful);
        assert_eq!(
            Decision::of(Some(1.5), None, None, Some(1.0)).bits(),
            0b01010
        );
    }
}
