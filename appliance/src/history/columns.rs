//! Types that are rows of a table: their columns, and how values are written and read.

use crate::station::{Placement, Square, Stages, Verdict};
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
pub(super) use columns;

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
    Placement Square => |error| Err(FromSqlError::Other(error.into()));
    // Times are only shown: what cannot be read is left out.
    Stages => |_| Ok(Stages::default());
}
