//! Guided studies: begin one, run it, take trials again, and its report.
//!
//! A study that runs takes the next cycles one after the other, whoever triggers them. It is paused by a user, by a restart,
//! when it is complete, where cycles came faster than they can be told apart, and after ten minutes without a cycle, so that
//! production does not fill a study that was forgotten.

use std::sync::Arc;
use std::time::Duration;

use axum::body::Body;
use axum::extract::Request;
use axum::response::{Json, Response};
use serde::Deserialize;
use serde_json::{Value, json};

use super::downloads::{Download, send};
use super::problem::{Answered, Problem};
use super::request;
use super::request::Path;
use super::site::Site;
use crate::history::Entry;
use crate::history::design::{StudyDesign, StudyTrial};
use crate::history::studies::{GuidedStudy, StudyError};
use crate::station::{ResultRecord, Snapshot};
use crate::study::write_json;

/// A study that takes no cycle for so long is paused.
const IDLE: Duration = Duration::from_secs(600);

impl From<StudyError> for Problem {
    fn from(error: StudyError) -> Self {
        match &error {
            StudyError::Missing(_) => Self::missing(error),
            StudyError::Unfit(_) => Self::unfit(error),
            StudyError::File { source, .. } => Self::unstored(&error, source),
        }
    }
}

fn shown(site: &Site, study: &GuidedStudy) -> Value {
    let running = site.desk.lock();
    let again = running.study.filter(|(number, _)| *number == study.number);
    let next = again.and_then(|(_, trial)| trial).or_else(|| study.next());
    let note = running
        .note
        .as_ref()
        .filter(|(number, _)| *number == study.number);
    json!({
        "number": study.number, "asked": study.asked, "all": study.all(), "running": again.is_some(),
        "next": next, "words": next.map(|next| study.asked.words(next)), "note": note.map(|(_, words)| words),
        "taken": study.taken.iter().map(|taken| json!({ "of": taken.of, "seq": taken.seq })).collect::<Vec<_>>(),
    })
}

pub(super) async fn list(site: Site) -> Answered<Json<Value>> {
    let listed = site.aside(|site| {
        let numbers = site.studies.numbers().into_iter();
        let rows = numbers.map(|number| match site.studies.read(number) {
            Ok(study) => json!({
                "number": number, "name": study.asked.name, "recipe": study.asked.recipe,
                "taken": study.taken.len(), "all": study.all(),
            }),
            Err(error) => json!({ "number": number, "error": error.to_string() }),
        });
        Ok(json!({ "studies": rows.collect::<Vec<_>>() }))
    });
    listed.await.map(Json)
}

pub(super) async fn one(site: Site, Path(number): Path<u32>) -> Answered<Json<Value>> {
    let read = site.aside(move |site| Ok(shown(site, &site.studies.read(number)?)));
    read.await.map(Json)
}

pub(super) async fn begin(site: Site, request: Request<Body>) -> Answered<Json<Value>> {
    let asked: StudyDesign = request::json(request).await?;
    let begun = site.change(move |site| {
        let recipe = site
            .recipes
            .manifest(asked.recipe)
            .map_err(Problem::missing)?;
        let known = |slot: &u16| recipe.gauges.iter().any(|gauge| gauge.slot == *slot);
        if let Some(slot) = asked.slots.iter().find(|slot| !known(slot)) {
            let words = format!(
                "recipe {} has no gauge in slot {slot}: choose one that it has",
                asked.recipe
            );
            return Err(Problem::unfit(words));
        }
        Ok(shown(site, &site.studies.begin(asked)?))
    });
    begun.await.map(Json)
}

/// Which trial is taken again, if one is.
#[derive(Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct RunRequest {
    again: Option<StudyTrial>,
}

/// Runs a study, or pauses it.
pub(super) async fn order(
    site: Site,
    Path((number, order)): Path<(u32, String)>,
    request: Request<Body>,
) -> Answered<Json<Value>> {
    let RunRequest { again } = request::json_if_any(request).await?;
    let study = site
        .aside(move |site| Ok(site.studies.read(number)?))
        .await?;
    match order.as_str() {
        "run" => run(&site, &study, again)?,
        "pause" => {
            if let Some(turn) = site.desk.turn_of(number) {
                site.desk.pause(turn, "paused".into());
            }
        }
        _ => return Err(Problem::missing("a study can run or pause")),
    }
    Ok(Json(shown(&site, &study)))
}

fn run(site: &Site, study: &GuidedStudy, again: Option<StudyTrial>) -> Answered<()> {
    let number = study.number;
    if again.is_some_and(|again| !study.has(again)) {
        return Err(Problem::unfit(format!("study {number} has no such trial")));
    }
    if again.is_none() && study.next().is_none() {
        let words = "is complete: name a trial that is taken again";
        return Err(Problem::busy(format!("study {number} {words}")));
    }
    let mut running = site.desk.lock();
    if let Some((other, _)) = running.study.filter(|(other, _)| *other != number) {
        return Err(Problem::busy(format!(
            "study {other} is running: pause it before"
        )));
    }
    running.turn += 1;
    (running.study, running.note) = (Some((number, again)), None);
    let now = site.station.snapshot();
    let last = now.result.as_ref().map(|result| result.seq);
    // A cycle that was triggered before is not one of the study.
    let last = last.map(|seq| seq.wrapping_add(u32::from(now.is_working())));
    tokio::spawn(follow(site.clone(), number, running.turn, last));
    Ok(())
}

pub(super) async fn delete(site: Site, Path(number): Path<u32>) -> Answered<Json<Value>> {
    if site.desk.turn_of(number).is_some() {
        return Err(Problem::busy(format!(
            "study {number} is running: pause it before"
        )));
    }
    site.change(move |site| Ok(site.studies.delete(number)?))
        .await?;
    Ok(Json(json!({})))
}

/// The values as CSV, or what `fringed study grr --json` prints of them, byte by byte.
pub(super) async fn file(
    site: Site,
    Path((number, name)): Path<(u32, String)>,
) -> Answered<Response> {
    let kind = match name.as_str() {
        "values.csv" => "text/csv; charset=utf-8",
        "report.json" => "application/json",
        _ => return Err(Problem::missing("a study has values.csv and report.json")),
    };
    send(&site, kind, move |site| {
        let study = site.studies.read(number)?;
        let mut bytes = Vec::new();
        match name.as_str() {
            "values.csv" => bytes = study.csv().into_bytes(),
            _ => write_json(&mut bytes, &study.report()?).map_err(Problem::broken)?,
        }
        Ok((format!("study-{number}-{name}"), Download::Bytes(bytes)))
    })
    .await
}

/// Takes results behind `last`, or any if there is none so far, for a study, until it is paused.
async fn follow(site: Site, number: u32, turn: u64, mut last: Option<u32>) {
    let mut snapshots = site.station.subscribe();
    loop {
        let ahead = |seq: u32| last.map_or(1, |last| seq.wrapping_sub(last).cast_signed());
        let newer = |now: &Arc<Snapshot>| {
            now.result
                .as_ref()
                .is_some_and(|result| ahead(result.seq) > 0)
        };
        let result = match tokio::time::timeout(IDLE, snapshots.wait_for(newer)).await {
            Ok(Ok(now)) => now.result.clone(),
            Ok(Err(_)) => return,
            Err(_) => {
                let words = format!("paused: no cycle came for {} minutes", IDLE.as_secs() / 60);
                return site.desk.pause(turn, words);
            }
        };
        let Some(result) = result else { return };
        if ahead(result.seq) > 1 {
            let words = format!(
                "paused: results up to {} came faster than they can be told apart: look which part was last, and run the study again",
                result.seq
            );
            return site.desk.pause(turn, words);
        }
        last = Some(result.seq);
        let taken = site.change(move |site| take(site, number, turn, &result));
        match taken.await {
            Ok(true) => {}
            Ok(false) => return,
            Err(problem) => return site.desk.pause(turn, format!("paused: {}", problem.words)),
        }
    }
}

/// Takes a result; answers whether the study still runs.
fn take(site: &Site, number: u32, turn: u64, result: &ResultRecord) -> Answered<bool> {
    let mut study = site.studies.read(number)?;
    let again = {
        let running = site.desk.lock();
        match running.study {
            Some((_, again)) if running.turn == turn => again,
            _ => return Ok(false),
        }
    };
    let Some(next) = again.or_else(|| study.next()) else {
        return Ok(false);
    };
    let (seq, words) = (result.seq, study.asked.words(next));
    let taken = if result.recipe == study.asked.recipe {
        study.take(next, &site.history.id()?, &Entry::of(result))
    } else {
        Err(format!("it is of recipe {}", result.recipe))
    };
    if let Err(why) = taken {
        site.desk.say(
            turn,
            format!("result {seq} was not taken, {why}: measure {words} once more"),
        );
        return Ok(true);
    }
    site.studies.write(&study)?;
    let words = format!("result {seq} was taken for {words}");
    match study.next() {
        None => site
            .desk
            .pause(turn, format!("{words}; the study is complete")),
        // Whoever takes one trial again looks before the others go on.
        Some(_) if again.is_some() => site.desk.pause(turn, format!("{words}; paused")),
        Some(_) => site.desk.say(turn, words),
    }
    Ok(site.desk.lock().turn == turn)
}
