//! One stored result in full, and the pictures of its part where the frames were kept.
//!
//! Pictures are computed from the recording by the code that makes those of the last part. That
//! takes as much memory as a recipe, so it is done for one part at a time, on a thread with a lower
//! priority than the measuring task.

use axum::extract::Path;
use axum::response::Json;
use serde_json::{Value, json};

use super::look::{map_of, place_of};
use super::map::Map;
use super::problem::{Problem, Result};
use super::site::Site;
use crate::error::{Exit, Failure};
use crate::history::kept::Kept;
use crate::history::why_no_frames;
use crate::station::result::flag;
use crate::system::priority;

pub(super) async fn one(site: Site, Path(seq): Path<u32>) -> Result<Json<Value>> {
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

pub(super) async fn picture(site: Site, Path((seq, layer)): Path<(u32, String)>) -> Result<Map> {
    let at = place_of(&layer)?;
    // Waiting here takes no thread from other requests.
    let mut last = site.kept.clone().lock_owned().await;
    if let Some((_, maps)) = last.as_ref().filter(|(of, _)| *of == seq) {
        return Ok(maps[at].clone());
    }
    let worked = tokio::task::spawn_blocking(move || {
        *last = None;
        let maps = maps(&site, seq)?;
        let wanted = maps[at].clone();
        *last = Some((seq, maps));
        Ok(wanted)
    });
    let failed = |_| Problem::broken("working it out failed; see the log");
    worked.await.map_err(failed)?
}

/// The pictures of a kept part.
fn maps(site: &Site, seq: u32) -> Result<[Map; 3]> {
    let entry = site.history.result(seq)?.ok_or_else(|| unknown(seq))?;
    if let Some(words) = why_no_frames(&entry) {
        let words = format!("the frames of result {seq} are not kept: {words}");
        return Err(Problem::missing(words));
    }
    let folder = site.history.recording(seq)?.ok_or_else(|| unknown(seq))?;
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
        let layers = sequence.and_then(|sequence| plan.layers(sequence, &kept.frames()));
        let words = "the recording's frames are not those of its recipe";
        let layers = layers.ok_or_else(|| Problem::broken(words))?;
        Ok([0, 1, 2].map(|at| map_of(&layers, at, seq)))
    })
}

fn broken(failure: Failure) -> Problem {
    match failure.exit {
        Exit::Missing => Problem::missing(failure.to_string()),
        _ => Problem::broken(failure.to_string()),
    }
}
