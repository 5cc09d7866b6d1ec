//! Stored results: lists, trends, CSV and the frames that were kept.

use axum::response::{Json, Response};
use serde::Deserialize;
use serde_json::{Value, json};

use super::downloads::{Download, Packed, send, unpacked};
use super::problem::{Answered, Problem};
use super::query::{Path, Query};
use super::site::Site;
use crate::history::{Filter, HistoryError};
use crate::station::Verdict;

/// Results of one answer, unless it asks for fewer.
const PAGE: usize = 100;
const MAX_PAGE: usize = 1000;
/// Values of a trend.
const TREND: usize = 100;

impl From<HistoryError> for Problem {
    fn from(error: HistoryError) -> Self {
        Self::broken(error)
    }
}

/// The query of a request for results.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ResultsQuery {
    recipe: Option<u16>,
    verdict: Option<String>,
    part_id: Option<u32>,
    since_us: Option<u64>,
    until_us: Option<u64>,
    before_seq: Option<u32>,
    limit: Option<usize>,
}

impl ResultsQuery {
    /// The filter, of the `usual` number of results unless asked for another one, and at `most`
    /// that many.
    fn filter(self, usual: usize, most: usize) -> Answered<Filter> {
        let judged = |word: String| {
            let words = format!("verdict={word}: write PASS, FAIL or INVALID");
            Verdict::of_word(&word).ok_or_else(|| Problem::unclear(words))
        };
        let verdict = self.verdict.map(judged).transpose()?;
        Ok(Filter {
            recipe: self.recipe,
            verdict,
            part_id: self.part_id,
            since_us: self.since_us,
            until_us: self.until_us,
            before_seq: self.before_seq,
            limit: self.limit.unwrap_or(usual).min(most),
        })
    }
}

pub(super) async fn list(site: Site, Query(wanted): Query<ResultsQuery>) -> Answered<Json<Value>> {
    let filter = wanted.filter(PAGE, MAX_PAGE)?;
    let found = site.aside(move |site| {
        let results = site.history.results(&filter)?;
        // Counts are of the whole list, also where the request is for its next page.
        let whole = Filter {
            before_seq: None,
            ..filter
        };
        let (counts, undated) = (site.history.counts(&whole)?, site.history.undated(&whole)?);
        Ok(json!({ "results": results, "counts": counts, "undated": undated }))
    });
    found.await.map(Json)
}

/// The most results of one CSV, so that it fits into memory.
const MAX_CSV: usize = 20_000;

pub(super) async fn csv(site: Site, Query(wanted): Query<ResultsQuery>) -> Answered<Response> {
    let filter = wanted.filter(MAX_CSV, MAX_CSV)?;
    send(&site, "text/csv; charset=utf-8", move |site| {
        let mut bytes = Vec::new();
        site.history.csv(&filter, &mut bytes)?;
        Ok(("history.csv".into(), Download::Bytes(bytes)))
    })
    .await
}

pub(super) async fn recording(site: Site, Path(seq): Path<u32>) -> Answered<Response> {
    send(&site, "application/zip", move |site| {
        let words = format!("the frames of result {seq} were not kept");
        let kept = site.history.recording(seq)?;
        let kept = kept.filter(|folder| folder.is_dir());
        let kept = kept.ok_or_else(|| Problem::missing(words))?;
        let name = kept.file_name().unwrap_or_default().to_string_lossy();
        let packed = Packed::of(&kept, name.into_owned());
        let packed = packed.map_err(|error| Problem::broken(unpacked(error)))?;
        Ok((format!("{seq}-recording.zip"), Download::Folder(packed)))
    })
    .await
}

/// The last values of each gauge of the active recipe.
pub(super) async fn trends(site: Site) -> Answered<Json<Value>> {
    let active = site.station.snapshot().active();
    let recipe = active.ok_or_else(|| Problem::missing("no recipe is active: load one"))?;
    let read = site.aside(move |site| {
        let gauges = site.history.trends(recipe, TREND)?;
        let fitness = site.history.fitness(recipe, TREND)?;
        Ok(json!({ "recipe": recipe, "gauges": gauges, "fitness": fitness }))
    });
    read.await.map(Json)
}
