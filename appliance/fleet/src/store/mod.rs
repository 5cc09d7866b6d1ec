//! Where results go. Writing a row again changes nothing, so nobody must know what was written
//! before a kill.

mod clickhouse;
mod schema;
mod sqlite;

pub use schema::{Kind, schema};

use crate::answer::Row;
use crate::error::{Exit, Failure, Result};
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
        let of = |sql: &str| sql.replace("$since", &since.to_string());
        let lines = match self {
            Self::Sqlite(store) => store.lines(&of(sqlite)),
            Self::ClickHouse(store) => store.lines(&of(clickhouse)).await,
        }?;
        let read = |line: &str| serde_json::from_str(line);
        let rows = lines.lines().map(read).collect::<Result<_, _>>();
        rows.map_err(|error| format!("read an answer of the store: {error}"))
    }
}
