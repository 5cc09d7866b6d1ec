//! The trigger of the API. With a token it measures once, however often the request is repeated: the
//! token is stored with the result, and looked up before anything is measured.

use super::gate;
use super::orders::accepted;
use super::problem::{Answered, Problem};
use super::request;
use super::results;
use super::site::Site;
use crate::station::{Client, Event, Request, Snapshot, Trigger};
use axum::body::Body;
use axum::extract::Request as Asked;
use axum::http::{HeaderMap, StatusCode};
use axum::response::{IntoResponse as _, Json, Response};
use serde::Deserialize;
use serde_json::{Value, json};
use std::hash::{DefaultHasher, Hash as _, Hasher as _};
use std::sync::Arc;
use std::time::Duration;

/// The longest token, characters.
const LONGEST: usize = 64;
/// Longest wait for the work of others to end before a trigger with a token.
const REST: Duration = Duration::from_secs(5);

/// What is measured; what is not said is as the PLC has written it.
#[derive(Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct TriggerOrder {
    token: Option<String>,
    recipe: Option<u16>,
    part_id: Option<u32>,
    press_stroke: Option<u32>,
}

/// Without a token the answer comes at once, with one when the result is stored.
pub(super) async fn trigger(
    site: Site,
    headers: HeaderMap,
    request: Asked<Body>,
) -> Answered<Response> {
    let order: TriggerOrder = request::json_if_any(request).await?;
    let mut session = DefaultHasher::new();
    gate::token(&headers).hash(&mut session);
    let trigger = Trigger {
        client: Client::Page(session.finish()),
        recipe: order.recipe,
        part_id: order.part_id,
        press_stroke: order.press_stroke,
        ..Trigger::default()
    };
    let Some(token) = order.token else {
        let before = site.station.snapshot().triggers;
        let after = begin(&site, &trigger);
        return match after.triggers == before {
            true => Err(rejected(&after, &trigger)),
            false => Ok(accepted().into_response()),
        };
    };
    if !(1..=LONGEST).contains(&token.len()) || !token.bytes().all(|byte| byte.is_ascii_graphic()) {
        let words = format!("token: write 1 to {LONGEST} ASCII characters without spaces");
        return Err(Problem::unclear(words));
    }
    // On a task of its own: a client that is gone leaves a token that is being measured.
    let measured = tokio::spawn(once(site, trigger, token.into()));
    let gone = |_| Problem::broken("the trigger failed; see the log, and repeat the request");
    let result = measured.await.map_err(gone)??;
    Ok(Json(json!({ "result": result })).into_response())
}

fn begin(site: &Site, trigger: &Trigger) -> Arc<Snapshot> {
    let request = Request::Trigger(trigger.clone());
    site.station.event(Event::Request(request))
}

/// Why a trigger was rejected, from the snapshot after it.
fn rejected(snapshot: &Snapshot, trigger: &Trigger) -> Problem {
    let other = trigger
        .recipe
        .filter(|_| trigger.recipe != snapshot.active());
    let words = snapshot.refusal_words().unwrap_or_else(|| match other {
        Some(recipe) => format!("recipe {recipe} is not the active one: load it"),
        None => "another client waits for its turn: try again".into(),
    });
    Problem::busy(format!("trigger: {words}"))
}

/// Measures unless there is a result of this token, and answers with it once it is stored.
async fn once(site: Site, trigger: Trigger, token: Arc<str>) -> Answered<Value> {
    // One after the other: the same request may have come twice.
    let _turn = site.asking.lock().await;
    if let Some(known) = stored(&site, &token).await? {
        return Ok(known);
    }
    let trigger = Trigger {
        request: Some(token.clone()),
        ..trigger
    };
    let mut snapshots = site.station.subscribe();
    // What still works then is named by the station.
    let _ = tokio::time::timeout(REST, snapshots.wait_for(|now| !now.is_working())).await;
    let is_mine = |now: &Snapshot| now.request.as_ref() == Some(&token);
    let after = begin(&site, &trigger);
    if !is_mine(&after) {
        return Err(rejected(&after, &trigger));
    }
    let ended = snapshots.wait_for(|now| !is_mine(now)).await;
    ended.map_err(|_| Problem::crowded("fringed ends: repeat the request"))?;
    let lost = "the result is not in the history: look at the page for it";
    let measured = stored(&site, &token).await?;
    measured.ok_or_else(|| Problem::broken(lost))
}

/// The result of a token, once every result so far is stored.
async fn stored(site: &Site, token: &Arc<str>) -> Answered<Option<Value>> {
    let token = token.clone();
    site.change(move |site| {
        if !(site.is_stored)() {
            let words = "results cannot be stored now: free storage, and repeat the request";
            return Err(Problem::new(StatusCode::INSUFFICIENT_STORAGE, words));
        }
        let Some(entry) = site.history.requested(&token)? else {
            return Ok(None);
        };
        let serial = &site.station.snapshot().identity.serial;
        let line = json!(results::of(serial, &site.history.id()?, &entry));
        Ok(Some(line))
    })
    .await
}
