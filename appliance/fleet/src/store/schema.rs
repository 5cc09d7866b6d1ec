//! All SQL, which lies in files.

use clap::ValueEnum;

/// What a store is made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Kind {
    /// One ClickHouse server.
    #[value(name = "clickhouse")]
    ClickHouse,
    /// Several, with shards and replicas.
    Cluster,
    /// An SQLite file.
    Sqlite,
}

/// The tables of ClickHouse: the column that decides which of two rows is the newer, and what rows
/// are shared out by.
const TABLES: [(&str, &str, &str); 3] = [
    ("result", "received_unix_ms", "serial"),
    ("gap", "last", "serial"),
    ("head", "updated_unix_ms", "url"),
];

/// Statements that make tables and views, where they are not there yet; each ends with `;` at the
/// end of a line. Those of a cluster are of the database `plant`: ClickHouse 18.16 works
/// `currentDatabase()` out again when it starts, and then there is none.
pub fn schema(kind: Kind) -> String {
    let (tables, views) = match kind {
        Kind::Sqlite => (
            include_str!("sql/sqlite/tables.sql").to_owned(),
            include_str!("sql/sqlite/views.sql"),
        ),
        _ => (
            of_servers(kind == Kind::Cluster),
            include_str!("sql/clickhouse/views.sql"),
        ),
    };
    let starts = match kind {
        Kind::Sqlite => ["at - at % 3600", "at - at % 86400"],
        _ => ["toStartOfHour(at)", "toDate(at)"],
    };
    let mut all = tables;
    for statement in views.split_inclusive(";\n") {
        if !statement.contains("$period") {
            all += statement;
            continue;
        }
        for (period, start) in ["hour", "day"].into_iter().zip(starts) {
            all += &statement
                .replace("$period", period)
                .replace("$start", start);
        }
    }
    all
}

fn of_servers(cluster: bool) -> String {
    let mut tables = include_str!("sql/clickhouse/tables.sql").to_owned();
    for (name, version, key) in TABLES {
        let engine = match cluster {
            true => format!(
                "ReplicatedReplacingMergeTree('/clickhouse/tables/{{shard}}/{name}', '{{replica}}', {version})"
            ),
            false => format!("ReplacingMergeTree({version})"),
        };
        tables = tables.replace(&format!("${name}"), &engine);
        if cluster {
            tables += &format!(
                "\nCREATE TABLE IF NOT EXISTS {name} AS {name}_local\n    \
                 ENGINE = Distributed(plant, plant, {name}_local, cityHash64({key}));\n"
            );
        }
    }
    tables.replace("$local", if cluster { "_local" } else { "" })
}

/// The statements of a schema, without comments.
pub(super) fn statements(schema: &str) -> impl Iterator<Item = String> {
    let lines = schema.lines();
    let code = lines.filter(|line| !line.trim_start().starts_with("--"));
    let code: Vec<_> = code.collect();
    let code = code.join("\n");
    let statements: Vec<_> = code
        .split(";\n")
        .map(|s| s.trim().trim_end_matches(';').to_owned())
        .collect();
    statements
        .into_iter()
        .filter(|statement| !statement.is_empty())
}

/// A question to a store, whose answer is a line of JSON per row.
#[derive(Clone, Copy, Debug)]
pub(super) enum Query {
    Ends,
    Heads,
    Counts,
    Spreads,
}

macro_rules! of_kind {
    ($kind:expr, $file:literal) => {
        match $kind {
            Kind::Sqlite => include_str!(concat!("sql/sqlite/", $file)),
            _ => include_str!(concat!("sql/clickhouse/", $file)),
        }
    };
}

impl Query {
    /// Its SQL, about results since a time (s since 1970 UTC) where it is about results.
    pub(super) fn sql(self, kind: Kind, since: u64) -> String {
        let sql = match self {
            Self::Ends => of_kind!(kind, "ends.sql"),
            Self::Heads => of_kind!(kind, "heads.sql"),
            Self::Counts => of_kind!(kind, "counts.sql"),
            Self::Spreads => of_kind!(kind, "spreads.sql"),
        };
        sql.replace("$since", &since.to_string())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_mark_is_left_in_a_schema_and_every_kind_has_the_same_views() {
        let views = |kind| {
            let statements: Vec<_> = statements(&schema(kind)).collect();
            let views = statements
                .iter()
                .filter_map(|s| s.strip_prefix("CREATE VIEW IF NOT EXISTS "));
            views
                .filter_map(|s| s.split(' ').next())
                .map(str::to_owned)
                .collect::<Vec<_>>()
        };
        for kind in [Kind::ClickHouse, Kind::Cluster, Kind::Sqlite] {
            let marks: Vec<_> = schema(kind)
                .match_indices(['$'])
                .map(|(at, _)| schema(kind)[at..at + 9].to_owned())
                .collect();
            assert!(
                marks
                    .iter()
                    .all(|mark| kind == Kind::Sqlite && mark.starts_with("$.")),
                "{marks:?}"
            );
            assert_eq!(views(kind).len(), 8);
            assert_eq!(views(kind), views(Kind::Sqlite));
        }
        assert!(schema(Kind::Cluster).contains("result_local"));
        assert!(!schema(Kind::ClickHouse).contains("_local"));
    }
}
