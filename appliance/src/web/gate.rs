//! The gate: checks the Host header of every request, and origin and session of every change, whose
//! outcome it records; opens and ends sessions.
//!
//! Another site can let its own name resolve to this device (DNS rebinding) and then read it through
//! its visitor's browser. It cannot forge the Host header, so only IP addresses, `localhost` and
//! configured names are answered.

use super::problem::{Answered, Problem, ProblemWords};
use super::request;
use super::site::Site;
use crate::station::Micros;
use crate::station::snapshot::warning;
use crate::system::clock;
use crate::system::journal::{self, Severity};
use crate::web::access::{Change, MAX_AGE_S, Refused, Token};
use axum::Extension;
use axum::body::Body;
use axum::extract::Request;
use axum::http::{HeaderMap, HeaderName, HeaderValue, StatusCode, Uri, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Json, Response};
use serde::Deserialize;
use serde_json::{Value, json};
use std::net::{IpAddr, Ipv6Addr};
use std::time::Instant;

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

/// The body of a sign-in.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SignIn {
    secret: String,
    /// The time by the browser's clock, ms since 1970 UTC.
    time_ms: Option<u64>,
}

/// Checks that a request names one host, and that this is the device.
///
/// # Errors
/// 400 where it names several, 421 where it names none or another.
pub fn check_host(uri: &Uri, headers: &HeaderMap, configured: &[String]) -> Answered<()> {
    let host = only(headers, &header::HOST);
    let several = headers.get_all(header::HOST).iter().count() > 1;
    // The request line may name a host, too.
    let named = uri.authority().map(|authority| authority.as_str());
    if several || named.is_some_and(|named| host.is_some_and(|host| host != named)) {
        let words = "the request names more than one host: send one Host header, and in the request line a path only";
        return Err(Problem::unclear(words));
    }
    if is_allowed(host.unwrap_or(""), configured) {
        return Ok(());
    }
    let words = "this device does not go by the name in the Host header; use its IP address, or add the name to the config";
    Err(Problem::new(StatusCode::MISDIRECTED_REQUEST, words))
}

/// The text of a header; none if it is missing, repeated, or not text.
pub fn only<'a>(headers: &'a HeaderMap, name: &HeaderName) -> Option<&'a str> {
    let mut values = headers.get_all(name).into_iter();
    let first = values.next()?;
    let once = values.next().is_none();
    once.then(|| first.to_str().ok())?
}

/// Whether a request with this Host header is meant for this device.
fn is_allowed(header: &str, configured: &[String]) -> bool {
    let name = if let Some(rest) = header.strip_prefix('[') {
        let Some((address, port)) = rest.split_once(']') else {
            return false;
        };
        return address.parse::<Ipv6Addr>().is_ok()
            && (port.is_empty() || is_port(port.strip_prefix(':')));
    } else if let Some((name, port)) = header.split_once(':') {
        if !is_port(Some(port)) {
            return false;
        }
        name
    } else {
        header
    };
    name.eq_ignore_ascii_case("localhost")
        || name.parse::<IpAddr>().is_ok()
        || configured
            .iter()
            .any(|allowed| name.eq_ignore_ascii_case(allowed))
}

fn is_port(text: Option<&str>) -> bool {
    text.is_some_and(|text| text.parse::<u16>().is_ok())
}

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
    let refused = response.extensions().get::<ProblemWords>().cloned();
    let changed = response.extensions().get::<Changed>().cloned();
    record(&site, from, action, subject, refused, changed).await;
    response
}

/// Adds a line to the record of changes: why the change was `refused`, else that it was done and what
/// was `changed`, where that is known. If that fails, the log says so.
async fn record(
    site: &Site,
    from: IpAddr,
    action: &'static str,
    subject: String,
    refused: Option<ProblemWords>,
    changed: Option<Changed>,
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
                outcome: refused.as_ref().map_or("done", |ProblemWords(words)| words),
                changed: changed.as_ref().map(|Changed(words)| words.as_str()),
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

pub(super) async fn session(site: Site, headers: HeaderMap) -> Json<Value> {
    Json(json!({ "signed_in": is_signed_in(&site, &headers) }))
}

pub(super) async fn begin_session(
    site: Site,
    Extension(Peer(from)): Extension<Peer>,
    request: Request<Body>,
) -> Answered<Response> {
    let SignIn { secret, time_ms } = request::json(request.into_body()).await?;
    let received = site.station.now();
    let guess = site.change(move |site| Ok(site.access.sign_in(from, &secret, Instant::now())));
    let token = guess.await?;
    // A guess that has to wait is not recorded, so that guessing cannot fill the record.
    if !matches!(token, Err(Refused::Wait(_))) {
        let refused = token.as_ref().err();
        let refused = refused.map(|refused| ProblemWords(refused.to_string()));
        record(&site, from, "sign in", "session".into(), refused, None).await;
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
            Ok(with_cookie(cookie(Some(&token)), answer))
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

pub(super) async fn end_session(site: Site, headers: HeaderMap) -> Response {
    if let Some(token) = token(&headers) {
        site.access.sign_out(token);
    }
    with_cookie(cookie(None), json!({ "signed_in": false }))
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_localhost_and_configured_names_are_answered_and_nothing_else() {
        let configured = ["sensor-7.local".to_owned()];
        for fine in [
            "127.0.0.1:8080",
            "10.0.0.5",
            "[::1]:8080",
            "[fe80::1]",
            "localhost",
            "LocalHost:80",
            "Sensor-7.local:8080",
        ] {
            assert!(is_allowed(fine, &configured), "{fine}");
        }
        for other in [
            "",
            "evil.example",
            "evil.example:8080",
            "127.0.0.1.evil.example",
            "localhost:x",
            "[::1",
            "[evil]",
            "[::1]x",
        ] {
            assert!(!is_allowed(other, &configured), "{other}");
        }
    }
}
