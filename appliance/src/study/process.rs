//! What a process does over time: P_p, P_pk, C_p, C_pk, individuals and moving ranges, Shewhart's marks.
//!
//! ```text
//! P_p = (U − L)/6s      P_pk = min(U − x̄, x̄ − L)/3s      C_p and C_pk the same with σ = M̄R̄/1.128
//! C_p √(χ²_{α/2, ν}/ν) to C_p √(χ²_{1−α/2, ν}/ν)           C_pk ± 1.96 √(1/9n + C_pk²/2ν)          ν = n − 1
//! x̄ ± 3σ, ranges up to 3.267 M̄R̄
//! ```
//!
//! Sources: Montgomery, *Introduction to Statistical Quality Control*; Bissell 1990 for the interval of C_pk. GroupValues are in
//! the order of their results; where the limits change, a new group begins, and no figure mixes two groups.

use super::decimal::Decimal;
use super::distribution::{self, Tail};
use super::marks::{self, Mark};
use super::spread::{Spread, defined};
use super::text::{rounded, short, shown, titled};
use super::values::{Characteristic, LeftOut};
use super::verdict::{Prediction, Squares, compared};
use serde::Serialize;
use std::fmt::{self, Display, Formatter};

/// Mean moving range of two values over σ.
const RANGE_OF_TWO: f64 = 1.128;
/// Largest moving range over their mean.
const LARGEST_RANGE: f64 = 3.267;

/// The limits of a characteristic.
pub type LimitPair = (Option<Decimal>, Option<Decimal>);

/// The values of one characteristic as they come, divided where its limits change.
#[derive(Clone, Debug, Default)]
pub struct Course {
    /// What is measured.
    pub name: String,
    /// Its unit.
    pub unit: String,
    /// How many results were left out.
    pub left_out: LeftOut,
    groups: Vec<GroupValues>,
}

/// GroupValues that were judged by the same limits, as offsets from the first.
#[derive(Clone, Debug)]
struct GroupValues {
    bounds: LimitPair,
    first: Decimal,
    /// The first value, rounded to binary.
    binary: f64,
    offsets: Vec<f64>,
    at: Vec<u64>,
    sigmas: Squares,
    us: Squares,
}

/// A figure with its 95 % interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Capability {
    /// The figure.
    pub value: f64,
    /// Lower end.
    pub from: f64,
    /// Upper end.
    pub to: f64,
}

/// A process.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Process {
    /// What is measured.
    pub characteristic: String,
    /// Its unit.
    pub unit: String,
    /// How many results were left out.
    pub left_out: LeftOut,
    /// GroupValues by the limits that they were judged by, in the order of time.
    pub groups: Vec<ProcessGroup>,
}

/// GroupValues that were judged by the same limits. What cannot be formed is none.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ProcessGroup {
    /// Lower limit.
    pub low: Option<f64>,
    /// Upper limit.
    pub high: Option<f64>,
    /// SEQ of the first value, or its line.
    pub first: u64,
    /// The same of the last.
    pub last: u64,
    /// How many values.
    pub n: usize,
    /// x̄.
    pub mean: f64,
    /// Standard deviation of all.
    pub s: Option<f64>,
    /// Mean moving range.
    pub mean_range: Option<f64>,
    /// σ by the moving range.
    pub sigma: Option<f64>,
    /// P_p.
    pub pp: Option<Capability>,
    /// P_pk.
    pub ppk: Option<Capability>,
    /// C_p.
    pub cp: Option<Capability>,
    /// C_pk.
    pub cpk: Option<Capability>,
    /// Control limits of the values.
    pub control: Option<[f64; 2]>,
    /// Control limit of the moving ranges.
    pub largest_range: Option<f64>,
    /// What was predicted of the measurement; s is that of the process.
    pub prediction: Option<Prediction>,
    /// GroupValues that stand out.
    pub marks: Vec<Mark>,
    /// The values.
    pub individuals: Vec<f64>,
    /// Each but the first against the one before.
    pub moving_ranges: Vec<f64>,
}

impl Course {
    /// Without values so far.
    pub fn new(name: &str, unit: &str, left_out: LeftOut) -> Self {
        let (name, unit) = (name.to_owned(), unit.to_owned());
        Self {
            name,
            unit,
            left_out,
            groups: Vec::new(),
        }
    }

    /// Of the values of a file; `bounds` take the place of its limits, if any is given.
    pub fn of(measured: &Characteristic, bounds: LimitPair) -> Self {
        let mut course = Self::new(&measured.name, &measured.unit, measured.left_out);
        let given = bounds.0.or(bounds.1).map(|_| bounds);
        for reading in &measured.readings {
            let bounds = given.unwrap_or((reading.low, reading.high));
            course.add(
                reading.at,
                reading.value,
                bounds,
                reading.sigma,
                reading.uncertainty,
            );
        }
        course
    }

    /// Adds the next value.
    pub fn add(
        &mut self,
        at: u64,
        value: Decimal,
        bounds: LimitPair,
        sigma: Option<f64>,
        u: Option<f64>,
    ) {
        let group = self.group(bounds, || Some(value));
        let offset = value.minus(group.first);
        group.add(at, offset, sigma, u);
    }

    /// Adds the next value, which was binary from its beginning; left out if it is not finite.
    pub fn add_number(
        &mut self,
        at: u64,
        value: f64,
        bounds: LimitPair,
        sigma: Option<f64>,
        u: Option<f64>,
    ) {
        let group = self.group(bounds, || Decimal::of(value));
        let offset = value - group.binary;
        if offset.is_finite() {
            group.add(at, offset, sigma, u);
        }
    }

    /// The group that a value of these limits belongs to.
    fn group(
        &mut self,
        bounds: LimitPair,
        first: impl FnOnce() -> Option<Decimal>,
    ) -> &mut GroupValues {
        if self
            .groups
            .last()
            .is_none_or(|group| group.bounds != bounds)
        {
            self.groups
                .push(GroupValues::new(bounds, first().unwrap_or_default()));
        }
        let last = self.groups.len() - 1;
        &mut self.groups[last]
    }

    /// The figures, with the marks of these tests.
    pub fn figures(&self, tests: &[u8]) -> Process {
        Process {
            characteristic: self.name.clone(),
            unit: self.unit.clone(),
            left_out: self.left_out,
            groups: self
                .groups
                .iter()
                .map(|group| group.figures(tests))
                .collect(),
        }
    }
}

impl GroupValues {
    fn new(bounds: LimitPair, first: Decimal) -> Self {
        let (offsets, at) = (Vec::new(), Vec::new());
        Self {
            bounds,
            first,
            binary: first.to_f64(),
            offsets,
            at,
            sigmas: Squares::default(),
            us: Squares::default(),
        }
    }

    fn add(&mut self, at: u64, offset: f64, sigma: Option<f64>, u: Option<f64>) {
        self.offsets.push(offset);
        self.at.push(at);
        self.sigmas.add(sigma);
        self.us.add(u);
    }

    fn figures(&self, tests: &[u8]) -> ProcessGroup {
        let spread = Spread::of(&self.offsets);
        let (n, df, s) = (spread.n, spread.df(), spread.s());
        let ranges: Vec<f64> = self
            .offsets
            .windows(2)
            .map(|pair| (pair[1] - pair[0]).abs())
            .collect();
        let mean_range = Some(Spread::of(&ranges).mean).filter(|_| !ranges.is_empty());
        let sigma = mean_range.map(|range| range / RANGE_OF_TWO);
        let (low, high) = self.bounds;
        let below = low.map(|low| self.first.minus(low) + spread.mean);
        let above = high.map(|high| high.minus(self.first) - spread.mean);
        let nearest = match (below, above) {
            (Some(below), Some(above)) => Some(below.min(above)),
            (one, other) => one.or(other),
        };
        let width = low.zip(high).map(|(low, high)| high.minus(low));
        let over = |distance: Option<f64>, sigma: Option<f64>| defined(distance? / sigma?);
        let root = |tail| (distribution::chi_squared_quantile(tail, df) / df).sqrt();
        let both = |sigma| {
            over(width, sigma)
                .map(|six| six / 6.0)
                .map(|value| Capability {
                    value,
                    from: value * root(Tail::Lower(0.025)),
                    to: value * root(Tail::Upper(0.025)),
                })
        };
        let one = |sigma| {
            over(nearest, sigma).map(|three| three / 3.0).map(|value| {
                let half = 1.96 * (1.0 / (9.0 * n as f64) + value * value / (2.0 * df)).sqrt();
                Capability {
                    value,
                    from: value - half,
                    to: value + half,
                }
            })
        };
        let first = self.first.to_f64();
        let value = |offset: &f64| first + offset;
        let mean = value(&spread.mean);
        let scattering = sigma.filter(|sigma| *sigma > 0.0);
        ProcessGroup {
            low: low.map(Decimal::to_f64),
            high: high.map(Decimal::to_f64),
            first: self.at.first().copied().unwrap_or(0),
            last: self.at.last().copied().unwrap_or(0),
            n,
            mean,
            s,
            mean_range,
            sigma,
            pp: both(s),
            ppk: one(s),
            cp: both(sigma),
            cpk: one(sigma),
            control: sigma.map(|sigma| [mean - 3.0 * sigma, mean + 3.0 * sigma]),
            largest_range: mean_range.map(|range| LARGEST_RANGE * range),
            prediction: Prediction::compared(&self.sigmas, &self.us, s, df, true),
            marks: scattering.map_or(Vec::new(), |sigma| {
                let distances: Vec<f64> = self
                    .offsets
                    .iter()
                    .map(|x| (x - spread.mean) / sigma)
                    .collect();
                let found = marks::of(&distances, tests).into_iter();
                let mark = |(position, test): (usize, u8)| Mark {
                    test,
                    position: position + 1,
                    at: self.at[position],
                    value: value(&self.offsets[position]),
                };
                found.map(mark).collect()
            }),
            individuals: self.offsets.iter().map(value).collect(),
            moving_ranges: ranges,
        }
    }
}

/// Marks that are printed; the rest is counted.
const MOST_PRINTED: usize = 20;

impl Display for Process {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let LeftOut {
            invalid,
            not_measured,
            of_studies,
        } = self.left_out;
        writeln!(
            f,
            "{}: process; left out: {invalid} INVALID, {not_measured} not measured, {of_studies} of studies",
            titled(&self.characteristic, &self.unit)
        )?;
        for group in &self.groups {
            let bound =
                |limit: Option<f64>| limit.map_or("none".into(), |limit| rounded(limit, 10));
            writeln!(
                f,
                "  {} to {}: {} values, limits {} and {}",
                group.first,
                group.last,
                group.n,
                bound(group.low),
                bound(group.high)
            )?;
            writeln!(
                f,
                "    mean {}  s {}  σ by moving ranges {}",
                rounded(group.mean, 10),
                shown(group.s),
                shown(group.sigma)
            )?;
            for (name, figure) in [
                ("P_p", group.pp),
                ("P_pk", group.ppk),
                ("C_p", group.cp),
                ("C_pk", group.cpk),
            ] {
                match figure {
                    Some(Capability { value, from, to }) => writeln!(
                        f,
                        "    {name:<5} {:>8}   95 % {} to {}",
                        short(value),
                        short(from),
                        short(to)
                    )?,
                    None => writeln!(f, "    {name:<5} not defined")?,
                }
            }
            let [low, high] = group.control.map_or([None; 2], |bounds| bounds.map(Some));
            writeln!(
                f,
                "    control limits {} to {}, moving ranges up to {}",
                shown(low),
                shown(high),
                shown(group.largest_range)
            )?;
            if let Some(prediction) = &group.prediction {
                writeln!(f, "    {}", compared(prediction, "s of the process"))?;
            }
            for mark in group.marks.iter().take(MOST_PRINTED) {
                writeln!(
                    f,
                    "    {}: {} {}",
                    mark.at,
                    short(mark.value),
                    marks::words(mark.test)
                )?;
            }
            if group.marks.len() > MOST_PRINTED {
                writeln!(
                    f,
                    "    and {} marks more; --json has all",
                    group.marks.len() - MOST_PRINTED
                )?;
            }
        }
        Ok(())
    }
}
