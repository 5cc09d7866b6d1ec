//! What statistics are asked for, and the parts of the answer.

use crate::history::entry::Filter;
use crate::station::Counts;
use crate::study::LeftOut;
use crate::study::group::ProcessGroup;
use serde::{Deserialize, Serialize};

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
    /// Its place of a result, of the columns of `dated`.
    pub(super) fn expression(self) -> &'static str {
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
