//! One gauge of a result: its value, unit and limits, and the decision.

use std::sync::Arc;

use serde::Serialize;

/// What a gauge's value is: registers 554–569.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
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
        self as u16
    }

    /// Register steps per mm, °, mm³ or 1.
    pub fn steps(self) -> f64 {
        match self {
            Self::Volume => 100.0,
            Self::None | Self::Length | Self::Angle | Self::Share => 10_000.0,
        }
    }

    /// The smallest and the largest limit: a share is 0 to 1, an angle a half turn either way; anything else is what a
    /// register holds, ±(2³¹ − 1) of its steps.
    pub fn range(self) -> [f64; 2] {
        let most = match self {
            Self::Share => return [0.0, 1.0],
            Self::Angle => 180.0,
            Self::None | Self::Length | Self::Volume => f64::from(i32::MAX) / self.steps(),
        };
        [-most, most]
    }

    /// The unit's symbol.
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

    /// The decision for a value with its σ and its limits (inclusive). Without a finite value it is not valid, and no other bit
    /// is set.
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

/// k of the expanded uncertainty U = k u that is shown: about 95 % of normal errors (JCGM 100:2008, 6.2).
pub const COVERAGE_FACTOR: f64 = 2.0;

/// What was found for a gauge, in its unit.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Measured {
    /// `None` if it could not be measured.
    pub value: Option<f64>,
    /// One standard deviation of the value; `None` where it is not predicted.
    pub sigma: Option<f64>,
    /// The part of the error that is the same in every measurement, 1 σ.
    pub systematic: f64,
    /// The magnitude that is expected on a good part, of a value that noise moves away from 0.
    pub expected: Option<f64>,
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

/// One gauge of a result. Values in mm, °, mm³ or as a share 0…1.
#[derive(Debug, Clone, PartialEq)]
pub struct GaugeValue {
    /// The gauge's name in the recipe.
    pub name: Arc<str>,
    /// What the value is.
    pub unit: Unit,
    /// `None` if it could not be measured.
    pub value: Option<f64>,
    /// One standard deviation of the value; `None` where it is not predicted.
    pub sigma: Option<f64>,
    /// U = [`COVERAGE_FACTOR`] · u, u with the systematic part of the error; `None` where σ is not predicted.
    pub uncertainty: Option<f64>,
    /// The magnitude that is expected on a good part; `None` where it is that of the part.
    pub expected: Option<f64>,
    /// The lower limit.
    pub low: Option<f64>,
    /// The upper limit.
    pub high: Option<f64>,
    /// What was decided.
    pub decision: Decision,
}

impl GaugeValue {
    /// A gauge with the decision that follows from its value and limits.
    pub fn judged(
        name: impl Into<Arc<str>>,
        unit: Unit,
        measured: Measured,
        (low, high): (Option<f64>, Option<f64>),
    ) -> Self {
        let Measured {
            value,
            sigma,
            expected,
            ..
        } = measured;
        Self {
            name: name.into(),
            unit,
            value,
            sigma,
            uncertainty: measured.uncertainty().map(|u| COVERAGE_FACTOR * u),
            expected,
            low,
            high,
            decision: Decision::of(value, sigma, low, high),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
