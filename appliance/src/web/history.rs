//! Stored results: lists, trends, CSV, and one result in full with the frames and pictures of its part,
//! where they were kept.
//!
//! Pictures are computed from the recording by the code that makes those of the last part. That takes
//! as much memory as a recipe, so it is done for one part at a time, on threads with a lower priority
//! than the measuring task.

use super::downloads::{Download, Packed, send, unpacked};
use super::look::{Level, found, map_of, place_of};
use super::map::Map;
use super::problem::{Answered, Problem};
use super::request::{Path, Query};
use super::site::{LastKept, Site};
use crate::error::{Exit, Failure};
use crate::history::kept::Kept;
use crate::history::{Entry, Filter, HistoryError, why_no_frames};
use crate::recipe::plan::{Layers, Plan};
use crate::station::Verdict;
use crate::station::result::flag;
use crate::system::computing;
use axum::response::{Json, Response};
use serde::Deserialize;
use serde_json::{Value, json};
use std::path::PathBuf;
use std::sync::Arc;
use tokio::sync::OwnedMutexGuard;
use tokio::task::{JoinError, spawn_blocking};

/// Results of one answer, unless it asks for fewer.
const PAGE: usize = 100;
const MAX_PAGE: usize = 1000;
/// Values of a trend.
const TREND: usize = 100;

impl From<Failure> for Problem {
    fn from(failure: Failure) -> Self {
        match failure.exit {
            Exit::Missing => Self::missing(failure),
            _ => Self::broken(failure),
        }
    }
}

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
    from_stroke: Option<u32>,
    to_stroke: Option<u32>,
    from_seq: Option<u32>,
    to_seq: Option<u32>,
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
            from_stroke: self.from_stroke,
            to_stroke: self.to_stroke,
            from_seq: self.from_seq,
            to_seq: self.to_seq,
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

/// Why a kept part cannot be worked out.
const OTHER_FRAMES: &str = "the recording's frames are not those of its recipe";

/// One result in full, with its flags in words and why there are no frames.
pub(super) async fn one(site: Site, Path(seq): Path<u32>) -> Answered<Json<Value>> {
    let found = site.aside(move |site| {
        let entry = site.history.result(seq)?;
        let entry = entry.ok_or_else(|| unknown(seq))?;
        let flags = flag::words(entry.flags).collect::<Vec<_>>();
        Ok(json!({ "result": entry, "flags": flags, "no_frames": why_no_frames(&entry) }))
    });
    found.await.map(Json)
}

pub(super) fn unknown(seq: u32) -> Problem {
    Problem::missing(format!("there is no result {seq} in the history"))
}

pub(super) async fn picture(
    site: Site,
    Path((seq, layer)): Path<(u32, String)>,
    Query(level): Query<Level>,
) -> Answered<Map> {
    let at = place_of(&layer)?;
    // Waiting here takes no thread from other requests.
    let last = site.kept.clone().lock_owned().await;
    let worked = spawn_blocking(move || map_of(&*layers(&site, last, seq)?, at, seq, level));
    worked.await.map_err(failed)?
}

/// The maps of a kept part; those that were worked out `last` are not worked out again.
pub(super) fn layers(
    site: &Site,
    mut last: OwnedMutexGuard<LastKept>,
    seq: u32,
) -> Answered<Arc<Layers>> {
    if let Some((of, layers)) = &*last
        && *of == seq
    {
        return Ok(layers.clone());
    }
    *last = None;
    let layers = judged(site, seq, |_, plan, sequence, kept| {
        plan.layers(sequence, &kept.frames())
    })?;
    let layers = Arc::new(layers.ok_or_else(|| Problem::broken(OTHER_FRAMES))?);
    *last = Some((seq, layers.clone()));
    Ok(layers)
}

/// What was found on a kept part.
pub(super) async fn features(site: Site, Path(seq): Path<u32>) -> Answered<Json<Value>> {
    // One part at a time, as for pictures.
    let place = site.kept.clone().lock_owned().await;
    let worked = spawn_blocking(move || {
        let _place = place;
        judged(&site, seq, |entry, plan, sequence, kept| {
            let (_, features) = plan.look(sequence, &kept.frames());
            found(seq, entry.verdict, plan.id(), &features)
        })
    });
    worked.await.map_err(failed)?.map(Json)
}

pub(super) fn failed(_: JoinError) -> Problem {
    Problem::broken("working it out failed; see the log")
}

/// The entry of a kept part, and the folder with its frames.
pub(super) fn kept_frames(site: &Site, seq: u32) -> Answered<(Entry, PathBuf)> {
    let entry = site.history.result(seq)?.ok_or_else(|| unknown(seq))?;
    if let Some(words) = why_no_frames(&entry) {
        let words = format!("the frames of result {seq} are not kept: {words}");
        return Err(Problem::missing(words));
    }
    let folder = site.history.recording(seq)?.ok_or_else(|| unknown(seq))?;
    Ok((entry, folder))
}

/// Threads that work out the maps of a part.
const LOOKING: usize = 2;

/// Works on threads that give way to the measuring task.
pub(super) fn looking_back<T: Send>(work: impl FnOnce() -> Answered<T> + Send) -> Answered<T> {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(LOOKING)
        .thread_name(|_| "looking-back".into())
        .start_handler(|_| computing::give_way())
        .build()
        .map_err(|error| Problem::broken(format!("start a thread: {error}: free memory")))?;
    pool.install(work)
}

/// Works on the frames of a kept part and the plan that judged it.
fn judged<T: Send>(
    site: &Site,
    seq: u32,
    work: impl FnOnce(&Entry, &Plan, usize, &Kept) -> T + Send,
) -> Answered<T> {
    let (entry, folder) = kept_frames(site, seq)?;
    looking_back(|| {
        let kept = Kept::open(&folder)?;
        let (recipe, _) = kept.recipe(&site.recipes)?;
        let plan = kept.plan(recipe, false);
        let plan = plan.map_err(Problem::broken)?;
        let sequence = plan.sequence_of(&kept.shots());
        let sequence = sequence.ok_or_else(|| Problem::broken(OTHER_FRAMES))?;
        Ok(work(&entry, &plan, sequence, &kept))
    })
}
