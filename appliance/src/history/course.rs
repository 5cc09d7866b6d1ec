//! The values of gauges over time, for figures of a process.

use super::HistoryResult;
use super::entry::Filter;
use super::reader::{Reader, condition};
use crate::station::Verdict;
use crate::station::gauge::decision;
use crate::study::process::LimitPair;
use crate::study::{Course, Decimal, LeftOut};
use rusqlite::params_from_iter;
use std::collections::HashSet;
use std::time::{Duration, Instant};

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
        let (condition, mut values) = condition(filter);
        let of_slot = if slot.is_some() { "AND place = ?" } else { "" };
        values.extend(slot.map(|slot| (i64::from(slot) - 1).into()));
        let query = format!(
            "SELECT seq, verdict, place, name, unit, value, decision, sigma, uncertainty, low, high
             FROM dated CROSS JOIN gauge ON gauge.result = dated.id WHERE {condition} {of_slot} ORDER BY dated.id, place"
        );
        let given = bounds.0.or(bounds.1).map(|_| bounds);
        let of_invalid = format!(
            "SELECT count(*) FROM dated WHERE {condition} AND verdict = {}",
            Verdict::Invalid.number()
        );
        self.read(|connection| {
            // Counts and values are of one state of the history.
            let connection = connection.unchecked_transaction()?;
            let of_results = values
                .iter()
                .take(values.len() - usize::from(slot.is_some()));
            let invalid =
                connection
                    .query_row(&of_invalid, params_from_iter(of_results), |row| row.get(0))?;
            let mut begun = Instant::now();
            let mut statement = connection.prepare(&query)?;
            let mut rows = statement.query(params_from_iter(values))?;
            let mut courses: Vec<(i64, Course, Limited)> = Vec::new();
            let mut read = 0_u32;
            while let Some(row) = rows.next()? {
                read += 1;
                if rest == Rest::OfStation && read.is_multiple_of(SLICE) {
                    std::thread::sleep((3 * begun.elapsed()).min(LONGEST));
                    begun = Instant::now();
                }
                let (place, name, unit): (i64, _, _) = (
                    row.get(2)?,
                    row.get_ref(3)?.as_str()?,
                    row.get_ref(4)?.as_str()?,
                );
                let known = courses.iter().position(|(at, course, _)| {
                    *at == place && course.name == name && course.unit == unit
                });
                let at = known.unwrap_or_else(|| {
                    let left_out = LeftOut {
                        invalid,
                        ..LeftOut::default()
                    };
                    let course = Course::new(name, unit, left_out);
                    courses.push((place, course, Limited::default()));
                    courses.len() - 1
                });
                let (_, course, limited) = &mut courses[at];
                let seq: u32 = row.get(0)?;
                if row.get::<_, Verdict>(1)? == Verdict::Invalid {
                    continue;
                }
                if of_studies.contains(&seq) {
                    course.left_out.of_studies += 1;
                    continue;
                }
                let is_valid = row.get::<_, u16>(6)? & decision::VALID != 0;
                let Some(value) = row.get::<_, Option<f64>>(5)?.filter(|_| is_valid) else {
                    course.left_out.not_measured += 1;
                    continue;
                };
                let judged = limited.of(row.get(9)?, row.get(10)?);
                course.add_number(
                    seq.into(),
                    value,
                    given.unwrap_or(judged),
                    row.get(7)?,
                    row.get(8)?,
                );
            }
            Ok(courses.into_iter().map(|(_, course, _)| course).collect())
        })
    }
}

/// Whether the reader rests while a station measures on the same processor: a core that works takes memory and clock
/// from the others.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rest {
    /// No station uses the history.
    None,
    /// For three times as long as it works.
    OfStation,
}

/// Rows between two rests.
const SLICE: u32 = 4096;
/// The longest rest.
const LONGEST: Duration = Duration::from_millis(20);

/// The limits of the row before, which most rows share.
#[derive(Default)]
struct Limited {
    read: (Option<f64>, Option<f64>),
    bounds: LimitPair,
}

impl Limited {
    fn of(&mut self, low: Option<f64>, high: Option<f64>) -> LimitPair {
        if self.read != (low, high) {
            self.read = (low, high);
            self.bounds = (low.and_then(Decimal::of), high.and_then(Decimal::of));
        }
        self.bounds
    }
}
