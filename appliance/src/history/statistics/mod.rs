//! Statistics of a recipe: its results by verdict and reason, and the figures of each gauge over time, strokes or results.
//!
//! The history is read twice within one transaction, so that all numbers are of one state of it: the first pass sums up, the
//! second looks for what stands out from these sums. Memory grows with gauges and columns, not with results.

mod parts;
mod period;
mod sums;

pub use parts::{Axis, StatisticsPart, StatisticsRequest};

use super::HistoryResult;
use super::course::{Rest, ValueRow, each_value};
use super::reader::Reader;
use crate::station::{Counts, Verdict};
use period::results;
use rusqlite::Connection;
use std::collections::HashSet;
use std::time::{Duration, Instant};
use sums::{GaugeSums, gauge_of};

/// Time between two reports of the progress.
const PERIOD: Duration = Duration::from_millis(200);

impl Reader {
    /// Works statistics out, and hands over each part of them, until `tell` says that it is enough. Results of guided studies
    /// (`of_studies`, by SEQ) are left out.
    ///
    /// # Errors
    /// As [`Self::results`].
    pub fn statistics(
        &self,
        asked: &StatisticsRequest,
        of_studies: &HashSet<u32>,
        mut tell: impl FnMut(StatisticsPart) -> bool,
    ) -> HistoryResult<()> {
        self.read(|connection| {
            let connection = connection.unchecked_transaction()?;
            let (results, axis_columns) = results(&connection, asked, of_studies)?;
            let versions: Vec<u32> = results.versions.iter().map(|version| version.seq).collect();
            let Counts {
                pass,
                fail,
                invalid,
            } = results.counts;
            let all = pass + fail + invalid + results.of_studies;
            if !tell(StatisticsPart::Results(results)) {
                return Ok(());
            }
            let walk = Walk {
                connection: &connection,
                asked,
                all,
            };
            let mut gauges: Vec<GaugeSums> = Vec::new();
            let summed = walk.pass(0.0, &mut tell, |row| {
                let gauge = gauge_of(&mut gauges, row, invalid, axis_columns.columns);
                if row.verdict == Verdict::Invalid {
                } else if of_studies.contains(&row.seq) {
                    gauge.left_out.of_studies += 1;
                } else {
                    gauge.sum(row, axis_columns.column(row.x));
                }
            })?;
            if !summed || !gauges.iter().all(|gauge| tell(gauge.figures())) {
                return Ok(());
            }
            gauges.iter_mut().for_each(GaugeSums::begin_histogram);
            let mut next = 0;
            let looked = walk.pass(0.5, &mut tell, |row| {
                let has_come = |first: &u32| row.seq.wrapping_sub(*first).cast_signed() >= 0;
                while versions.get(next).is_some_and(has_come) {
                    next += 1;
                    // What was usual before is not any more.
                    gauges.iter_mut().for_each(GaugeSums::begin_anew);
                }
                if row.verdict != Verdict::Invalid && !of_studies.contains(&row.seq) {
                    let gauge = gauge_of(&mut gauges, row, 0, axis_columns.columns);
                    gauge.look(row, &axis_columns);
                }
            })?;
            if looked {
                let mut marks = gauges
                    .into_iter()
                    .map(|gauge| StatisticsPart::Marks(gauge.found));
                if marks.all(&mut tell) {
                    tell(StatisticsPart::End);
                }
            }
            Ok(())
        })
    }
}

/// Passes over the values of one state of the history.
struct Walk<'a> {
    connection: &'a Connection,
    asked: &'a StatisticsRequest,
    /// Results on the way.
    all: u64,
}

impl Walk<'_> {
    /// Takes each value, and tells how far it is from `done` on; answers whether it came to the end.
    fn pass(
        &self,
        done: f64,
        tell: &mut impl FnMut(StatisticsPart) -> bool,
        mut take: impl FnMut(&ValueRow<'_>),
    ) -> rusqlite::Result<bool> {
        let (mut told, mut results, mut seq, mut goes_on) = (Instant::now(), 0, None, true);
        let asked = self.asked;
        let of = (&asked.filter, asked.slot, asked.axis.expression());
        each_value(self.connection, of, Rest(0), |row| {
            if seq != Some(row.seq) {
                (seq, results) = (Some(row.seq), results + 1);
                if told.elapsed() > PERIOD {
                    told = Instant::now();
                    let done = done + results as f64 / (2 * self.all.max(1)) as f64;
                    goes_on = tell(StatisticsPart::Progress { done });
                }
            }
            take(&row);
            goes_on
        })?;
        Ok(goes_on)
    }
}
