//! A result as the history keeps it: the columns of its table, and a filter of results.

use crate::station::result::flag;
use crate::station::{
    Decision, GaugeValue, Inspection, MAX_GAUGES, Placement, ResultRecord, Square, Stages, Unit,
    UnsteadyLight, Verdict,
};
use rusqlite::types::{FromSql, FromSqlError, FromSqlResult, ToSql, ToSqlOutput, ValueRef};

/// Declares a type that the history keeps: first its columns, each once, with its value and its
/// type in SQL, then the fields that are no columns. A column and a key in JSON have the name of
/// the field.
macro_rules! columns {
    (
        $(#[$about:meta])* $name:ident in $table:literal, $from:ident: $source:ty;
        { $($(#[$doc:meta])* $field:ident: $type:ty = $value:expr, $sql:literal;)* }
        { $($(#[$also:meta])* $beside:ident: $other:ty = $given:expr;)* }
    ) => {
        $(#[$about])*
        #[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
        pub struct $name {
            $($(#[$doc])* pub $field: $type,)*
            $($(#[$also])* pub $beside: $other,)*
        }

        impl $name {
            /// The columns as `CREATE TABLE` has them.
            pub(super) const COLUMNS: &[&str] = &[$(concat!(stringify!($field), " ", $sql)),*];

            /// What the history keeps of it.
            pub fn of($from: &$source) -> Self {
                Self { $($field: $value,)* $($beside: $given,)* }
            }

            pub(super) fn insert(&self, transaction: &rusqlite::Transaction<'_>, keys: &[(&str, &dyn rusqlite::ToSql)]) -> rusqlite::Result<()> {
                let mut columns = keys.to_vec();
                columns.extend([$((stringify!($field), &self.$field as &dyn rusqlite::ToSql)),*]);
                let (names, values): (Vec<_>, Vec<_>) = columns.into_iter().unzip();
                let marks = vec!["?"; names.len()].join(", ");
                let insert = format!("INSERT INTO {} ({}) VALUES ({marks})", $table, names.join(", "));
                transaction.prepare_cached(&insert)?.execute(&*values)?;
                Ok(())
            }

            pub(super) fn read(row: &rusqlite::Row<'_>) -> rusqlite::Result<Self> {
                Ok(Self {
                    $($field: row.get(stringify!($field))?,)*
                    $($beside: Default::default(),)*
                })
            }
        }
    };
}
impl ToSql for Verdict {
    fn to_sql(&self) -> rusqlite::Result<ToSqlOutput<'_>> {
        Ok(self.number().into())
    }
}

impl FromSql for Verdict {
    /// Anything unknown counts as not judged.
    fn column_result(value: ValueRef<'_>) -> FromSqlResult<Self> {
        u16::column_result(value).map(|number| Self::of_number(number).unwrap_or_default())
    }
}

/// Stores types as JSON, and says what is read where that is damaged.
macro_rules! as_json {
    ($($($of:ident)* => $damaged:expr;)*) => {$($(
        impl ToSql for $of {
            fn to_sql(&self) -> rusqlite::Result<ToSqlOutput<'_>> {
                // Numbers that are finite are always JSON.
                Ok(serde_json::to_string(self).unwrap_or_default().into())
            }
        }

        impl FromSql for $of {
            fn column_result(value: ValueRef<'_>) -> FromSqlResult<Self> {
                serde_json::from_str(value.as_str()?).or_else($damaged)
            }
        }
    )*)*};
}

as_json! {
    Placement Square UnsteadyLight => |error| Err(FromSqlError::Other(error.into()));
    // Times are only shown: what cannot be read is left out.
    Stages => |_| Ok(Stages::default());
}

columns! {
    /// One stored result. Lengths in mm, times in µs.
    Entry in "result", record: ResultRecord;
    {
        /// RESULT_SEQ.
        seq: u32 = record.seq, "INTEGER NOT NULL";
        /// Trigger time in µs since 1970 UTC; `None` if the clock was not synchronised.
        time_utc_us: Option<u64> = Some(record.time_utc_us).filter(|&time| time != 0), "INTEGER";
        /// Trigger time since the start of the daemon, s.
        uptime_s: u32 = record.uptime_s, "INTEGER NOT NULL";
        /// The start of the daemon during which the trigger came: BOOT_ID as 8 hexadecimal digits.
        boot_id: String = format!("{:08x}", record.boot_id), "TEXT NOT NULL";
        /// Recipe number.
        recipe: u16 = record.recipe, "INTEGER NOT NULL";
        /// The first 8 hexadecimal digits of the recipe's fingerprint.
        fingerprint: String = format!("{:08x}", record.recipe_crc), "TEXT NOT NULL";
        /// PART_ID.
        part_id: u32 = record.part_id, "INTEGER NOT NULL";
        /// PRESS_STROKE.
        press_stroke: u32 = record.press_stroke, "INTEGER NOT NULL";
        /// The token that triggered, 0 for an edge.
        token: u16 = record.token, "INTEGER NOT NULL";
        /// The token of a request by the API.
        request: Option<String> = record.request.as_deref().map(str::to_owned), "TEXT";
        /// PASS, FAIL or INVALID.
        verdict: Verdict = record.verdict, "INTEGER NOT NULL";
        /// 0, or why there is no measurement.
        error_code: u16 = record.error_code, "INTEGER NOT NULL";
        /// Why it is INVALID, in words.
        reason: Option<String> = record.inspection.reason.as_deref().map(str::to_owned), "TEXT";
        /// RESULT flags, register 231.
        flags: u16 = record.flags(), "INTEGER NOT NULL";
        /// Resolved pixels.
        valid_points: u32 = record.inspection.valid_points, "INTEGER NOT NULL";
        /// Share of the surface compared with golden that is resolved, ‰.
        coverage_permille: u16 = record.inspection.coverage_permille, "INTEGER NOT NULL";
        /// Head temperature, °C.
        temperature_c: Option<f64> = finite(record.inspection.temperature_c), "REAL";
        /// Height noise, 1 σ, mm.
        height_noise_mm: Option<f64> = finite(Some(record.inspection.height_noise_mm)), "REAL";
        /// Pattern fitness, ‰.
        fitness_permille: u16 = record.inspection.fitness_permille, "INTEGER NOT NULL";
        /// Trigger → exposure done, µs.
        exposure_us: u32 = record.exposure_us, "INTEGER NOT NULL";
        /// Trigger → result, µs.
        total_us: u32 = record.total_us, "INTEGER NOT NULL";
        /// Times of the stages, in their order.
        stages: Stages = record.stages(), "TEXT NOT NULL";
        /// How the part lay; `None` where it was not aligned.
        placement: Option<Placement> = record.inspection.placement.filter(is_finite), "TEXT";
        /// How the light changed within the cycle; `None` where it did not beyond noise.
        light: Option<UnsteadyLight> = record.inspection.light.as_deref().cloned(), "TEXT";
        /// The folder in `recordings/` that holds the frames, if they were kept.
        recording: Option<String> = None, "TEXT";
        /// Why the frames of a part that did not pass were not kept, as far as known; see
        /// [`super::Unkept`].
        unkept: Option<String> = None, "TEXT";
    }
    {
        /// Where the clock was not synchronised: the trigger time in µs since 1970 UTC by the clock
        /// of a browser whose user signed in during the same start.
        browser_utc_us: Option<u64> = None;
        /// The gauges, by ascending slots.
        gauges: Vec<GaugeEntry> = record.inspection.gauges.iter().map(GaugeEntry::of).collect();
    }
}

columns! {
    /// One gauge of a stored result, in mm, °, mm³ or as a share.
    GaugeEntry in "gauge", gauge: GaugeValue;
    {
        /// The gauge's name.
        name: String = gauge.name.as_ref().into(), "TEXT NOT NULL";
        /// The unit's symbol, empty for shares and bare numbers.
        unit: String = gauge.unit.symbol().into(), "TEXT NOT NULL";
        /// None if it could not be measured, or is absent.
        value: Option<f64> = finite(gauge.value), "REAL";
        /// Why there is no value, in words.
        reason: Option<String> = gauge.reason.as_deref().map(str::to_owned), "TEXT";
        /// 1 σ, as far as predicted.
        sigma: Option<f64> = finite(gauge.sigma), "REAL";
        /// U = 2 u, with the systematic part of the error.
        uncertainty: Option<f64> = finite(gauge.uncertainty), "REAL";
        /// The magnitude that is expected on a good part, where noise moves the value away from 0.
        expected: Option<f64> = finite(gauge.expected), "REAL";
        /// The square that the value is of, where it is a deviation.
        square: Option<Square> = gauge.square, "TEXT";
        /// Lower limit.
        low: Option<f64> = finite(gauge.low), "REAL";
        /// Upper limit.
        high: Option<f64> = finite(gauge.high), "REAL";
        /// The bits of registers 1116–1179: 0 pass, 1 valid, 2 low, 3 high, 4 doubtful, 5 absent.
        decision: u16 = gauge.decision.bits(), "INTEGER NOT NULL";
    }
    {
        /// The place in the registers, 1 to 64; the column `place` is one less.
        slot: u16 = gauge.slot;
    }
}

impl Entry {
    /// The result as registers show it. Its recipe's name and what only the page shows are not
    /// known.
    pub fn record(&self) -> ResultRecord {
        let hex = |text: &str| u32::from_str_radix(text, 16).unwrap_or(0);
        let gauge = |of: &GaugeEntry| GaugeValue {
            slot: of.slot,
            name: of.name.as_str().into(),
            unit: Unit::of_symbol(&of.unit),
            value: of.value,
            reason: of.reason.as_deref().map(Into::into),
            sigma: of.sigma,
            uncertainty: of.uncertainty,
            expected: of.expected,
            square: of.square,
            low: of.low,
            high: of.high,
            decision: Decision::from_bits(of.decision),
        };
        let inspection = Inspection {
            judged: self.verdict,
            reason: self.reason.as_deref().map(Into::into),
            error_code: self.error_code,
            gauges: self.gauges.iter().take(MAX_GAUGES).map(gauge).collect(),
            valid_points: self.valid_points,
            coverage_permille: self.coverage_permille,
            temperature_c: self.temperature_c,
            height_noise_mm: self.height_noise_mm.unwrap_or(f64::NAN),
            fitness_permille: self.fitness_permille,
            flags: self.flags,
            stages: self.stages.clone(),
            placement: self.placement,
            light: self.light.clone().map(Into::into),
            ..Inspection::default()
        };
        ResultRecord {
            seq: self.seq,
            token: self.token,
            request: self.request.as_deref().map(Into::into),
            recipe: self.recipe,
            recipe_name: "".into(),
            recipe_crc: hex(&self.fingerprint),
            part_id: self.part_id,
            press_stroke: self.press_stroke,
            verdict: self.verdict,
            error_code: self.error_code,
            time_utc_us: self.time_utc_us.unwrap_or(0),
            uptime_s: self.uptime_s,
            boot_id: hex(&self.boot_id),
            exposure_us: self.exposure_us,
            total_us: self.total_us,
            inspection: inspection.into(),
        }
    }
}

/// Which results: all conditions hold together. The default asks for the newest hundred.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Filter {
    /// Results of this recipe only.
    pub recipe: Option<u16>,
    /// Results with this verdict only.
    pub verdict: Option<Verdict>,
    /// Results of this PART_ID only.
    pub part_id: Option<u32>,
    /// Results that were triggered at or after this time, µs since 1970 UTC. Results without a time
    /// are then left out.
    pub since_us: Option<u64>,
    /// Results that were triggered before this time, µs since 1970 UTC.
    pub until_us: Option<u64>,
    /// Results of this PRESS_STROKE or a later one.
    pub from_stroke: Option<u32>,
    /// Results of this PRESS_STROKE or an earlier one.
    pub to_stroke: Option<u32>,
    /// Results of this SEQ or a later one.
    pub from_seq: Option<u32>,
    /// Results of this SEQ or an earlier one.
    pub to_seq: Option<u32>,
    /// Results that were stored before the result of this SEQ: the next page of a list.
    pub before_seq: Option<u32>,
    /// At most this many results, the newest.
    pub limit: usize,
}

impl Default for Filter {
    fn default() -> Self {
        Self {
            recipe: None,
            verdict: None,
            part_id: None,
            since_us: None,
            until_us: None,
            from_stroke: None,
            to_stroke: None,
            from_seq: None,
            to_seq: None,
            before_seq: None,
            limit: 100,
        }
    }
}

/// A number that JSON can hold.
fn finite(number: Option<f64>) -> Option<f64> {
    number.filter(|number| number.is_finite())
}

/// Whether JSON can hold it; components that are not finite become null.
fn is_finite(placement: &Placement) -> bool {
    placement.reach_mm.is_finite() && placement.outliers.is_finite()
}

/// Flags that say how a cycle went, not what its frames show.
const COURSE: u16 = flag::RETRIED | flag::STEPPED_UP | flag::WARM_UP;

/// How a replayed result differs from the stored one, in words; `None` if it is the same bit by
/// bit. What belongs to the cycle and not to its frames is not compared: numbers, times,
/// temperature, the flags of its course.
pub fn difference(stored: &Entry, replayed: &Entry) -> Option<String> {
    let same = Entry {
        recipe: replayed.recipe,
        fingerprint: replayed.fingerprint.clone(),
        verdict: replayed.verdict,
        error_code: replayed.error_code,
        reason: replayed.reason.clone(),
        flags: (stored.flags & COURSE) | (replayed.flags & !COURSE),
        valid_points: replayed.valid_points,
        coverage_permille: replayed.coverage_permille,
        height_noise_mm: replayed.height_noise_mm,
        fitness_permille: replayed.fitness_permille,
        gauges: replayed.gauges.clone(),
        placement: replayed.placement,
        light: replayed.light.clone(),
        ..stored.clone()
    };
    if same == *stored {
        return None;
    }
    let mut gauges = stored.gauges.iter().zip(&same.gauges);
    Some(match gauges.find(|(stored, replayed)| stored != replayed) {
        Some((stored, replayed)) => format!("a gauge was {stored:?}, is {replayed:?}"),
        None => format!("it was {stored:?}, is {same:?}"),
    })
}
