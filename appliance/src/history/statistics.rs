//! Statistics of a recipe: its results by verdict and reason, and the figures of each gauge over time, strokes or results.
//!
//! The history is read twice within one transaction, so that all numbers are of one state of it: the first pass sums up, the
//! second looks for what stands out from these sums. Memory grows with gauges and columns, not with results.

use super::HistoryResult;
use super::course::{Limited, Rest, ValueRow, each_value};
use super::entry::Filter;
use super::reader::{Reader, condition};
use crate::station::{Counts, Verdict};
use crate::study::drift::DriftSearch;
use crate::study::group::{ProcessGroup, RunningGroup};
use crate::study::{Decimal, LeftOut, marks};
use rusqlite::{Connection, params_from_iter};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, HashSet};
use std::time::{Duration, Instant};

/// Bars of a histogram.
const BARS: usize = 40;
/// Reasons that are listed; the rest is summed up.
const REASONS: usize = 12;
/// Time between two reports of the progress.
const PERIOD: Duration = Duration::from_millis(200);
/// Values that a test looks back on, at most.
const RECENT: usize = 15;

/// What a chart runs over.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Axis {
    /// Time of the trigger, µs since 1970 UTC.
    #[default]
    Time,
    /// PRESS_STROKE.
    Stroke,
    /// RESULT_SEQ.
    Result,
}

impl Axis {
    fn expression(self) -> &'static str {
        match self {
            Self::Time => "coalesce(time_utc_us, browser_utc_us)",
            Self::Stroke => "press_stroke",
            Self::Result => "seq",
        }
    }
}

/// What statistics are asked for.
#[derive(Clone, Debug)]
pub struct StatisticsRequest {
    /// Of which results; its limit does not count.
    pub filter: Filter,
    /// Only of the gauge in this slot.
    pub slot: Option<u16>,
    /// What charts run over.
    pub axis: Axis,
    /// Columns of a chart, at most: it has no more than its axis has places.
    pub columns: usize,
}

/// A part of the answer, in their order.
#[derive(Debug, Serialize)]
#[serde(tag = "part", rename_all = "lowercase")]
pub enum StatisticsPart {
    /// The results, whatever they measured.
    Results(ResultStatistics),
    /// How far the work is, 0 to 1.
    Progress {
        /// Share.
        done: f64,
    },
    /// The figures of a gauge.
    Gauge(GaugeStatistics),
    /// What stands out among its values.
    Marks(GaugeMarks),
    /// Nothing is missing.
    End,
}

/// The results of a period.
#[derive(Debug, Default, Serialize)]
pub struct ResultStatistics {
    /// The axis, and its first and last place; none without results on it.
    pub axis: Axis,
    /// First place.
    pub from: Option<i64>,
    /// Last place.
    pub to: Option<i64>,
    /// Results, but for those of studies.
    pub counts: Counts,
    /// Results of guided studies, which are left out.
    pub of_studies: u64,
    /// Results of the recipe that may belong to the period, but the clock was not synchronised.
    pub undated: u64,
    /// Results that are counted but have no place on the axis.
    pub off_axis: u64,
    /// Why results were INVALID, most frequent first.
    pub reasons: Vec<InvalidReason>,
    /// PASS, FAIL and INVALID of each column.
    pub columns: Vec<[u32; 3]>,
    /// Results from which on another version of the recipe judged: taught again, or edited.
    pub versions: Vec<RecipeVersion>,
}

/// Why results were INVALID.
#[derive(Debug, Serialize)]
pub struct InvalidReason {
    /// In words, "…" for the numbers in it.
    pub reason: String,
    /// How many results.
    pub n: u64,
}

/// The first result of a version of a recipe.
#[derive(Debug, Serialize)]
pub struct RecipeVersion {
    /// Its SEQ.
    pub seq: u32,
    /// Where it is on the axis.
    pub x: Option<i64>,
    /// The version's.
    pub fingerprint: String,
}

/// The figures of a gauge.
#[derive(Debug, Serialize)]
pub struct GaugeStatistics {
    /// 1 to 64.
    pub slot: u16,
    /// The gauge's name.
    pub name: String,
    /// The unit's symbol.
    pub unit: String,
    /// How many results were left out.
    pub left_out: LeftOut,
    /// Values by the limits that they were judged by, as `fringed study process` prints them.
    pub groups: Vec<ProcessGroup>,
    /// Where each group begins on the axis.
    pub starts: Vec<Option<i64>>,
    /// Each column's values; none where it has none.
    pub columns: Vec<Option<ChartColumn>>,
}

/// The values in a column of a chart.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct ChartColumn {
    /// How many.
    pub n: u32,
    /// The least.
    pub least: f64,
    /// Their mean.
    pub mean: f64,
    /// The most.
    pub most: f64,
    /// SEQ of the least and of the most.
    pub at: [u32; 2],
}

/// What stands out among the values of a gauge.
#[derive(Debug, Default, Serialize)]
pub struct GaugeMarks {
    /// 1 to 64.
    pub slot: u16,
    /// The gauge's name.
    pub name: String,
    /// The unit's symbol.
    pub unit: String,
    /// How many marks there are.
    pub marks: u64,
    /// The first.
    pub first: Option<MarkedValue>,
    /// The first of each column that has one.
    pub columns: Vec<MarkedValue>,
    /// The value with which it began to drift.
    pub drift: Option<MarkedValue>,
    /// How values are distributed; none without values.
    pub histogram: Option<Histogram>,
}

/// A value that stands out.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct MarkedValue {
    /// Its result's SEQ.
    pub seq: u32,
    /// Where it is on the axis.
    pub x: Option<i64>,
    /// The value.
    pub value: f64,
    /// The test (Nelson 1984); 0 of a drift.
    pub test: u8,
}

/// How values are distributed.
#[derive(Debug, Serialize)]
pub struct Histogram {
    /// Where the first bar begins.
    pub low: f64,
    /// Its width.
    pub step: f64,
    /// Values in each.
    pub counts: Vec<u64>,
}

/// A gauge during the first pass, and what the second finds.
struct GaugeSums {
    place: i64,
    left_out: LeftOut,
    groups: Vec<RunningGroup>,
    starts: Vec<Option<i64>>,
    limited: Limited,
    columns: Vec<Option<ChartColumn>>,
    found: GaugeMarks,
    /// The group of the second pass, and its values so far.
    group: usize,
    recent: Vec<f64>,
    drift: DriftSearch<MarkedValue>,
    /// The least and the most value.
    range: Option<[f64; 2]>,
}

/// The columns of an axis.
struct Scale {
    from: i64,
    /// Places of a column.
    width: f64,
    columns: usize,
}

impl Scale {
    fn column(&self, x: Option<i64>) -> Option<usize> {
        let at = (x? - self.from) as f64 / self.width;
        (at >= 0.0).then_some((at as usize).min(self.columns - 1))
    }
}

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
        rest: Rest,
        mut tell: impl FnMut(StatisticsPart) -> bool,
    ) -> HistoryResult<()> {
        let undated = self.undated(&asked.filter)?;
        self.read(|connection| {
            let connection = connection.unchecked_transaction()?;
            let (mut results, scale) = results(&connection, asked, of_studies)?;
            results.undated = undated;
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
            let summed = walk.pass((0.0, Rest(0)), &mut tell, |row| {
                let gauge = gauge_of(&mut gauges, row, invalid, scale.columns);
                if row.verdict == Verdict::Invalid {
                } else if of_studies.contains(&row.seq) {
                    gauge.left_out.of_studies += 1;
                } else {
                    gauge.sum(row, scale.column(row.x));
                }
            })?;
            if !summed || !gauges.iter().all(|gauge| tell(gauge.figures())) {
                return Ok(());
            }
            gauges.iter_mut().for_each(GaugeSums::begin_histogram);
            let mut next = 0;
            // The figures are shown: what follows has time.
            let looked = walk.pass((0.5, rest), &mut tell, |row| {
                if versions.get(next) == Some(&row.seq) {
                    next += 1;
                    // What was usual before is not any more.
                    gauges.iter_mut().for_each(GaugeSums::begin_anew);
                }
                if row.verdict != Verdict::Invalid && !of_studies.contains(&row.seq) {
                    let gauge = gauge_of(&mut gauges, row, 0, scale.columns);
                    gauge.look(row, &scale);
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
    /// Takes each value, resting so much, and tells how far it is from `done` on; answers whether it came to the end.
    fn pass(
        &self,
        (done, rest): (f64, Rest),
        tell: &mut impl FnMut(StatisticsPart) -> bool,
        mut take: impl FnMut(&ValueRow<'_>),
    ) -> rusqlite::Result<bool> {
        let (mut told, mut results, mut seq, mut goes_on) = (Instant::now(), 0, None, true);
        let asked = self.asked;
        let of = (&asked.filter, asked.slot, asked.axis.expression());
        each_value(self.connection, of, rest, |row| {
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

/// The results of a period, and the columns of the axis.
fn results(
    connection: &Connection,
    asked: &StatisticsRequest,
    of_studies: &HashSet<u32>,
) -> rusqlite::Result<(ResultStatistics, Scale)> {
    let (condition, values) = condition(&asked.filter);
    let x = asked.axis.expression();
    let bounds = format!("SELECT min({x}), max({x}) FROM dated WHERE {condition}");
    let (from, to): (Option<i64>, Option<i64>) =
        connection.query_row(&bounds, params_from_iter(&values), |row| {
            Ok((row.get(0)?, row.get(1)?))
        })?;
    let time = |us: Option<u64>| {
        let us = us.filter(|_| asked.axis == Axis::Time);
        us.and_then(|us| i64::try_from(us).ok())
    };
    // A period is shown whole.
    let from = from.map(|from| time(asked.filter.since_us).unwrap_or(from));
    let to = to.map(|to| time(asked.filter.until_us).map_or(to, |until| until - 1));
    let span = from
        .zip(to)
        .map_or(1, |(from, to)| (to - from).saturating_add(1));
    let columns = asked.columns.min(usize::try_from(span).unwrap_or(1)).max(1);
    let scale = Scale {
        from: from.unwrap_or(0),
        width: span as f64 / columns as f64,
        columns,
    };
    let mut found = ResultStatistics {
        axis: asked.axis,
        from,
        to,
        columns: vec![[0; 3]; columns],
        ..ResultStatistics::default()
    };
    let invalid = Verdict::Invalid.number();
    let query = format!(
        "SELECT seq, {x}, verdict, fingerprint, CASE verdict WHEN {invalid} THEN coalesce(reason, '') END
         FROM dated WHERE {condition} ORDER BY id"
    );
    let mut statement = connection.prepare(&query)?;
    let mut rows = statement.query(params_from_iter(&values))?;
    let mut reasons = BTreeMap::<String, u64>::new();
    let mut version = String::new();
    while let Some(row) = rows.next()? {
        let (seq, x): (u32, Option<i64>) = (row.get(0)?, row.get(1)?);
        let fingerprint = row.get_ref(3)?.as_str()?;
        if version != fingerprint {
            if !version.is_empty() {
                let fingerprint = fingerprint.to_owned();
                found.versions.push(RecipeVersion {
                    seq,
                    x,
                    fingerprint,
                });
            }
            version.clear();
            version.push_str(fingerprint);
        }
        if of_studies.contains(&seq) {
            found.of_studies += 1;
            continue;
        }
        let verdict: Verdict = row.get(2)?;
        found.counts.add(verdict, 1);
        let column = scale.column(x);
        found.off_axis += u64::from(column.is_none());
        let place = usize::from(verdict.number()).checked_sub(1);
        if let Some((column, place)) = column.zip(place) {
            found.columns[column][place] += 1;
        }
        if let Some(reason) = row.get_ref(4)?.as_str_or_null()? {
            *reasons.entry(without_numbers(reason)).or_default() += 1;
        }
    }
    let mut reasons: Vec<_> = reasons.into_iter().collect();
    reasons.sort_by_key(|(_, n)| std::cmp::Reverse(*n));
    let rest: u64 = reasons.iter().skip(REASONS).map(|(_, n)| n).sum();
    reasons.truncate(REASONS);
    reasons.extend((rest > 0).then(|| ("other reasons".to_owned(), rest)));
    let listed = |(reason, n)| InvalidReason { reason, n };
    found.reasons = reasons.into_iter().map(listed).collect();
    Ok((found, scale))
}

/// Words with "…" for each number, so that reasons that differ in their numbers are one.
fn without_numbers(words: &str) -> String {
    let mut text = String::with_capacity(words.len());
    let mut letters = words.chars().peekable();
    while let Some(letter) = letters.next() {
        if !letter.is_ascii_digit() {
            text.push(letter);
            continue;
        }
        text.push('…');
        while letters
            .next_if(|next| next.is_ascii_digit() || *next == '.')
            .is_some()
        {}
    }
    text
}

/// The gauge of a value, which is new where no value of it came before.
fn gauge_of<'a>(
    gauges: &'a mut Vec<GaugeSums>,
    row: &ValueRow<'_>,
    invalid: u64,
    columns: usize,
) -> &'a mut GaugeSums {
    let known = gauges.iter().position(|gauge| {
        gauge.place == row.place && gauge.found.name == row.name && gauge.found.unit == row.unit
    });
    let at = known.unwrap_or_else(|| {
        gauges.push(GaugeSums {
            place: row.place,
            left_out: LeftOut {
                invalid,
                ..LeftOut::default()
            },
            groups: Vec::new(),
            starts: Vec::new(),
            limited: Limited::default(),
            columns: vec![None; columns],
            found: GaugeMarks {
                slot: u16::try_from(row.place + 1).unwrap_or(0),
                name: row.name.to_owned(),
                unit: row.unit.to_owned(),
                ..GaugeMarks::default()
            },
            group: 0,
            recent: Vec::new(),
            drift: DriftSearch::default(),
            range: None,
        });
        gauges.len() - 1
    });
    &mut gauges[at]
}

impl GaugeSums {
    /// The first pass.
    fn sum(&mut self, row: &ValueRow<'_>, column: Option<usize>) {
        let Some(value) = row.value else {
            self.left_out.not_measured += 1;
            return;
        };
        let bounds = self.limited.of(row.limits);
        if self
            .groups
            .last()
            .is_none_or(|group| group.bounds() != bounds)
        {
            let first = Decimal::of(value).unwrap_or_default();
            self.groups.push(RunningGroup::new(bounds, first));
            self.starts.push(row.x);
        }
        let Some(group) = self.groups.last_mut() else {
            return;
        };
        let Some(offset) = group.offset(value) else {
            return;
        };
        group.add(row.seq.into(), offset, row.sigma, row.uncertainty);
        let [least, most] = self.range.unwrap_or([value; 2]);
        self.range = Some([least.min(value), most.max(value)]);
        if let Some(column) = column {
            let seq = row.seq;
            match &mut self.columns[column] {
                None => {
                    self.columns[column] = Some(ChartColumn {
                        n: 1,
                        least: value,
                        mean: value,
                        most: value,
                        at: [seq; 2],
                    });
                }
                Some(column) => column.add(value, seq),
            }
        }
    }

    fn figures(&self) -> StatisticsPart {
        StatisticsPart::Gauge(GaugeStatistics {
            slot: self.found.slot,
            name: self.found.name.clone(),
            unit: self.found.unit.clone(),
            left_out: self.left_out,
            groups: self.groups.iter().map(RunningGroup::figures).collect(),
            starts: self.starts.clone(),
            columns: self.columns.clone(),
        })
    }

    fn begin_histogram(&mut self) {
        self.found.histogram = self.range.map(|[low, high]| Histogram {
            low,
            step: (high - low) / BARS as f64,
            counts: vec![0; BARS],
        });
    }

    /// Forgets what was usual.
    fn begin_anew(&mut self) {
        self.drift = DriftSearch::default();
    }

    /// The second pass.
    fn look(&mut self, row: &ValueRow<'_>, scale: &Scale) {
        let Some(value) = row.value else { return };
        let bounds = self.limited.of(row.limits);
        if self.groups[self.group].bounds() != bounds {
            self.group = (self.group + 1).min(self.groups.len() - 1);
            self.recent.clear();
            self.begin_anew();
        }
        let group = &self.groups[self.group];
        let Some(offset) = group.offset(value) else {
            return;
        };
        if let Some(histogram) = &mut self.found.histogram {
            histogram.count(value);
        }
        let Some(distance) = group.distance(offset) else {
            return;
        };
        let marked = |test| MarkedValue {
            seq: row.seq,
            x: row.x,
            value,
            test,
        };
        self.drift.add(distance, marked(0));
        if self.recent.len() == 4 * RECENT {
            self.recent.drain(..3 * RECENT + 1);
        }
        self.recent.push(distance);
        let tests = marks::USUAL.into_iter();
        for test in tests.filter(|test| marks::is_marked(&self.recent, *test)) {
            self.found.mark(marked(test), scale);
        }
        self.found.drift = self.found.drift.or(self.drift.found());
    }
}

impl ChartColumn {
    fn add(&mut self, value: f64, seq: u32) {
        self.n += 1;
        self.mean += (value - self.mean) / f64::from(self.n);
        if value < self.least {
            (self.least, self.at[0]) = (value, seq);
        }
        if value > self.most {
            (self.most, self.at[1]) = (value, seq);
        }
    }
}

impl GaugeMarks {
    fn mark(&mut self, marked: MarkedValue, scale: &Scale) {
        self.marks += 1;
        self.first = self.first.or(Some(marked));
        let last = self.columns.last().map(|last| scale.column(last.x));
        let column = scale.column(marked.x);
        // Along the axis most come in its order; of others a column may be listed twice.
        if column.is_some() && last != Some(column) && self.columns.len() < 2 * scale.columns {
            self.columns.push(marked);
        }
    }
}

impl Histogram {
    fn count(&mut self, value: f64) {
        let at = (value - self.low) / self.step;
        // Of equal values there is one bar, 0/0.
        let at = if at > 0.0 { at as usize } else { 0 };
        let last = self.counts.len() - 1;
        self.counts[at.min(last)] += 1;
    }
}
