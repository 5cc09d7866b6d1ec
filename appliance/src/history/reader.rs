//! Reads the history for the page and the command line. Nothing here can change it.

use super::entry::{Entry, Filter, GaugeEntry};
use super::{HistoryError, HistoryResult, schema};
use crate::station::{Counts, Verdict};
use rusqlite::types::Value;
use rusqlite::{Connection, OptionalExtension as _, Params, Row, params_from_iter};
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

/// Results that are read from the database at a time.
const BATCH: usize = 256;

/// Reads one history. Cheap to clone; each call opens the database, so that it also sees a new one
/// that was begun in place of one that cannot be used. Every call blocks.
#[derive(Clone, Debug)]
pub struct Reader {
    path: PathBuf,
    recordings: PathBuf,
}

/// The last values of one gauge.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Trend {
    /// The gauge's name.
    pub name: String,
    /// The unit's symbol.
    pub unit: String,
    /// The latest lower limit.
    pub low: Option<f64>,
    /// The latest upper limit.
    pub high: Option<f64>,
    /// Oldest first.
    pub points: Vec<TrendPoint>,
}

/// One value of a gauge.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct TrendPoint {
    /// RESULT_SEQ.
    pub seq: u32,
    /// None if it could not be measured.
    pub value: Option<f64>,
    /// 1 σ.
    pub sigma: Option<f64>,
    /// The bits of registers 1116–1179.
    pub decision: u16,
}

impl Reader {
    /// A reader of the history in a state folder; nothing is opened yet.
    pub fn of(state: &Path) -> Self {
        Self {
            path: state.join(super::DATABASE),
            recordings: state.join(super::RECORDINGS),
        }
    }

    /// The database.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// A new name for a temporary folder; what a kill leaves of it, the next start removes.
    pub fn scratch(&self) -> PathBuf {
        static COUNT: AtomicU64 = AtomicU64::new(0);
        let count = COUNT.fetch_add(1, Ordering::Relaxed);
        self.recordings.join(format!(".page.partial-{count}"))
    }

    pub(super) fn open(&self) -> HistoryResult<Connection> {
        if !self.path.exists() {
            return Err(HistoryError {
                path: self.path.clone(),
                reason: "it does not exist: the station begins it at its first start".into(),
                aside: None,
            });
        }
        schema::open_read_only(&self.path)
    }

    /// Opens the database for one piece of `work`.
    pub(super) fn read<T>(
        &self,
        work: impl FnOnce(&Connection) -> rusqlite::Result<T>,
    ) -> HistoryResult<T> {
        work(&self.open()?).map_err(|error| HistoryError::of(&self.path, &error))
    }

    /// Which history it is: 32 hexadecimal digits, random for each database.
    ///
    /// # Errors
    /// As [`Self::results`].
    pub fn id(&self) -> HistoryResult<String> {
        let query = "SELECT id FROM history";
        self.read(|connection| connection.query_row(query, (), |row| row.get(0)))
    }

    /// The results that pass the filter, newest first.
    ///
    /// # Errors
    /// [`HistoryError`] if the database is missing, busy for seconds, damaged, or of another
    /// version.
    pub fn results(&self, filter: &Filter) -> HistoryResult<Vec<Entry>> {
        let mut all = Vec::new();
        self.each(filter, |entry| {
            all.push(entry);
            Ok(())
        })?;
        Ok(all)
    }

    /// The newest result with this SEQ.
    ///
    /// # Errors
    /// As [`Self::results`].
    pub fn result(&self, seq: u32) -> HistoryResult<Option<Entry>> {
        self.first(
            "SELECT * FROM dated WHERE seq = ?1 ORDER BY id DESC LIMIT 1",
            seq,
        )
    }

    /// The result of a request by the API.
    ///
    /// # Errors
    /// As [`Self::results`].
    pub fn requested(&self, token: &str) -> HistoryResult<Option<Entry>> {
        self.first(
            "SELECT * FROM dated WHERE request = ?1 ORDER BY id DESC LIMIT 1",
            token,
        )
    }

    /// The result whose frames are kept under this name.
    ///
    /// # Errors
    /// As [`Self::results`].
    pub fn recorded_as(&self, name: &str) -> HistoryResult<Option<Entry>> {
        self.first(
            "SELECT * FROM dated WHERE recording = ?1 ORDER BY id DESC LIMIT 1",
            name,
        )
    }

    fn first(&self, query: &str, key: impl rusqlite::ToSql) -> HistoryResult<Option<Entry>> {
        self.read(|connection| {
            let found = connection.query_row(query, [key], |row| read(connection, row));
            found.optional()
        })
    }

    /// Where the frames of a result are kept, if they are.
    ///
    /// # Errors
    /// As [`Self::results`].
    pub fn recording(&self, seq: u32) -> HistoryResult<Option<PathBuf>> {
        let found = self.result(seq)?.and_then(|entry| entry.recording);
        Ok(found.map(|name| self.recordings.join(name)))
    }

    /// Hands each result that passes the filter to `take`, newest first; stops at its first error.
    /// Results are read in batches and nothing of the database is held between them, so that its
    /// log does not grow while `take` is slow.
    pub(super) fn each(
        &self,
        filter: &Filter,
        mut take: impl FnMut(Entry) -> HistoryResult<()>,
    ) -> HistoryResult<()> {
        let connection = self.open()?;
        let (condition, values) = condition(filter);
        let query =
            format!("SELECT * FROM dated WHERE {condition} AND id < ? ORDER BY id DESC LIMIT ?");
        let mut below = i64::MAX;
        let mut left = filter.limit;
        while left > 0 {
            let most = left.min(BATCH);
            let bounds = [Value::from(below), Value::from(most as i64)];
            let values = params_from_iter(values.iter().cloned().chain(bounds));
            let batch = rows(&connection, &query, values, |row| {
                Ok((row.get("id")?, read(&connection, row)?))
            });
            let batch: Vec<(i64, Entry)> =
                batch.map_err(|error| HistoryError::of(&self.path, &error))?;
            left = if batch.len() < most { 0 } else { left - most };
            for (id, entry) in batch {
                below = id;
                take(entry)?;
            }
        }
        Ok(())
    }

    /// How many results of each verdict pass the filter; its limit does not count.
    ///
    /// # Errors
    /// As [`Self::results`].
    pub fn counts(&self, filter: &Filter) -> HistoryResult<Counts> {
        let (condition, values) = condition(filter);
        let query =
            format!("SELECT verdict, count(*) FROM dated WHERE {condition} GROUP BY verdict");
        let counted: Vec<(Verdict, u64)> = self.read(|connection| {
            let values = params_from_iter(values);
            rows(connection, &query, values, |row| {
                Ok((row.get(0)?, row.get(1)?))
            })
        })?;
        let mut counts = Counts::default();
        for (verdict, count) in counted {
            counts.add(verdict, count);
        }
        Ok(counts)
    }

    /// How many results a filter by time leaves out because it is not known when they were; 0 for
    /// one that asks for no time.
    ///
    /// # Errors
    /// As [`Self::results`].
    pub fn undated(&self, filter: &Filter) -> HistoryResult<u64> {
        self.read(|connection| undated(connection, filter))
    }

    /// When starts of the daemon were, in µs since 1970 UTC by the clock of a signed-in user's
    /// browser, by BOOT_ID.
    ///
    /// # Errors
    /// As [`Self::results`].
    pub fn starts(&self) -> HistoryResult<BTreeMap<String, u64>> {
        let query = "SELECT boot_id, browser_utc_us FROM start";
        self.read(|connection| rows(connection, query, (), |row| Ok((row.get(0)?, row.get(1)?))))
    }

    /// The gauges of a recipe over its last results, in the order in which the newest of them has
    /// them.
    ///
    /// # Errors
    /// As [`Self::results`].
    pub fn trends(&self, recipe: u16, last: usize) -> HistoryResult<Vec<Trend>> {
        let filter = Filter {
            recipe: Some(recipe),
            limit: last,
            ..Filter::default()
        };
        let mut trends: Vec<Trend> = Vec::new();
        self.each(&filter, |entry| {
            for gauge in entry.gauges {
                let known = trends.iter().position(|trend| trend.name == gauge.name);
                let at = known.unwrap_or_else(|| {
                    trends.push(Trend {
                        name: gauge.name,
                        unit: gauge.unit,
                        low: gauge.low,
                        high: gauge.high,
                        points: Vec::new(),
                    });
                    trends.len() - 1
                });
                trends[at].points.push(TrendPoint {
                    seq: entry.seq,
                    value: gauge.value,
                    sigma: gauge.sigma,
                    decision: gauge.decision,
                });
            }
            Ok(())
        })?;
        for trend in &mut trends {
            trend.points.reverse();
        }
        Ok(trends)
    }

    /// The pattern fitness of a recipe's last measured results, oldest first: SEQ and ‰.
    ///
    /// # Errors
    /// As [`Self::results`].
    pub fn fitness(&self, recipe: u16, last: usize) -> HistoryResult<Vec<(u32, u16)>> {
        let query = "SELECT seq, fitness_permille FROM result
            WHERE recipe = ?1 AND error_code = 0 ORDER BY id DESC LIMIT ?2";
        let mut points: Vec<_> = self.read(|connection| {
            let read = |row: &Row<'_>| Ok((row.get(0)?, row.get(1)?));
            rows(connection, query, (recipe, last), read)
        })?;
        points.reverse();
        Ok(points)
    }
}

/// [`Reader::undated`] of a state of the history.
pub(super) fn undated(connection: &Connection, filter: &Filter) -> rusqlite::Result<u64> {
    if filter.since_us.is_none() && filter.until_us.is_none() {
        return Ok(0);
    }
    let any_time = Filter {
        since_us: None,
        until_us: None,
        before_seq: None,
        ..filter.clone()
    };
    let (condition, values) = condition(&any_time);
    let query = format!(
        "SELECT count(*) FROM dated WHERE {condition} AND coalesce(time_utc_us, browser_utc_us) IS NULL"
    );
    connection.query_row(&query, params_from_iter(values), |row| row.get(0))
}

/// The result of a row of the view `dated`, with its gauges.
pub(super) fn read(connection: &Connection, row: &Row<'_>) -> rusqlite::Result<Entry> {
    let id: i64 = row.get("id")?;
    let of_result = "SELECT * FROM gauge WHERE result = ?1 ORDER BY place";
    Ok(Entry {
        browser_utc_us: row.get("browser_utc_us")?,
        gauges: rows(connection, of_result, [id], gauge)?,
        ..Entry::read(row)?
    })
}

fn gauge(row: &Row<'_>) -> rusqlite::Result<GaugeEntry> {
    let place: u16 = row.get("place")?;
    Ok(GaugeEntry {
        slot: place.saturating_add(1),
        ..GaugeEntry::read(row)?
    })
}

/// The rows that a query finds.
pub(super) fn rows<T, All: FromIterator<T>>(
    connection: &Connection,
    query: &str,
    values: impl Params,
    read: impl FnMut(&Row<'_>) -> rusqlite::Result<T>,
) -> rusqlite::Result<All> {
    let mut statement = connection.prepare_cached(query)?;
    statement.query_map(values, read)?.collect()
}

/// The condition of a filter in SQL, and the values of its question marks.
pub(super) fn condition(filter: &Filter) -> (String, Vec<Value>) {
    let mut conditions = vec!["1"];
    let mut values = Vec::new();
    let mut add = |condition, value: Option<i64>| {
        if let Some(value) = value {
            conditions.push(condition);
            values.push(Value::from(value));
        }
    };
    let time = |us: Option<u64>| us.map(|us| i64::try_from(us).unwrap_or(i64::MAX));
    add("recipe = ?", filter.recipe.map(i64::from));
    let verdict = filter.verdict.map(|verdict| i64::from(verdict.number()));
    add("verdict = ?", verdict);
    add("part_id = ?", filter.part_id.map(i64::from));
    add(
        "coalesce(time_utc_us, browser_utc_us) >= ?",
        time(filter.since_us),
    );
    add(
        "coalesce(time_utc_us, browser_utc_us) < ?",
        time(filter.until_us),
    );
    add("press_stroke >= ?", filter.from_stroke.map(i64::from));
    add("press_stroke <= ?", filter.to_stroke.map(i64::from));
    add("seq >= ?", filter.from_seq.map(i64::from));
    add("seq <= ?", filter.to_seq.map(i64::from));
    let before = "id < (SELECT min(id) FROM result WHERE seq = ?)";
    add(before, filter.before_seq.map(i64::from));
    (conditions.join(" AND "), values)
}
