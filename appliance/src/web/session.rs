//! Sessions: signing in and out, and a user's own password.

use super::gate::{self, COOKIE, Changed, Needs, Peer};
use super::problem::{Answered, Problem, ProblemWords};
use super::request;
use super::site::Site;
use crate::access::{MAX_AGE_S, Refused, Role, Token, UserError};
use crate::station::Micros;
use crate::station::snapshot::warning;
use crate::system::clock;
use axum::Extension;
use axum::body::Body;
use axum::extract::Request;
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Json, Response};
use serde::Deserialize;
use serde_json::{Value, json};
use std::time::Instant;

/// The body of a sign-in.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SignIn {
    secret: String,
    /// None, or the engineer: the device's secret.
    user: Option<String>,
    /// The time by the browser's clock, ms since 1970 UTC.
    time_ms: Option<u64>,
}

/// The body of a new password.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct NewPassword {
    /// The present one.
    secret: String,
    new: String,
}

/// Who is signed in, and which routes need more than a viewer.
pub(super) async fn state(
    site: Site,
    Extension(Needs(needs)): Extension<Needs>,
    headers: HeaderMap,
) -> Json<Value> {
    let signed = gate::signed_in(&site, &headers);
    let looking = match site.looking_is_open {
        true => "anyone",
        false => "signed-in",
    };
    Json(json!({
        "signed_in": signed.is_some(), "looking": looking, "needs": *needs,
        "user": signed.as_ref().map(|signed| &signed.name),
        "role": signed.map_or(Role::Viewer, |signed| signed.role),
    }))
}

pub(super) async fn begin(
    site: Site,
    Extension(Peer(from)): Extension<Peer>,
    request: Request<Body>,
) -> Answered<Response> {
    let SignIn {
        secret,
        user,
        time_ms,
    } = request::json(request).await?;
    let received = site.station.now();
    // One that has to wait takes no place of others.
    let waits = site.access.wait(from, user.as_deref(), Instant::now());
    waits.map_err(refusal)?;
    let guess = site.change(move |site| {
        let now = Instant::now();
        Ok(site.access.sign_in(from, user.as_deref(), &secret, now))
    });
    let begun = guess.await?;
    let signed = begun.as_ref().ok().map(|(_, signed)| signed.clone());
    // A guess that has to wait is not recorded, so that guessing cannot fill the record.
    if !matches!(begun, Err(Refused::Wait(_))) {
        let refused = begun.as_ref().err();
        let refused = refused.map(|refused| ProblemWords(refused.to_string()));
        let subject = "session".into();
        gate::record(&site, from, signed, "sign in", subject, refused, None).await;
    }
    let (token, signed) = begun.map_err(refusal)?;
    let time = match time_ms {
        Some(ms) => {
            let dated = site.change(move |site| Ok(date(site, ms, received)));
            Some(dated.await?)
        }
        None => None,
    };
    let answer = json!({
        "signed_in": true, "user": signed.name, "role": signed.role, "time": time,
    });
    Ok(with_cookie(cookie(Some(&token)), answer))
}

/// Gives a signed-in user another password; its other sessions end.
pub(super) async fn set_password(
    site: Site,
    Extension(Peer(from)): Extension<Peer>,
    request: Request<Body>,
) -> Answered<Response> {
    let signed = gate::signed_in(&site, request.headers());
    let signed = signed.ok_or_else(|| Problem::new(StatusCode::UNAUTHORIZED, "sign in first"))?;
    let NewPassword { secret, new } = request::json(request).await?;
    let name = signed.name.clone();
    let set = site.change(move |site| {
        let now = Instant::now();
        let access = &site.access;
        let own = access.confirm(from, &name, &secret, now).map_err(refusal)?;
        let since = (clock::utc_us(), &*own.name);
        access.set_user(&own.name, own.role, Some(&new), since)?;
        let begun = access.sign_in(from, Some(&own.name), &new, now);
        Ok(begun.map_err(refusal)?.0)
    });
    let set = set.await;
    let refused = set
        .as_ref()
        .err()
        .map(|problem| ProblemWords(problem.words.clone()));
    let (subject, changed) = (format!("users/{}", signed.name), Changed::default());
    gate::record(
        &site,
        from,
        Some(signed),
        "set password",
        subject,
        refused,
        Some(changed),
    )
    .await;
    Ok(with_cookie(
        cookie(Some(&set?)),
        json!({ "signed_in": true }),
    ))
}

pub(super) async fn end(site: Site, headers: HeaderMap) -> Response {
    if let Some(token) = gate::token(&headers) {
        site.access.sign_out(token);
    }
    with_cookie(cookie(None), json!({ "signed_in": false }))
}

fn refusal(refused: Refused) -> Problem {
    let status = match &refused {
        Refused::Wrong | Refused::WrongUser => StatusCode::FORBIDDEN,
        Refused::Wait(_) => StatusCode::TOO_MANY_REQUESTS,
        Refused::Broken(_) => StatusCode::INTERNAL_SERVER_ERROR,
    };
    let problem = Problem::new(status, &refused);
    match refused {
        Refused::Wait(time) => problem.after(time.as_secs().max(1)),
        _ => problem,
    }
}

impl From<UserError> for Problem {
    fn from(error: UserError) -> Self {
        match &error {
            UserError::Unfit(_) => Self::unfit(error),
            UserError::Unknown(_) => Self::missing(error),
            UserError::Store(source) => Self::unstored(&error, source),
        }
    }
}

/// The cookie that holds a session's token, or without one the cookie that deletes it.
fn cookie(token: Option<&Token>) -> Option<HeaderValue> {
    let (value, age) = token.map_or(("", 0), |token| (token.text(), MAX_AGE_S));
    let text = format!("{COOKIE}={value}; Path=/; HttpOnly; SameSite=Strict; Max-Age={age}");
    HeaderValue::from_str(&text).ok()
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
