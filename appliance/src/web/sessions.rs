//! Signing in and out.

use std::time::Instant;

use axum::body::Body;
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Json, Response};
use axum::{Extension, extract};
use serde::Deserialize;
use serde_json::{Value, json};

use super::body;
use super::gate::{self, Peer};
use super::problem::{Answered, Problem};
use super::site::Site;
use crate::station::Micros;
use crate::station::snapshot::warning;
use crate::system::clock;
use crate::web::access::Refused;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SignIn {
    secret: String,
    /// The time by the browser's clock, ms since 1970 UTC.
    time_ms: Option<u64>,
}

pub(super) async fn state(site: Site, headers: HeaderMap) -> Json<Value> {
    Json(json!({ "signed_in": gate::is_signed_in(&site, &headers) }))
}

pub(super) async fn begin(
    site: Site,
    Extension(Peer(from)): Extension<Peer>,
    request: extract::Request<Body>,
) -> Answered<Response> {
    let SignIn { secret, time_ms } = body::json(request.into_body()).await?;
    let received = site.station.now();
    let guess = site.change(move |site| Ok(site.access.sign_in(from, &secret, Instant::now())));
    let token = guess.await?;
    // A guess that has to wait is not recorded, so that guessing cannot fill the record.
    if !matches!(token, Err(Refused::Wait(_))) {
        let outcome = match &token {
            Ok(_) => Ok(None),
            Err(refused) => Err(refused.to_string()),
        };
        gate::record(&site, from, "sign in", "session".into(), outcome).await;
    }
    match token {
        Ok(token) => {
            let time = match time_ms {
                Some(ms) => {
                    let dated = site.change(move |site| Ok(date(site, ms, received)));
                    Some(dated.await?)
                }
                None => None,
            };
            let answer = json!({ "signed_in": true, "time": time });
            Ok(with_cookie(gate::cookie(Some(&token)), answer))
        }
        Err(refused) => {
            let status = match &refused {
                Refused::Wrong => StatusCode::FORBIDDEN,
                Refused::Wait(_) => StatusCode::TOO_MANY_REQUESTS,
                Refused::Broken(_) => StatusCode::INTERNAL_SERVER_ERROR,
            };
            let mut response = Problem::new(status, &refused).into_response();
            if let Refused::Wait(time) = refused {
                let seconds = HeaderValue::from(time.as_secs().max(1));
                response.headers_mut().insert(header::RETRY_AFTER, seconds);
            }
            Ok(response)
        }
    }
}

pub(super) async fn end(site: Site, headers: HeaderMap) -> Response {
    if let Some(token) = gate::token(&headers) {
        site.access.sign_out(token);
    }
    with_cookie(gate::cookie(None), json!({ "signed_in": false }))
}

/// Dates this start by the clock of a browser whose user has signed in, where the device's own
/// clock is not synchronised; answers with the outcome. The last sign-in counts, so a wrong time is
/// corrected by signing in from a browser with the right one.
fn date(site: &Site, ms: u64, received: Micros) -> &'static str {
    if site.station.snapshot().warnings & warning::CLOCK_UNSYNCED == 0 {
        return "not needed";
    }
    let Some(us) = clock::of_browser(ms) else {
        return "refused";
    };
    clock::tell(us);
    match (site.date)(us.saturating_sub(received.0)) {
        true => "taken",
        false => "not stored",
    }
}

fn with_cookie(cookie: Option<HeaderValue>, answer: Value) -> Response {
    let mut response = Json(answer).into_response();
    if let Some(cookie) = cookie {
        response.headers_mut().insert(header::SET_COOKIE, cookie);
    }
    response
}
