//! The results of a period, whatever they measured, and the columns of its axis.

use super::parts::{InvalidReason, RecipeVersion, ResultStatistics, StatisticsRequest};
use crate::history::reader::{condition, undated};
use crate::station::Verdict;
use rusqlite::{Connection, params_from_iter};
use std::collections::{BTreeMap, HashSet};

/// Reasons that are listed; the rest is summed up.
const REASONS: usize = 12;

/// The columns of an axis.
pub(super) struct AxisColumns {
    from: i64,
    /// Places of a column.
    width: f64,
    pub columns: usize,
}

impl AxisColumns {
    pub fn column(&self, x: Option<i64>) -> Option<usize> {
        let at = (x? - self.from) as f64 / self.width;
        (at >= 0.0).then_some((at as usize).min(self.columns - 1))
    }
}

/// The results of a period, and the columns of the axis.
pub(super) fn results(
    connection: &Connection,
    asked: &StatisticsRequest,
    of_studies: &HashSet<u32>,
) -> rusqlite::Result<(ResultStatistics, AxisColumns)> {
    let (condition, values) = condition(&asked.filter);
    let x = asked.axis.expression();
    let bounds = format!("SELECT min({x}), max({x}) FROM dated WHERE {condition}");
    let (from, to): (Option<i64>, Option<i64>) =
        connection.query_row(&bounds, params_from_iter(&values), |row| {
            Ok((row.get(0)?, row.get(1)?))
        })?;
    let span = from
        .zip(to)
        .map_or(1, |(from, to)| to.saturating_sub(from).saturating_add(1));
    let columns = asked.columns.min(usize::try_from(span).unwrap_or(1)).max(1);
    let axis_columns = AxisColumns {
        from: from.unwrap_or(0),
        width: span as f64 / columns as f64,
        columns,
    };
    let mut found = ResultStatistics {
        axis: asked.axis,
        from,
        to,
        undated: undated(connection, &asked.filter)?,
        columns: vec![[0; 3]; columns],
        ..ResultStatistics::default()
    };
    let invalid = Verdict::Invalid.number();
    let query = format!(
        "SELECT seq, {x}, verdict, fingerprint, CASE verdict WHEN {invalid} THEN coalesce(reason, '') END
         FROM dated WHERE {condition} ORDER BY id"
    );
    let mut statement = connection.prepare(&query)?;
    let mut rows = statement.query(params_from_iter(&values))?;
    let mut reasons = BTreeMap::<String, u64>::new();
    let mut version = String::new();
    while let Some(row) = rows.next()? {
        let (seq, x): (u32, Option<i64>) = (row.get(0)?, row.get(1)?);
        let fingerprint = row.get_ref(3)?.as_str()?;
        if version != fingerprint {
            if !version.is_empty() {
                let fingerprint = fingerprint.to_owned();
                found.versions.push(RecipeVersion {
                    seq,
                    x,
                    fingerprint,
                });
            }
            version.clear();
            version.push_str(fingerprint);
        }
        if of_studies.contains(&seq) {
            found.of_studies += 1;
            continue;
        }
        let verdict: Verdict = row.get(2)?;
        found.counts.add(verdict, 1);
        let column = axis_columns.column(x);
        found.off_axis += u64::from(column.is_none());
        let place = usize::from(verdict.number()).checked_sub(1);
        if let Some((column, place)) = column.zip(place) {
            found.columns[column][place] += 1;
        }
        if let Some(reason) = row.get_ref(4)?.as_str_or_null()? {
            *reasons.entry(without_numbers(reason)).or_default() += 1;
        }
    }
    let mut reasons: Vec<_> = reasons.into_iter().collect();
    reasons.sort_by_key(|(_, n)| std::cmp::Reverse(*n));
    let rest: u64 = reasons.iter().skip(REASONS).map(|(_, n)| n).sum();
    reasons.truncate(REASONS);
    reasons.extend((rest > 0).then(|| ("other reasons".to_owned(), rest)));
    let listed = |(reason, n)| InvalidReason { reason, n };
    found.reasons = reasons.into_iter().map(listed).collect();
    Ok((found, axis_columns))
}

/// Words with "…" for each number, so that reasons that differ in their numbers are one.
fn without_numbers(words: &str) -> String {
    let mut text = String::with_capacity(words.len());
    let mut letters = words.chars().peekable();
    while let Some(letter) = letters.next() {
        if !letter.is_ascii_digit() {
            text.push(letter);
            continue;
        }
        text.push('…');
        while letters
            .next_if(|next| next.is_ascii_digit() || *next == '.')
            .is_some()
        {}
    }
    text
}
