//! Orders to the station: reset, load and teach.

use std::time::Duration;

use axum::Extension;
use axum::body::Body;
use axum::extract::Request as Asked;
use axum::http::StatusCode;
use axum::response::Json;
use serde::Deserialize;
use serde_json::{Value, json};

use super::problem::{Answered, Problem};
use super::request;
use super::request::Path;
use super::site::Site;
use crate::access::Signed;
use crate::recipe::file::rules::check_marking;
use crate::recipe::store;
use crate::recipe::teach::replace;
use crate::station::control::{ERROR_RESET, MAX_RECIPE};
use crate::station::{
    Client, ControlWrite, Event, Marking, RecipeKey, RecipeResult, Request, Snapshot, Teaching,
};

/// The answer to an accepted order; its progress comes with the events.
pub(super) type Accepted = (StatusCode, Json<Value>);

pub(super) fn accepted() -> Accepted {
    (StatusCode::ACCEPTED, Json(json!({ "accepted": true })))
}

pub(super) fn not_now(what: &str, snapshot: &Snapshot) -> Problem {
    Problem::busy(format!(
        "{what}: the station is in state {}; try again when it is ready",
        snapshot.state_word
    ))
}

pub(super) async fn reset(site: Site) -> Answered<Accepted> {
    // A rising edge without a write, so the PLC's registers stay as it wrote them.
    let after = site.station.event(Event::Write {
        write: ControlWrite::default(),
        rising: ERROR_RESET,
        client: Client::default(),
    });
    match &after.fault {
        None => Ok(accepted()),
        Some(fault) => Err(Problem::busy(format!(
            "reset errors: the fault stays: {}; {}",
            fault.cause, fault.remedy
        ))),
    }
}

pub(super) async fn load(site: Site, Path(number): Path<u16>) -> Answered<Accepted> {
    begin_load(&site, number)?;
    Ok(accepted())
}

/// Longest wait for a cycle to end before a changed recipe is loaded.
const REST: Duration = Duration::from_secs(5);

/// What the station does with a recipe that was replaced by another version.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reload {
    /// Whether the recipe is the active one.
    pub active: bool,
    /// Whether the stored version is being loaded; if not, the station keeps using the one before.
    pub loading: bool,
}

/// Loads a recipe whose file was changed, if it is the active one, as soon as no cycle is in
/// flight. Not after a load that failed: then it is not known whether the active recipe is the
/// right one, and loading it would clear that.
pub(super) async fn reload(site: &Site, number: u16) -> Reload {
    let is_active = |snapshot: &Snapshot| snapshot.active() == Some(number);
    let mut snapshots = site.station.subscribe();
    let begin = async {
        loop {
            let rest = snapshots.wait_for(|now| !is_active(now) || now.is_at_rest());
            match rest.await.map(|now| is_active(&now)) {
                Ok(true) if begin_load(site, number).is_ok() => return true,
                // A trigger came first.
                Ok(true) => {}
                Ok(false) | Err(_) => return false,
            }
        }
    };
    let failed = site.station.snapshot().recipe_result != RecipeResult::Ok;
    let loading = !failed && tokio::time::timeout(REST, begin).await.unwrap_or(false);
    Reload {
        active: loading || is_active(&site.station.snapshot()),
        loading,
    }
}

/// Refuses to change recipe files while the station reads or writes them.
///
/// # Errors
/// It loads or teaches a recipe.
pub(super) fn recipes_unused(site: &Site, what: &str) -> Answered<()> {
    let snapshot = site.station.snapshot();
    match snapshot.state_word {
        "loading" | "teaching" => Err(not_now(what, &snapshot)),
        _ => Ok(()),
    }
}

/// Orders a recipe to be loaded.
///
/// # Errors
/// The station is busy.
pub(super) fn begin_load(site: &Site, number: u16) -> Answered<()> {
    let key = RecipeKey::Number(number);
    let after = site.station.event(Event::Request(Request::Load(key)));
    if after.state_word == "loading" {
        Ok(())
    } else {
        Err(not_now("load a recipe", &after))
    }
}

/// What may happen to a recipe that has the number already; without a body it is not replaced.
#[derive(Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct TeachRequest {
    /// It may be replaced; it stays as the previous generation.
    replace: bool,
    /// Its regions, gauges and limits stay.
    keep_gauges: bool,
    /// Everything that is seen is the part.
    everything: Option<bool>,
    /// What is marked in the picture.
    marking: Option<Marking>,
    /// The limit of the deviation, ± mm.
    limit_mm: Option<f64>,
}

pub(super) async fn teach(
    site: Site,
    Path(number): Path<u16>,
    Extension(signed): Extension<Signed>,
    request: Asked<Body>,
) -> Answered<Accepted> {
    if !(1..=MAX_RECIPE).contains(&number) {
        return Err(Problem::unfit(format!(
            "recipe {number}: numbers are 1 to {MAX_RECIPE}"
        )));
    }
    if site.simulation.is_placing() {
        return Err(Problem::busy(
            "teach: another part is being put in front of the simulated head: try again when it is there",
        ));
    }
    // Without a head the station says why below.
    let unknown = site.commission.head().and_then(|head| head.problem);
    if let Some(problem) = unknown {
        return Err(Problem::busy(format!("teach: {problem}")));
    }
    let TeachRequest {
        replace: may_replace,
        keep_gauges,
        everything,
        marking,
        limit_mm,
    } = request::json_if_any(request).await?;
    let limit = replace::check_limit(limit_mm);
    let marked = marking.as_ref().map_or(Ok(()), check_marking);
    let fits = limit.and(marked);
    fits.map_err(|words| Problem::unfit(format!("teach: {words}")))?;
    site.change(move |site| {
        let replaced = site.recipes.present(number);
        match (may_replace, keep_gauges) {
            (false, true) => {
                return Err(Problem::unfit(
                    "teach: keep_gauges needs replace: the gauges of the recipe that is replaced stay",
                ));
            }
            (false, false) => {
                let words = (
                    "teach",
                    "send {\"replace\": true} to replace it",
                    "teach number",
                );
                store::refuse_taken(&site.recipes, number, words).map_err(Problem::busy)?;
            }
            (true, true) if replaced.is_none() => {
                return Err(Problem::missing(replace::no_gauges(number)));
            }
            (true, _) => {}
        }
        let part_number = replace::naming(number, replaced.as_ref(), keep_gauges).part_number;
        let shared = site.recipes.refuse_shared(number, &part_number);
        shared.map_err(|words| Problem::busy(format!("teach: {words}")))
    })
    .await?;
    let order = Request::Teach(Teaching {
        number,
        keep_gauges,
        everything,
        marking,
        limit_um: limit_mm.map(|mm| (mm * 1000.0).round() as u32),
        by: Some(signed.to_string().into()),
    });
    let after = site.station.event(Event::Request(order));
    if after.state_word == "teaching" {
        Ok(accepted())
    } else {
        Err(not_now("teach", &after))
    }
}
