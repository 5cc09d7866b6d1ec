//! The sums of a gauge's values in the first pass, and what the second finds with them.

use super::parts::{
    ChartColumn, GaugeMarks, GaugeStatistics, Histogram, MarkedValue, StatisticsPart,
};
use super::period::AxisColumns;
use crate::history::course::{Limited, ValueRow};
use crate::study::drift::DriftSearch;
use crate::study::group::RunningGroup;
use crate::study::{Decimal, LeftOut, marks};

/// Bars of a histogram.
const BARS: usize = 40;
/// Values that a test looks back on, at most.
const RECENT: usize = 15;

/// A gauge during the first pass, and what the second finds.
pub(super) struct GaugeSums {
    place: i64,
    pub left_out: LeftOut,
    groups: Vec<RunningGroup>,
    starts: Vec<Option<i64>>,
    limited: Limited,
    columns: Vec<Option<ChartColumn>>,
    pub found: GaugeMarks,
    /// The group of the second pass, and its values so far.
    group: usize,
    recent: Vec<f64>,
    drift: DriftSearch<MarkedValue>,
    /// The least and the most value.
    range: Option<[f64; 2]>,
}

/// The gauge of a value, which is new where no value of it came before.
pub(super) fn gauge_of<'a>(
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
    pub fn sum(&mut self, row: &ValueRow<'_>, column: Option<usize>) {
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
            self.starts.push(None);
        }
        let Some((group, start)) = self.groups.last_mut().zip(self.starts.last_mut()) else {
            return;
        };
        *start = start.or(row.x);
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

    /// The figures.
    pub fn figures(&self) -> StatisticsPart {
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

    /// Before the second pass.
    pub fn begin_histogram(&mut self) {
        self.found.histogram = self.range.map(|[low, high]| Histogram {
            low,
            step: (high - low) / BARS as f64,
            counts: vec![0; BARS],
        });
    }

    /// Forgets what was usual.
    pub fn begin_anew(&mut self) {
        self.drift = DriftSearch::default();
    }

    /// The second pass.
    pub fn look(&mut self, row: &ValueRow<'_>, axis_columns: &AxisColumns) {
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
            self.found.mark(marked(test), axis_columns);
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
    fn mark(&mut self, marked: MarkedValue, axis_columns: &AxisColumns) {
        self.marks += 1;
        self.first = self.first.or(Some(marked));
        let last = self.columns.last().map(|last| axis_columns.column(last.x));
        let column = axis_columns.column(marked.x);
        // Along the axis most come in its order; of others a column may be listed twice.
        if column.is_some() && last != Some(column) && self.columns.len() < 2 * axis_columns.columns
        {
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
