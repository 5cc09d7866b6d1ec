//! One stored result in full, and the pictures of its part where the frames were kept.
//!
//! Pictures are computed from the recording by the code that makes those of the last part. That
//! takes as much memory as a recipe, so it is done for one part at a time, on a thread with a lower
//! priority than the measuring task.

use std::path::PathBuf;
use std::sync::Arc;

use axum::response::Json;
use serde_json::{Value, json};
use tokio::task::{JoinError, spawn_blocking};

use super::look::{Level, found, map_of, place_of};
use super::map::Map;
use super::problem::{Answered, Problem};
use super::query::{Path, Query};
use super::site::Site;
use crate::error::{Exit, Failure};
use crate::history::kept::Kept;
use crate::history::{Entry, why_no_frames};
use crate::recipe::plan::Plan;
use crate::station::result::flag;
use crate::system::priority;

const OTHER_FRAMES: &str = "the recording's frames are not those of its recipe";

pub(super) async fn one(site: Site, Path(seq): Path<u32>) -> Answered<Json<Value>> {
    let found = site.aside(move |site| {
        let entry = site.history.result(seq)?;
        let entry = entry.ok_or_else(|| unknown(seq))?;
        let flags = flag::words(entry.flags).collect::<Vec<_>>();
        Ok(json!({ "result": entry, "flags": flags, "no_frames": why_no_frames(&entry) }))
    });
    found.await.map(Json)
}

fn unknown(seq: u32) -> Problem {
    Problem::missing(format!("there is no result {seq} in the history"))
}

pub(super) async fn picture(
    site: Site,
    Path((seq, layer)): Path<(u32, String)>,
    Query(level): Query<Level>,
) -> Answered<Map> {
    let at = place_of(&layer)?;
    // Waiting here takes no thread from other requests.
    let mut last = site.kept.clone().lock_owned().await;
    let worked = spawn_blocking(move || {
        if last.as_ref().is_none_or(|(of, _)| *of != seq) {
            *last = None;
            let layers = judged(&site, seq, |_, plan, sequence, kept| {
                plan.layers(sequence, &kept.frames())
            })?;
            let layers = layers.ok_or_else(|| Problem::broken(OTHER_FRAMES))?;
            *last = Some((seq, Arc::new(layers)));
        }
        let (_, layers) = last.as_ref().ok_or_else(|| Problem::broken(OTHER_FRAMES))?;
        map_of(layers, at, seq, level)
    });
    worked.await.map_err(failed)?
}

/// What was found on a kept part.
pub(super) async fn features(site: Site, Path(seq): Path<u32>) -> Answered<Json<Value>> {
    // One part at a time, as for pictures.
    let place = site.kept.clone().lock_owned().await;
    let worked = spawn_blocking(move || {
        let _place = place;
        judged(&site, seq, |entry, plan, sequence, kept| {
            let (_, features) = plan.look(sequence, &kept.frames());
            found((seq, entry.verdict), (plan.id(), &features))
        })
    });
    worked.await.map_err(failed)?.map(Json)
}

fn failed(_: JoinError) -> Problem {
    Problem::broken("working it out failed; see the log")
}

/// The entry of a kept part, and the folder with its frames.
pub(super) fn recording(site: &Site, seq: u32) -> Answered<(Entry, PathBuf)> {
    let entry = site.history.result(seq)?.ok_or_else(|| unknown(seq))?;
    if let Some(words) = why_no_frames(&entry) {
        let words = format!("the frames of result {seq} are not kept: {words}");
        return Err(Problem::missing(words));
    }
    let folder = site.history.recording(seq)?.ok_or_else(|| unknown(seq))?;
    Ok((entry, folder))
}

/// Does something with the frames of a kept part and the plan that judged it.
fn judged<T: Send>(
    site: &Site,
    seq: u32,
    work: impl FnOnce(&Entry, &Plan, usize, &Kept) -> T + Send,
) -> Answered<T> {
    let (entry, folder) = recording(site, seq)?;
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .thread_name(|_| "looking-back".into())
        .start_handler(|_| priority::give_way())
        .build()
        .map_err(|error| Problem::broken(format!("start a thread: {error}: free memory")))?;
    pool.install(|| {
        let kept = Kept::open(&folder).map_err(broken)?;
        let (recipe, _) = kept.recipe(&site.recipes).map_err(broken)?;
        let plan = kept.plan(recipe, false);
        let plan = plan.map_err(Problem::broken)?;
        let sequence = plan.sequence_of(&kept.shots());
        let sequence = sequence.ok_or_else(|| Problem::broken(OTHER_FRAMES))?;
        Ok(work(&entry, &plan, sequence, &kept))
    })
}

pub(super) fn broken(failure: Failure) -> Problem {
    match failure.exit {
        Exit::Missing => Problem::missing(failure.to_string()),
        _ => Problem::broken(failure.to_string()),
    }
}
