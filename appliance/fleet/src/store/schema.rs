//! The tables and views of each kind of store, whose SQL lies in files.

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

/// The tables of ClickHouse: the column that decides which of two rows is the newer, if one does,
/// and what rows are shared out by.
const TABLES: [(&str, &str, &str); 4] = [
    ("result", "received_unix_ms", "serial"),
    ("result_at", "", "serial"),
    ("gap", "last", "serial"),
    ("head", "updated_unix_ms", "url"),
];

/// Statements that make tables and views, where they are not there yet; each ends with `;` at the
/// end of a line. Those of a cluster are of the database `plant`: ClickHouse 18.16 works
/// `currentDatabase()` out again when it starts, and then there is none.
pub fn schema(kind: Kind) -> String {
    let (mut all, views, starts) = match kind {
        Kind::Sqlite => (
            include_str!("sql/sqlite/tables.sql").to_owned(),
            include_str!("sql/sqlite/views.sql"),
            ["at - at % 3600", "at - at % 86400"],
        ),
        _ => (
            of_servers(kind == Kind::Cluster),
            include_str!("sql/clickhouse/views.sql"),
            ["toStartOfHour(at)", "toDate(at)"],
        ),
    };
    for statement in views.split_inclusive(";\n") {
        if !statement.contains("$period") {
            all += statement;
            continue;
        }
        for (period, start) in ["hour", "day"].into_iter().zip(starts) {
            let statement = statement.replace("$period", period);
            all += &statement.replace("$start", start);
        }
    }
    all
}

fn of_servers(cluster: bool) -> String {
    let mut tables = include_str!("sql/clickhouse/tables.sql").to_owned();
    for (name, version, key) in TABLES {
        let place = format!("'/clickhouse/tables/{{shard}}/{name}', '{{replica}}'");
        let engine = match (cluster, version) {
            (true, "") => format!("ReplicatedReplacingMergeTree({place})"),
            (true, _) => format!("ReplicatedReplacingMergeTree({place}, {version})"),
            (false, _) => format!("ReplacingMergeTree({version})"),
        };
        tables = tables.replace(
            &format!("ENGINE = ${name} "),
            &format!("ENGINE = {engine} "),
        );
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
pub(super) fn statements(schema: &str) -> Vec<String> {
    let lines = schema.lines();
    let code = lines.filter(|line| !line.trim_start().starts_with("--"));
    let code = code.collect::<Vec<_>>().join("\n") + "\n";
    let statements = code.split_terminator(";\n");
    statements
        .map(|statement| statement.trim().to_owned())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_mark_is_left_in_a_schema_and_every_kind_has_the_same_views() {
        let views = |kind| {
            let statements = statements(&schema(kind));
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
