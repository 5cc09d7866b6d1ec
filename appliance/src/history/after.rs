//! Stored results in the order of SEQ, page by page, for programs that collect them.

use super::entry::Entry;
use super::reader::{Reader, read, rows};
use super::{HistoryError, HistoryResult};
use rusqlite::{Connection, Transaction};
use std::path::PathBuf;

/// Results of a page: what is in memory of an answer, whatever its length.
const PAGE: usize = 64;
/// Memory of a connection for the database's pages, KiB: several readers at a time must not cost
/// what SQLite takes otherwise, 2 MiB each.
const CACHE: i64 = 256;

/// A walk through the results behind a SEQ. Between two pages nothing of the database is held, so
/// that its log does not grow while a client is slow.
pub struct After {
    connection: Connection,
    path: PathBuf,
    id: String,
    /// The last SEQ that is behind the reader.
    seq: u32,
    /// Results that may still be read.
    left: usize,
    /// The newest SEQ when the walk began, at which it ends; none before its first page.
    last: Option<u32>,
}

/// Some results, oldest first.
pub struct Page {
    /// The oldest SEQ that is kept; none in an empty history.
    pub first: Option<u32>,
    /// The newest.
    pub last: Option<u32>,
    /// The results; empty at the end.
    pub results: Vec<Entry>,
}

impl Reader {
    /// Begins behind `seq`; at most `limit` results follow.
    ///
    /// # Errors
    /// As [`Self::results`].
    pub fn after(&self, seq: u32, limit: usize) -> HistoryResult<After> {
        let connection = self.open()?;
        let failed = |error: rusqlite::Error| HistoryError::of(self.path(), &error);
        let sized = connection.pragma_update(None, "cache_size", -CACHE);
        sized.map_err(failed)?;
        let id = connection.query_row("SELECT id FROM history", (), |row| row.get(0));
        Ok(After {
            id: id.map_err(failed)?,
            connection,
            path: self.path().to_path_buf(),
            seq,
            left: limit,
            last: None,
        })
    }
}

impl After {
    /// Which history it is: [`Reader::id`].
    pub fn id(&self) -> &str {
        &self.id
    }

    /// The next page; the first says where the walk ends. Where results that are next were deleted
    /// meanwhile, the walk ends early, so that the first page of another one shows what is missing.
    ///
    /// # Errors
    /// As [`Reader::results`].
    pub fn page(&mut self) -> HistoryResult<Page> {
        // A transaction, so that limits and results are of one state of the history.
        let transaction = self.connection.unchecked_transaction();
        let most = self.left.min(PAGE);
        let page = transaction.and_then(|transaction| {
            let mut page = bounds(&transaction)?;
            let gone = page
                .first
                .is_some_and(|first| first > self.seq.saturating_add(1));
            if self.last.is_none() || !gone {
                let last = self.last.or(page.last).unwrap_or(0);
                page.results = behind(&transaction, self.seq, last, most)?;
            }
            Ok(page)
        });
        let page = page.map_err(|error| HistoryError::of(&self.path, &error))?;
        self.last = self.last.or(page.last);
        self.left -= page.results.len();
        self.seq = page.results.last().map_or(self.seq, |entry| entry.seq);
        Ok(page)
    }
}

fn bounds(transaction: &Transaction<'_>) -> rusqlite::Result<Page> {
    let query = "SELECT (SELECT min(seq) FROM result), (SELECT max(seq) FROM result)";
    transaction.query_row(query, (), |row| {
        Ok(Page {
            first: row.get(0)?,
            last: row.get(1)?,
            results: Vec::new(),
        })
    })
}

fn behind(
    connection: &Connection,
    seq: u32,
    last: u32,
    most: usize,
) -> rusqlite::Result<Vec<Entry>> {
    let query = "SELECT * FROM dated WHERE seq > ?1 AND seq <= ?2 ORDER BY seq LIMIT ?3";
    let bounds = (seq, last, most);
    rows(connection, query, bounds, |row| read(connection, row))
}
