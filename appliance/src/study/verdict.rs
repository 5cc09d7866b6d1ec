//! What a study says of a station: fit, fit with conditions or not fit, and by which limits.

use super::distribution::{self, Tails};
use super::spread::defined;
use serde::Serialize;
use std::fmt::{self, Display, Formatter};

/// A verdict of a study, from the best to the worst.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
pub enum Fitness {
    /// All figures are within their limits.
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

/// A verdict and its reasons.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Judgement {
    /// The worst that a figure says.
    pub verdict: Fitness,
    /// What each figure says, with its limit.
    pub reasons: Vec<String>,
}

/// A figure with the limits that it goes by.
pub struct Criterion {
    /// Its name.
    pub figure: &'static str,
    /// None if it is not defined.
    pub value: Option<f64>,
    /// `%` or empty.
    pub unit: &'static str,
    /// Whether larger is better.
    pub is_least: bool,
    /// Up to here it is fit.
    pub limit: f64,
    /// Up to here it is fit with conditions.
    pub conditions: f64,
}

impl Criterion {
    fn judged(&self) -> (Fitness, String) {
        let Self {
            figure,
            unit,
            limit,
            conditions,
            ..
        } = self;
        let Some(value) = self.value else {
            return (Fitness::NotDecided, format!("{figure} is not defined"));
        };
        let within = |limit: f64| {
            if self.is_least {
                value >= limit
            } else {
                value <= limit
            }
        };
        let (good, bad) = if self.is_least {
            ("≥", "<")
        } else {
            ("≤", ">")
        };
        let shown = short(value);
        if within(*limit) {
            (
                Fitness::Fit,
                format!("{figure} {shown}{unit} {good} {limit}{unit}"),
            )
        } else if within(*conditions) {
            let words = format!(
                "{figure} {shown}{unit} {bad} {limit}{unit}, but {good} {conditions}{unit}"
            );
            (Fitness::Conditions, words)
        } else {
            (
                Fitness::NotFit,
                format!("{figure} {shown}{unit} {bad} {conditions}{unit}"),
            )
        }
    }
}

impl Judgement {
    /// By these figures.
    pub fn by(criteria: &[Criterion]) -> Self {
        let (words, reasons): (Vec<Fitness>, _) = criteria.iter().map(Criterion::judged).unzip();
        Self {
            verdict: words.into_iter().max().unwrap_or(Fitness::NotDecided),
            reasons,
        }
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

    /// In words.
    pub fn words(&self, s: &str) -> String {
        let u = self
            .u
            .map_or(String::new(), |u| format!(", U {}", short(u)));
        let is = match (self.agrees, self.f > 1.0) {
            (true, _) => "agrees",
            (false, true) => "disagrees: the values scatter more",
            (false, false) => "disagrees: the values scatter less",
        };
        format!(
            "predicted σ {}{u}: {s} {is} (F {}, p {})",
            short(self.sigma),
            short(self.f),
            short(self.p)
        )
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

/// A number with five digits, as people read it.
pub fn short(number: f64) -> String {
    rounded(number, 5)
}

/// A number with so many digits.
pub fn rounded(number: f64, digits: u8) -> String {
    let size = number.abs();
    if number != 0.0 && !(1e-4..1e7).contains(&size) {
        return format!("{number:.3e}");
    }
    let before = if number == 0.0 {
        0
    } else {
        size.log10().floor() as i32
    };
    let places = usize::try_from(i32::from(digits) - 1 - before).unwrap_or(0);
    let text = format!("{number:.places$}");
    match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
        false => text,
    }
}

/// The same of a figure that may not be defined.
pub fn shown(figure: Option<f64>) -> String {
    figure.map_or_else(|| "not defined".into(), short)
}
