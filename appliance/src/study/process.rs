//! What a process does over time, value by value: figures of each group ([`super::group`]), and Shewhart's marks.
//!
//! Values are in the order of their results; where the limits change, a new group begins, and no figure mixes two groups.

use super::decimal::Decimal;
use super::group::{Capability, LimitPair, ProcessGroup, RunningGroup};
use super::marks::{self, Mark};
use super::text::{rounded, short, shown, titled};
use super::values::{Characteristic, LeftOut};
use super::verdict::compared;
use serde::Serialize;
use std::fmt::{self, Display, Formatter};

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

/// A group with its values, as offsets from the first.
#[derive(Clone, Debug)]
struct GroupValues {
    sums: RunningGroup,
    offsets: Vec<f64>,
    at: Vec<u64>,
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
    /// Values by the limits that they were judged by, in the order of time.
    pub groups: Vec<ProcessGroup>,
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
        let offset = value.minus(group.sums.first());
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
        if let Some(offset) = group.sums.offset(value) {
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
            .is_none_or(|group| group.sums.bounds() != bounds)
        {
            self.groups.push(GroupValues {
                sums: RunningGroup::new(bounds, first().unwrap_or_default()),
                offsets: Vec::new(),
                at: Vec::new(),
            });
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
    fn add(&mut self, at: u64, offset: f64, sigma: Option<f64>, u: Option<f64>) {
        self.sums.add(at, offset, sigma, u);
        self.offsets.push(offset);
        self.at.push(at);
    }

    fn figures(&self, tests: &[u8]) -> ProcessGroup {
        let distances: Option<Vec<f64>> = self
            .offsets
            .iter()
            .map(|offset| self.sums.distance(*offset))
            .collect();
        let found = marks::of(&distances.unwrap_or_default(), tests).into_iter();
        let mark = |(position, test): (usize, u8)| Mark {
            test,
            position: position + 1,
            at: self.at[position],
            value: self.sums.value(self.offsets[position]),
        };
        let values = self.offsets.iter().map(|offset| self.sums.value(*offset));
        let ranges = self.offsets.windows(2);
        ProcessGroup {
            marks: Some(found.map(mark).collect()),
            individuals: Some(values.collect()),
            moving_ranges: Some(ranges.map(|pair| (pair[1] - pair[0]).abs()).collect()),
            ..self.sums.figures()
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
            let marks = group.marks.as_deref().unwrap_or_default();
            for mark in marks.iter().take(MOST_PRINTED) {
                writeln!(
                    f,
                    "    {}: {} {}",
                    mark.at,
                    short(mark.value),
                    marks::words(mark.test)
                )?;
            }
            if marks.len() > MOST_PRINTED {
                writeln!(
                    f,
                    "    and {} marks more; --json has all",
                    marks.len() - MOST_PRINTED
                )?;
            }
        }
        Ok(())
    }
}
