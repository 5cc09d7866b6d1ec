//! The gate in front of every change: checks origin and session, and records what was done.

use std::net::IpAddr;
use std::time::Instant;

use axum::Extension;
use axum::extract::Request;
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};

use super::host::only;
use super::problem::{Answered, Problem, ProblemWords};
use super::site::Site;
use crate::system::clock;
use crate::system::journal::{self, Severity};
use crate::web::access::{Change, MAX_AGE_S, Token};

/// The session's cookie.
const COOKIE: &str = "fringed-session";

/// The client's address, added to each request by the server.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Peer(pub IpAddr);

/// The name of a change in the record.
#[derive(Clone, Copy, Debug)]
pub struct ChangeName(pub &'static str);

/// What a change has changed, in words: an extension of the answer, for the record.
#[derive(Clone, Debug)]
pub struct Changed(pub String);

/// The session token of a request, if it has one.
pub fn token(headers: &HeaderMap) -> Option<&str> {
    let cookies = headers.get_all(header::COOKIE).into_iter();
    let mut pairs = cookies
        .filter_map(|line| line.to_str().ok())
        .flat_map(|line| line.split(';'))
        .filter_map(|pair| pair.trim().split_once('='));
    pairs
        .find(|(name, _)| *name == COOKIE)
        .map(|(_, value)| value)
}

/// Whether a request belongs to an open session.
pub fn is_signed_in(site: &Site, headers: &HeaderMap) -> bool {
    token(headers).is_some_and(|token| site.access.is_signed_in(token, Instant::now()))
}

/// Refuses a request without a session.
///
/// # Errors
/// How to sign in.
pub(super) fn signed_in(site: &Site, headers: &HeaderMap) -> Answered<()> {
    let words = "sign in first: POST the device's secret to /api/session";
    let refused = || Problem::new(StatusCode::UNAUTHORIZED, words);
    is_signed_in(site, headers)
        .then_some(())
        .ok_or_else(refused)
}

/// The cookie that holds a session's token, or without one the cookie that deletes it.
pub fn cookie(token: Option<&Token>) -> Option<HeaderValue> {
    let (value, age) = token.map_or(("", 0), |token| (token.text(), MAX_AGE_S));
    let text = format!("{COOKIE}={value}; Path=/; HttpOnly; SameSite=Strict; Max-Age={age}");
    HeaderValue::from_str(&text).ok()
}

/// Lets a request through only if it comes from this device's own page. The browser sets the Origin
/// header, and no page can forge it.
pub async fn own_page_only(request: Request, next: Next) -> Response {
    if is_own(request.headers()) {
        return next.run(request).await;
    }
    let words =
        "a change must come from this device's own page: send its address in the Origin header";
    Problem::new(StatusCode::FORBIDDEN, words).into_response()
}

fn is_own(headers: &HeaderMap) -> bool {
    let origin = only(headers, &header::ORIGIN).and_then(|origin| origin.split_once("://"));
    origin.is_some_and(|(_, place)| Some(place) == only(headers, &header::HOST))
}

/// Lets a request through only with an open session, and records its outcome.
pub async fn signed_in_only(
    site: Site,
    Extension(Peer(from)): Extension<Peer>,
    Extension(ChangeName(action)): Extension<ChangeName>,
    request: Request,
    next: Next,
) -> Response {
    let subject = request.uri().path().trim_start_matches("/api/").to_owned();
    let response = match signed_in(&site, request.headers()) {
        Ok(()) => next.run(request).await,
        Err(problem) => problem.into_response(),
    };
    let refused = response.extensions().get::<ProblemWords>();
    let changed = response.extensions().get::<Changed>();
    let outcome = match refused {
        Some(ProblemWords(words)) => Err(words.clone()),
        None => Ok(changed.map(|Changed(words)| words.clone())),
    };
    record(&site, from, action, subject, outcome).await;
    response
}

/// Adds a line to the record of changes, with why the change was refused, or that it was done and
/// perhaps what was changed; if that fails, the log says so.
pub async fn record(
    site: &Site,
    from: IpAddr,
    action: &'static str,
    subject: String,
    outcome: Result<Option<String>, String>,
) {
    let written = site
        .change(move |site| {
            let snapshot = site.station.snapshot();
            let change = Change {
                utc_us: clock::utc_us(),
                uptime_s: snapshot.uptime_s,
                boot_id: snapshot.boot_id,
                from,
                action,
                subject: &subject,
                outcome: outcome.as_ref().map_or_else(String::as_str, |_| "done"),
                changed: outcome.as_ref().ok().and_then(Option::as_deref),
            };
            let stored = site.access.changes().add(&change);
            stored.map_err(Problem::broken)
        })
        .await;
    if let Err(problem) = written {
        let line = format!(
            "record the change {action:?}: {}: free space",
            problem.words
        );
        journal::write(Severity::Warning, &line);
        site.log.add(&line);
    }
}
