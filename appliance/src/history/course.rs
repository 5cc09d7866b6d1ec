//! The values of gauges over time, for figures of a process.

use super::HistoryResult;
use super::entry::Filter;
use super::reader::{Reader, condition};
use crate::station::Verdict;
use crate::station::gauge::decision;
use crate::study::group::LimitPair;
use crate::study::{Course, Decimal, LeftOut};
use rusqlite::{Connection, params_from_iter};
use std::collections::HashSet;
use std::time::{Duration, Instant};

/// A value of a gauge, or that there is none, as it was stored.
pub(super) struct ValueRow<'a> {
    /// The result's.
    pub seq: u32,
    /// Where it is on the axis that was asked for.
    pub x: Option<i64>,
    pub verdict: Verdict,
    /// The gauge's slot less one.
    pub place: i64,
    pub name: &'a str,
    pub unit: &'a str,
    /// Where it was measured.
    pub value: Option<f64>,
    pub sigma: Option<f64>,
    pub uncertainty: Option<f64>,
    /// The limits by which it was judged.
    pub limits: (Option<f64>, Option<f64>),
}

/// Hands each value of the results that pass the filter, but for its limit, to `take`, oldest first, until that says
/// that it is enough. `x` is an expression of columns of results.
pub(super) fn each_value(
    connection: &Connection,
    (filter, slot, x): (&Filter, Option<u16>, &str),
    rest: Rest,
    mut take: impl FnMut(ValueRow<'_>) -> bool,
) -> rusqlite::Result<()> {
    let (condition, mut values) = condition(filter);
    let of_slot = if slot.is_some() { "AND place = ?" } else { "" };
    values.extend(slot.map(|slot| (i64::from(slot) - 1).into()));
    let query = format!(
        "SELECT seq, {x}, verdict, place, name, unit, value, decision, sigma, uncertainty, low, high
         FROM dated CROSS JOIN gauge ON gauge.result = dated.id WHERE {condition} {of_slot} ORDER BY dated.id, place"
    );
    let mut statement = connection.prepare(&query)?;
    let mut rows = statement.query(params_from_iter(values))?;
    let mut rests = Rests::of(rest);
    while let Some(row) = rows.next()? {
        rests.step();
        let is_valid = row.get::<_, u16>(7)? & decision::VALID != 0;
        let going_on = take(ValueRow {
            seq: row.get(0)?,
            x: row.get(1)?,
            verdict: row.get(2)?,
            place: row.get(3)?,
            name: row.get_ref(4)?.as_str()?,
            unit: row.get_ref(5)?.as_str()?,
            value: row.get::<_, Option<f64>>(6)?.filter(|_| is_valid),
            sigma: row.get(8)?,
            uncertainty: row.get(9)?,
            limits: (row.get(10)?, row.get(11)?),
        });
        if !going_on {
            break;
        }
    }
    Ok(())
}

impl Reader {
    /// The values of each gauge of the results that pass the filter, but for its limit, oldest first; of INVALID results,
    /// and of those of studies (`of_studies`, by SEQ), only how many there are. `bounds` take the place of the limits by
    /// which results were judged, if any is given.
    ///
    /// # Errors
    /// As [`Self::results`].
    pub fn courses(
        &self,
        filter: &Filter,
        slot: Option<u16>,
        bounds: LimitPair,
        of_studies: &HashSet<u32>,
        rest: Rest,
    ) -> HistoryResult<Vec<Course>> {
        let (condition, values) = condition(filter);
        let given = bounds.0.or(bounds.1).map(|_| bounds);
        let of_invalid = format!(
            "SELECT count(*) FROM dated WHERE {condition} AND verdict = {}",
            Verdict::Invalid.number()
        );
        self.read(|connection| {
            // Counts and values are of one state of the history.
            let connection = connection.unchecked_transaction()?;
            let invalid =
                connection.query_row(&of_invalid, params_from_iter(values), |row| row.get(0))?;
            let mut courses: Vec<(i64, Course, Limited)> = Vec::new();
            each_value(&connection, (filter, slot, "NULL"), rest, |row| {
                let known = courses.iter().position(|(at, course, _)| {
                    *at == row.place && course.name == row.name && course.unit == row.unit
                });
                let at = known.unwrap_or_else(|| {
                    let left_out = LeftOut {
                        invalid,
                        ..LeftOut::default()
                    };
                    let course = Course::new(row.name, row.unit, left_out);
                    courses.push((row.place, course, Limited::default()));
                    courses.len() - 1
                });
                let (_, course, limited) = &mut courses[at];
                match row.value {
                    _ if row.verdict == Verdict::Invalid => {}
                    _ if of_studies.contains(&row.seq) => course.left_out.of_studies += 1,
                    None => course.left_out.not_measured += 1,
                    Some(value) => {
                        let bounds = given.unwrap_or_else(|| limited.of(row.limits));
                        course.add_number(
                            row.seq.into(),
                            value,
                            bounds,
                            row.sigma,
                            row.uncertainty,
                        );
                    }
                }
                true
            })?;
            Ok(courses.into_iter().map(|(_, course, _)| course).collect())
        })
    }
}

/// How many times as long as it works the reader rests, while a station measures on the same processor: a core that
/// works takes memory and clock from the others. 0 where no station uses the history.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rest(pub u32);

/// Rows between two rests.
const SLICE: u32 = 4096;
/// The longest rest.
const LONGEST: Duration = Duration::from_millis(20);

/// When to rest.
pub(super) struct Rests {
    rest: Rest,
    read: u32,
    begun: Instant,
}

impl Rests {
    pub(super) fn of(rest: Rest) -> Self {
        Self {
            rest,
            read: 0,
            begun: Instant::now(),
        }
    }

    /// After each row.
    pub(super) fn step(&mut self) {
        self.read += 1;
        if self.rest.0 > 0 && self.read.is_multiple_of(SLICE) {
            std::thread::sleep((self.rest.0 * self.begun.elapsed()).min(LONGEST));
            self.begun = Instant::now();
        }
    }
}

/// The limits of the row before, which most rows share.
#[derive(Default)]
pub(super) struct Limited {
    read: (Option<f64>, Option<f64>),
    bounds: LimitPair,
}

impl Limited {
    pub(super) fn of(&mut self, (low, high): (Option<f64>, Option<f64>)) -> LimitPair {
        if self.read != (low, high) {
            self.read = (low, high);
            self.bounds = (low.and_then(Decimal::of), high.and_then(Decimal::of));
        }
        self.bounds
    }
}
