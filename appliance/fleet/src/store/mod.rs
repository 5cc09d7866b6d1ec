//! Where results go: the kinds of store, their tables and views, and what is written and asked.
//! Writing a row again changes nothing, so a collector needs no memory of what was written before a
//! kill.

mod clickhouse;
mod sqlite;

use crate::answer::Row;
use crate::error::{Exit, Failure, Result};
use clap::ValueEnum;
use clickhouse::ClickHouse;
use rustls::ClientConfig;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use sqlite::Sqlite;
use std::sync::Arc;

const HOUR_S: u64 = 3600;

/// A row of a head, and when it was received.
#[derive(Clone, Debug)]
pub struct Received {
    /// The row.
    pub row: Row,
    /// When, ms since 1970 UTC.
    pub at_unix_ms: u64,
}

impl Received {
    /// When it was triggered, s since 1970 UTC; where the head does not know, the hour in which it was
    /// received: the time is part of a row's key, and a row that is written again is the same.
    fn at(&self) -> u64 {
        match self.row.at_unix_ms {
            Some(ms) => ms / 1000,
            None => self.at_unix_ms / 1000 / HOUR_S * HOUR_S,
        }
    }
}

/// Results that a head deleted before they were fetched.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Gap {
    /// The head.
    pub serial: String,
    /// Its history.
    pub history: String,
    /// The first SEQ that is missing.
    pub first: u32,
    /// The last.
    pub last: u32,
}

/// The last answer and the state of a head.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct HeadState {
    /// Its address.
    pub url: String,
    /// Its production line.
    pub line: String,
    /// Its serial; empty before its first answer.
    pub serial: String,
    /// Its history.
    pub history: String,
    /// The last SEQ that was fetched.
    pub seq: u32,
    /// When this was written, ms since 1970 UTC.
    pub updated_unix_ms: u64,
    /// 1 if it answered the last question.
    pub reachable: u8,
    /// Why not, in words.
    pub error: String,
    /// The station's state, in words.
    pub state: String,
    /// The active recipe.
    pub recipe: Option<u16>,
    /// Its name.
    pub recipe_name: String,
    /// Distance of projector points from their epipolar lines at the last check, px.
    pub drift_px: Option<f64>,
    /// When the last result was triggered, or received.
    pub last_result_unix_ms: Option<u64>,
}

/// What is written at a time.
#[derive(Debug, Default)]
pub struct Batch {
    /// Results.
    pub rows: Vec<Received>,
    /// Gaps.
    pub gaps: Vec<Gap>,
    /// States of heads.
    pub heads: Vec<HeadState>,
}

impl Batch {
    /// Whether there is nothing in it.
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty() && self.gaps.is_empty() && self.heads.is_empty()
    }
}

/// How far a history was fetched.
#[derive(Debug, Deserialize)]
pub struct End {
    /// The head.
    pub serial: String,
    /// Its history.
    pub history: String,
    /// The last SEQ.
    pub seq: u32,
}

/// Results of a head since a time.
#[derive(Debug, Deserialize)]
pub struct Count {
    /// The head.
    pub serial: String,
    /// All.
    pub results: u64,
    /// Those that passed.
    pub pass: u64,
    /// When the last was, s since 1970 UTC.
    pub last_at: u64,
}

/// Values of a gauge since a time.
#[derive(Debug, Deserialize)]
pub struct Spread {
    /// The head.
    pub serial: String,
    /// The gauge.
    pub name: String,
    /// Lower limit.
    pub low: Option<f64>,
    /// Upper limit.
    pub high: Option<f64>,
    /// Number of values.
    pub n: u64,
    /// Their mean.
    pub mean: f64,
    /// Their variance, of n − 1 degrees of freedom.
    pub variance: Option<f64>,
}

/// The SQL of a file for SQLite and for ClickHouse, each of whose answers is a line of JSON per row.
macro_rules! both {
    ($file:literal) => {
        [
            include_str!(concat!("sql/sqlite/", $file)),
            include_str!(concat!("sql/clickhouse/", $file)),
        ]
    };
}

/// Why a store does not do what it should, for people.
pub type Complaint = String;

/// A store.
pub enum Store {
    /// A file.
    Sqlite(Sqlite),
    /// A server, or one of a cluster.
    ClickHouse(ClickHouse),
}

impl Store {
    /// The store of a URL; nothing is opened yet.
    ///
    /// # Errors
    /// If it is no URL of a store.
    pub fn of(url: &str, tls: Option<Arc<ClientConfig>>) -> Result<Self> {
        if let Some(file) = url.strip_prefix("sqlite:") {
            if file.is_empty() {
                return Exit::Usage.fail("--store sqlite: names no file: write sqlite:plant.db");
            }
            return Ok(Self::Sqlite(Sqlite::of(file)));
        }
        let wrong = |words| Failure::new(Exit::Usage, format!("--store {url}: {words}"));
        let store = ClickHouse::of(url, tls).map_err(wrong)?;
        Ok(Self::ClickHouse(store))
    }

    /// Opens it and makes its tables and views where they are missing.
    ///
    /// # Errors
    /// In words.
    pub async fn prepare(&mut self) -> Result<(), Complaint> {
        match self {
            Self::Sqlite(store) => store.prepare(),
            Self::ClickHouse(store) => store.prepare().await,
        }
    }

    /// Why it is not the store any more that was opened.
    pub fn gone(&self) -> Option<Complaint> {
        match self {
            Self::Sqlite(store) => store.gone(),
            Self::ClickHouse(_) => None,
        }
    }

    /// Writes a batch. It may be written again.
    ///
    /// # Errors
    /// In words; part of it may be written.
    pub async fn write(&mut self, batch: &Batch) -> Result<(), Complaint> {
        match self {
            Self::Sqlite(store) => store.write(batch),
            Self::ClickHouse(store) => store.write(batch).await,
        }
    }

    /// Deletes results from before a time, s since 1970 UTC: in a file some of them each time, on a
    /// server whole months.
    ///
    /// # Errors
    /// In words.
    pub async fn forget(&mut self, before: u64) -> Result<(), Complaint> {
        match self {
            Self::Sqlite(store) => store.forget(before),
            Self::ClickHouse(store) => store.forget(before).await,
        }
    }

    /// How far each history was fetched.
    ///
    /// # Errors
    /// In words.
    pub async fn ends(&mut self) -> Result<Vec<End>, Complaint> {
        self.select(both!("ends.sql"), 0).await
    }

    /// The heads as they were written last, by their addresses.
    ///
    /// # Errors
    /// In words.
    pub async fn heads(&mut self) -> Result<Vec<HeadState>, Complaint> {
        self.select(both!("heads.sql"), 0).await
    }

    /// Results of each head since a time, s since 1970 UTC.
    ///
    /// # Errors
    /// In words.
    pub async fn counts(&mut self, since: u64) -> Result<Vec<Count>, Complaint> {
        self.select(both!("counts.sql"), since).await
    }

    /// Values of each gauge since a time, s since 1970 UTC.
    ///
    /// # Errors
    /// In words.
    pub async fn spreads(&mut self, since: u64) -> Result<Vec<Spread>, Complaint> {
        self.select(both!("spreads.sql"), since).await
    }

    /// The rows of a query, which is written for both kinds of store.
    async fn select<T: DeserializeOwned>(
        &mut self,
        [sqlite, clickhouse]: [&str; 2],
        since: u64,
    ) -> Result<Vec<T>, Complaint> {
        let filled = |sql: &str| sql.replace("$since", &since.to_string());
        let lines = match self {
            Self::Sqlite(store) => store.lines(&filled(sqlite)),
            Self::ClickHouse(store) => store.lines(&filled(clickhouse)).await,
        }?;
        let read = |line: &str| serde_json::from_str(line);
        let rows = lines.lines().map(read).collect::<Result<_, _>>();
        rows.map_err(|error| format!("read an answer of the store: {error}"))
    }
}

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
fn statements(schema: &str) -> Vec<String> {
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
