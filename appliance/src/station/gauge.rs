//! One gauge of a result: its value, unit and limits, and the decision.

use std::sync::Arc;

pub use algo::inspect::Unit;
use serde::{Deserialize, Serialize};

/// Bits of a [`Decision`].
pub mod decision {
    bits! {
        /// See [`Decision::pass`](super::Decision::pass).
        PASS = 0;
        /// See [`Decision::valid`](super::Decision::valid).
        VALID = 1;
        /// See [`Decision::low`](super::Decision::low).
        LOW = 2;
        /// See [`Decision::high`](super::Decision::high).
        HIGH = 3;
        /// See [`Decision::doubtful`](super::Decision::doubtful).
        DOUBTFUL = 4;
        /// See [`Decision::absent`](super::Decision::absent).
        ABSENT = 5;
    }
}

/// What was decided about one gauge: bits 0–5 of registers 296–311 and 1116–1179.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct Decision {
    /// Measured and within its limits, farther from them than the guard band.
    pub pass: bool,
    /// Measured.
    pub valid: bool,
    /// Below its lower limit.
    pub low: bool,
    /// Above its upper limit.
    pub high: bool,
    /// A limit lies within 2 σ of the value, or the value lies within the guard band.
    pub doubtful: bool,
    /// What it measures is not there, a hole that is closed for example: the part is bad.
    pub absent: bool,
}

/// The limits of a gauge, inclusive.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct GaugeLimits {
    /// The lower limit.
    pub low: Option<f64>,
    /// The upper limit.
    pub high: Option<f64>,
    /// The guard band inside each limit is this many times u wide (ISO 14253-1:2017); 0 is none.
    pub guard_k: f64,
}

impl From<(Option<f64>, Option<f64>)> for GaugeLimits {
    fn from((low, high): (Option<f64>, Option<f64>)) -> Self {
        Self {
            low,
            high,
            guard_k: 0.0,
        }
    }
}

impl Decision {
    /// The bits of registers 296–311 and 1116–1179.
    pub fn bits(self) -> u16 {
        let all = [
            (decision::PASS, self.pass),
            (decision::VALID, self.valid),
            (decision::LOW, self.low),
            (decision::HIGH, self.high),
            (decision::DOUBTFUL, self.doubtful),
            (decision::ABSENT, self.absent),
        ];
        let set = all.iter().filter(|(_, set)| *set);
        set.fold(0, |bits, (bit, _)| bits | bit)
    }

    /// The decision with these bits.
    pub fn from_bits(bits: u16) -> Self {
        let has = |bit: u16| bits & bit != 0;
        Self {
            pass: has(decision::PASS),
            valid: has(decision::VALID),
            low: has(decision::LOW),
            high: has(decision::HIGH),
            doubtful: has(decision::DOUBTFUL),
            absent: has(decision::ABSENT),
        }
    }

    /// The decision for a value. Without a finite value it is not valid, and no other bit is set
    /// but `absent`. A value within its limits, but inside the guard band of one, proves neither
    /// that the part conforms nor that it does not: it is doubtful and no pass.
    pub fn of(measured: &Measured, limits: &GaugeLimits) -> Self {
        let Some(value) = measured.value.filter(|value| value.is_finite()) else {
            return Self {
                absent: measured.absent,
                ..Self::default()
            };
        };
        let GaugeLimits { low, high, guard_k } = *limits;
        let below = low.is_some_and(|limit| value < limit);
        let above = high.is_some_and(|limit| value > limit);
        let nearer = |to: Option<f64>, reach: Option<f64>| {
            to.zip(reach)
                .is_some_and(|(limit, reach)| (value - limit).abs() < reach)
        };
        let near = |reach| nearer(low, reach) || nearer(high, reach);
        let within = !below && !above;
        let guarded = within && near(measured.uncertainty().map(|u| guard_k * u));
        Self {
            pass: within && !guarded,
            valid: true,
            low: below,
            high: above,
            doubtful: guarded || near(measured.sigma.map(|sigma| 2.0 * sigma)),
            absent: false,
        }
    }

    /// Whether the value was measured, lies within its limits and is no pass, because it lies in
    /// the guard band.
    pub fn guarded(self) -> bool {
        self.valid && !self.pass && !self.failed()
    }

    /// Whether it proves that the part is bad: outside a limit, or absent.
    pub fn failed(self) -> bool {
        self.low || self.high || self.absent
    }

    /// Whether it says nothing about the part: neither measured nor absent.
    pub fn unseen(self) -> bool {
        !self.valid && !self.absent
    }
}

/// k of the expanded uncertainty U = k u that is shown: about 95 % of normal errors (JCGM 100:2008,
/// 6.2).
pub const COVERAGE_FACTOR: f64 = 2.0;

/// What was found for a gauge, in its unit.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Measured {
    /// `None` if it could not be measured, or is absent.
    pub value: Option<f64>,
    /// One standard deviation of the value; `None` where it is not predicted.
    pub sigma: Option<f64>,
    /// The part of the error that is the same in every measurement, 1 σ.
    pub systematic: f64,
    /// The magnitude that is expected on a good part, of a value that noise moves away from 0.
    pub expected: Option<f64>,
    /// Where the value is, of a deviation.
    pub square: Option<Square>,
    /// Whether what it measures is not there; then there is no value.
    pub absent: bool,
    /// Why there is no value, in words.
    pub reason: Option<Arc<str>>,
}

/// A square of camera pixels of the measured frame.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Square {
    /// The column of its middle.
    pub column: u32,
    /// The row of its middle.
    pub row: u32,
    /// Pixels along each side.
    pub side: u32,
}

impl From<algo::inspect::Square> for Square {
    fn from(square: algo::inspect::Square) -> Self {
        let [column, row, side] = [square.column, square.row, square.side].map(|px| px as u32);
        Self { column, row, side }
    }
}

impl Measured {
    /// A value with its σ.
    pub fn new(value: Option<f64>, sigma: Option<f64>) -> Self {
        Self {
            value,
            sigma,
            ..Self::default()
        }
    }

    /// u = √(σ² + systematic²).
    pub fn uncertainty(&self) -> Option<f64> {
        self.sigma.map(|sigma| sigma.hypot(self.systematic))
    }
}

/// One gauge of a result, as the page has it in JSON. Values in mm, °, mm³ or as a share 0…1.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GaugeValue {
    /// The place of the gauge in the registers, 1 to [`MAX_GAUGES`](super::MAX_GAUGES).
    pub slot: u16,
    /// The gauge's name in the recipe.
    pub name: Arc<str>,
    /// What the value is.
    #[serde(rename = "kind")]
    pub unit: Unit,
    /// `None` if it could not be measured, or is absent.
    pub value: Option<f64>,
    /// Why there is no value, in words; `None` where there is one.
    pub reason: Option<Arc<str>>,
    /// One standard deviation of the value; `None` where it is not predicted.
    pub sigma: Option<f64>,
    /// U = [`COVERAGE_FACTOR`] · u, u with the systematic part of the error; `None` where σ is not
    /// predicted.
    pub uncertainty: Option<f64>,
    /// The magnitude that is expected on a good part; `None` where it is that of the part.
    pub expected: Option<f64>,
    /// Where the value is; `None` where it is that of the whole region.
    pub square: Option<Square>,
    /// The lower limit.
    #[serde(rename = "lowest")]
    pub low: Option<f64>,
    /// The upper limit.
    #[serde(rename = "highest")]
    pub high: Option<f64>,
    /// What was decided.
    #[serde(flatten)]
    pub decision: Decision,
}

impl GaugeValue {
    /// A gauge with the decision that follows from its value and limits. A σ of 0 says that nothing
    /// is known of it: a share without pixels near the threshold would have none.
    pub fn judged(
        slot: u16,
        name: impl Into<Arc<str>>,
        unit: Unit,
        measured: Measured,
        limits: impl Into<GaugeLimits>,
    ) -> Self {
        let limits = limits.into();
        let measured = Measured {
            value: measured.value.filter(|_| !measured.absent),
            sigma: measured.sigma.filter(|sigma| *sigma > 0.0),
            ..measured
        };
        Self {
            slot,
            name: name.into(),
            unit,
            uncertainty: measured.uncertainty().map(|u| COVERAGE_FACTOR * u),
            low: limits.low,
            high: limits.high,
            decision: Decision::of(&measured, &limits),
            value: measured.value,
            reason: measured.reason.filter(|_| measured.value.is_none()),
            sigma: measured.sigma,
            expected: measured.expected,
            square: measured.square,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sigma_of_zero_is_not_known_and_neither_is_the_uncertainty() {
        let of = |sigma| {
            let measured = Measured {
                systematic: 0.01,
                ..Measured::new(Some(1.0), Some(sigma))
            };
            GaugeValue::judged(1, "coverage", Unit::Share, measured, (Some(0.9), None))
        };
        let (unknown, known) = (of(0.0), of(0.001));
        assert_eq!((unknown.sigma, unknown.uncertainty), (None, None));
        assert!(unknown.decision.pass && unknown.value == Some(1.0));
        assert!(known.sigma == Some(0.001) && known.uncertainty.is_some());
    }

    #[test]
    fn what_is_absent_has_no_value_and_no_bit_but_its_own() {
        let measured = |absent| Measured {
            absent,
            reason: Some("closed".into()),
            ..Measured::new(Some(0.5), Some(0.01))
        };
        let of = |absent| {
            GaugeValue::judged(3, "hole", Unit::Length, measured(absent), (None, Some(1.0)))
        };
        let (absent, there) = (of(true), of(false));
        assert_eq!((absent.slot, absent.value), (3, None));
        assert_eq!(
            (absent.decision.bits(), there.decision.bits()),
            (0b10_0000, 0b11)
        );
        assert_eq!(
            (absent.reason.as_deref(), there.reason),
            (Some("closed"), None)
        );
        assert!(absent.decision.failed() && !absent.decision.unseen());
        assert!(Decision::default().unseen() && !Decision::default().failed());
    }

    #[test]
    fn a_limit_within_two_sigma_makes_a_decision_doubtful() {
        let limits = GaugeLimits::from((Some(-1.0), Some(1.0)));
        let of = |value, sigma| Decision::of(&Measured::new(Some(value), sigma), &limits);
        let near = of(0.9, Some(0.06));
        assert!(near.doubtful && near.pass);
        assert!(!of(0.9, Some(0.04)).doubtful);
        assert_eq!(of(1.5, None).bits(), 0b01010);
    }

    #[test]
    fn a_value_in_the_guard_band_is_doubtful_and_neither_pass_nor_outside() {
        let limits = GaugeLimits {
            low: Some(-1.0),
            high: Some(1.0),
            guard_k: 2.0,
        };
        // u = 0.05.
        let of = |value| {
            let measured = Measured {
                systematic: 0.04,
                ..Measured::new(Some(value), Some(0.03))
            };
            Decision::of(&measured, &limits)
        };
        assert_eq!(of(0.89).bits(), 0b00011);
        assert_eq!(of(0.91).bits(), 0b10010);
        assert_eq!(of(-0.91).bits(), 0b10010);
        assert!(of(0.91).guarded() && !of(0.89).guarded());
        // Outside it is a fail, however near.
        assert_eq!(of(1.01).bits(), 0b11010);
        assert!(!of(1.01).guarded() && !Decision::default().guarded());
    }
}
