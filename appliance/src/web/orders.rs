//! Orders to the station: trigger, reset, load and teach.

use axum::extract::{Path, State};
use axum::http::StatusCode;
use axum::response::Json;
use serde_json::{Value, json};

use super::problem::Problem;
use super::site::Site;
use crate::station::control::{ERROR_RESET, TRIGGER};
use crate::station::{ControlWrite, Event, RecipeKey, Request, Snapshot};

/// What an accepted order answers: it is under way, the events tell the rest.
type Accepted = (StatusCode, Json<Value>);

fn accepted() -> Accepted {
    (StatusCode::ACCEPTED, Json(json!({ "accepted": true })))
}

fn not_now(what: &str, snapshot: &Snapshot) -> Problem {
    Problem::busy(format!(
        "{what}: the station is in state {}; try again when it is ready",
        snapshot.state_word
    ))
}

/// Why a trigger was rejected, from the snapshot after it.
fn rejected(snapshot: &Snapshot) -> Problem {
    let words = snapshot.refusal_words();
    Problem::busy(format!("trigger: {}", words.unwrap_or_default()))
}

/// An edge without a write: the registers of the PLC stay as it wrote them.
fn edge(site: &Site, rising: u16) -> std::sync::Arc<Snapshot> {
    let write = ControlWrite::default();
    site.station.event(Event::Write { write, rising })
}

pub(super) async fn trigger(State(site): State<Site>) -> Result<Accepted, Problem> {
    let before = site.station.snapshot().triggers;
    let after = edge(&site, TRIGGER);
    if after.triggers == before {
        return Err(rejected(&after));
    }
    Ok(accepted())
}

pub(super) async fn reset(State(site): State<Site>) -> Accepted {
    edge(&site, ERROR_RESET);
    accepted()
}

pub(super) async fn load(
    State(site): State<Site>,
    Path(number): Path<u16>,
) -> Result<Accepted, Problem> {
    begin_load(&site, number)?;
    Ok(accepted())
}

/// Orders a recipe to be loaded.
///
/// # Errors
/// The station is busy.
pub(super) fn begin_load(site: &Site, number: u16) -> Result<(), Problem> {
    let key = RecipeKey::Number(number);
    let after = site.station.event(Event::Request(Request::Load(key)));
    if after.state_word == "loading" {
        Ok(())
    } else {
        Err(not_now("load a recipe", &after))
    }
}

pub(super) async fn teach(
    State(site): State<Site>,
    Path(number): Path<u16>,
) -> Result<Accepted, Problem> {
    if !(1..=9999).contains(&number) {
        return Err(Problem::unfit(format!(
            "recipe {number}: numbers are 1 to 9999"
        )));
    }
    let after = site
        .station
        .event(Event::Request(Request::Teach { number }));
    if after.state_word == "teaching" {
        Ok(accepted())
    } else {
        Err(not_now("teach", &after))
    }
}
