//! A result as rows of the tables `result` and `gauge`: each column that is a field is named once, for writing and for reading.

use super::entry::{Entry, GaugeEntry};
use super::reader::rows;
use crate::station::{Placement, Square, Verdict};
use rusqlite::types::{FromSql, FromSqlError, FromSqlResult, ToSql, ToSqlOutput, ValueRef};
use rusqlite::{Connection, Row, Transaction};

/// Declares the columns of a table: those whose values are given beside the fields, and the fields. A column has the name of its field.
macro_rules! columns {
    ($of:ident in $table:literal; $($beside:ident)*; $($field:ident)*) => {
        impl $of {
            fn insert(&self, transaction: &Transaction<'_>, $($beside: &dyn ToSql),*) -> rusqlite::Result<()> {
                let columns = [
                    $((stringify!($beside), $beside),)*
                    $((stringify!($field), &self.$field as &dyn ToSql),)*
                ];
                let (names, values): (Vec<_>, Vec<_>) = columns.into_iter().unzip();
                let marks = vec!["?"; names.len()].join(", ");
                let insert = format!("INSERT INTO {} ({}) VALUES ({marks})", $table, names.join(", "));
                transaction.prepare_cached(&insert)?.execute(&*values)?;
                Ok(())
            }

            fn read(&mut self, row: &Row<'_>) -> rusqlite::Result<()> {
                $(self.$field = row.get(stringify!($field))?;)*
                Ok(())
            }
        }
    };
}

columns!(Entry in "result"; stages;
    seq time_utc_us recipe fingerprint part_id press_stroke token verdict error_code reason flags valid_points coverage_permille
    temperature_c height_noise_mm fitness_permille exposure_us total_us recording
    uptime_s boot_id unkept placement);
columns!(GaugeEntry in "gauge"; result place; name unit value sigma low high decision uncertainty expected square);

/// Stores a result with its gauges.
pub(super) fn insert(transaction: &Transaction<'_>, entry: &Entry) -> rusqlite::Result<()> {
    let stages = serde_json::to_string(&entry.stages).unwrap_or_default();
    entry.insert(transaction, &stages)?;
    let result = transaction.last_insert_rowid();
    for (place, gauge) in entry.gauges.iter().enumerate() {
        gauge.insert(transaction, &result, &place)?;
    }
    Ok(())
}

/// The result of a row of the view `dated`, with its gauges.
pub(super) fn read(connection: &Connection, row: &Row<'_>) -> rusqlite::Result<Entry> {
    let id: i64 = row.get("id")?;
    let stages: String = row.get("stages")?;
    let of_result = "SELECT * FROM gauge WHERE result = ?1 ORDER BY place";
    let mut entry = Entry {
        browser_utc_us: row.get("browser_utc_us")?,
        // Times are only shown: what cannot be read is left out.
        stages: serde_json::from_str(&stages).unwrap_or_default(),
        gauges: rows(connection, of_result, [id], |row| {
            let mut gauge = GaugeEntry::default();
            gauge.read(row).map(|()| gauge)
        })?,
        ..Entry::default()
    };
    entry.read(row).map(|()| entry)
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

/// Stores a type as JSON.
macro_rules! as_json {
    ($($of:ident)*) => {$(
        impl ToSql for $of {
            fn to_sql(&self) -> rusqlite::Result<ToSqlOutput<'_>> {
                // Numbers that are finite are always JSON.
                Ok(serde_json::to_string(self).unwrap_or_default().into())
            }
        }

        impl FromSql for $of {
            fn column_result(value: ValueRef<'_>) -> FromSqlResult<Self> {
                let read = serde_json::from_str(value.as_str()?);
                read.map_err(|error| FromSqlError::Other(error.into()))
            }
        }
    )*};
}

as_json!(Placement Square);
