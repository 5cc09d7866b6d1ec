//! What a study says of a station: fit, fit with conditions or not fit, and by which limits.

use super::distribution::{self, Tails};
use super::spread::defined;
use super::text::short;
use super::values::Reading;
use serde::Serialize;
use std::fmt::{self, Display, Formatter};

/// A verdict of a study, from the best to the worst.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize)]
pub enum Fitness {
    /// All figures are within their limits.
    #[default]
    #[serde(rename = "fit")]
    Fit,
    /// A figure is between the two limits that it has.
    #[serde(rename = "fit with conditions")]
    Conditions,
    /// A figure could not be formed, and no other one says that it is not fit.
    #[serde(rename = "not decided")]
    NotDecided,
    /// A figure is outside of its limit.
    #[serde(rename = "not fit")]
    NotFit,
}

impl Display for Fitness {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        self.serialize(f)
    }
}

/// A verdict and its reasons; by default before any figure was looked at.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Judgement {
    /// The worst that a figure says.
    pub verdict: Fitness,
    /// What each figure says, with its limit.
    pub reasons: Vec<String>,
}

impl Judgement {
    /// And by a figure that must be at least this.
    pub fn least(self, figure: &str, value: Option<f64>, limit: f64) -> Self {
        match value {
            Some(value) if value >= limit => {
                self.and(Fitness::Fit, format!("{figure} {} ≥ {limit}", short(value)))
            }
            Some(value) => self.and(
                Fitness::NotFit,
                format!("{figure} {} < {limit}", short(value)),
            ),
            None => self.and(Fitness::NotDecided, format!("{figure} is not defined")),
        }
    }

    /// And by a share in % that must be at most this, with conditions at most the second limit.
    pub fn most(self, figure: &str, share: Option<f64>, limit: f64, conditions: f64) -> Self {
        let Some(share) = share else {
            return self.and(Fitness::NotDecided, format!("{figure} is not defined"));
        };
        let words = format!("{figure} {} %", short(share));
        if share <= limit {
            self.and(Fitness::Fit, format!("{words} ≤ {limit} %"))
        } else if share <= conditions {
            self.and(
                Fitness::Conditions,
                format!("{words} > {limit} %, but ≤ {conditions} %"),
            )
        } else {
            self.and(Fitness::NotFit, format!("{words} > {conditions} %"))
        }
    }

    fn and(mut self, verdict: Fitness, reason: String) -> Self {
        self.verdict = self.verdict.max(verdict);
        self.reasons.push(reason);
        self
    }
}

/// What was predicted of each value beside how the values scatter.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Prediction {
    /// 1 σ: the root of the mean square.
    pub sigma: f64,
    /// U = 2 u, the same.
    pub u: Option<f64>,
    /// (s / σ)².
    pub f: f64,
    /// Of s.
    pub df: f64,
    /// Of so large a difference if σ is right.
    pub p: f64,
    /// Whether p is above 1 %.
    pub agrees: bool,
}

/// Probability below which σ and s disagree.
const DISAGREES: f64 = 0.01;

impl Prediction {
    /// Compares with s of `df` degrees of freedom, by an F test against a σ that is known; none where no σ was
    /// predicted. Where more than the measurement scatters, only a smaller s disagrees.
    pub fn compared(
        sigmas: &Squares,
        us: &Squares,
        s: Option<f64>,
        df: f64,
        more_scatters: bool,
    ) -> Option<Self> {
        let sigma = sigmas.root_mean()?;
        let f = defined(s? * s? / (sigma * sigma))?;
        let Tails { lower, upper } = distribution::chi_squared(f * df, df);
        let p = if more_scatters {
            lower
        } else {
            2.0 * lower.min(upper)
        };
        Some(Self {
            sigma,
            u: us.root_mean(),
            f,
            df,
            p,
            agrees: p > DISAGREES,
        })
    }

    /// The same with what was predicted of these values.
    pub fn of(readings: &[Reading], s: Option<f64>, df: f64) -> Option<Self> {
        let (mut sigmas, mut us) = (Squares::default(), Squares::default());
        for reading in readings {
            sigmas.add(reading.sigma);
            us.add(reading.uncertainty);
        }
        Self::compared(&sigmas, &us, s, df, false)
    }
}

/// Numbers of which the root of the mean square is wanted.
#[derive(Clone, Copy, Debug, Default)]
pub struct Squares {
    sum: f64,
    count: u64,
}

impl Squares {
    /// Adds a number that is known.
    pub fn add(&mut self, number: Option<f64>) {
        if let Some(number) = number {
            self.sum += number * number;
            self.count += 1;
        }
    }

    /// None of no number.
    pub fn root_mean(self) -> Option<f64> {
        defined((self.sum / self.count as f64).sqrt())
    }
}

/// The last lines of a report.
pub fn ended(
    f: &mut Formatter<'_>,
    prediction: Option<&Prediction>,
    s: &str,
    judgement: &Judgement,
) -> fmt::Result {
    if let Some(prediction) = prediction {
        writeln!(f, "  {}", compared(prediction, s))?;
    }
    writeln!(
        f,
        "  {}: {}",
        judgement.verdict,
        judgement.reasons.join("; ")
    )
}

/// A prediction beside the scatter that has this name.
pub fn compared(prediction: &Prediction, s: &str) -> String {
    let u = prediction
        .u
        .map_or(String::new(), |u| format!(", U {}", short(u)));
    let is = match (prediction.agrees, prediction.f > 1.0) {
        (true, _) => "agrees",
        (false, true) => "disagrees: the values scatter more",
        (false, false) => "disagrees: the values scatter less",
    };
    format!(
        "predicted σ {}{u}: {s} {is} (F {}, p {})",
        short(prediction.sigma),
        short(prediction.f),
        short(prediction.p)
    )
}
