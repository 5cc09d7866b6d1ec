//! The gate: checks the Host header of every request, the role that its row in the table of routes
//! needs, and the origin of every change, whose outcome it records.
//!
//! Another site can let its own name resolve to this device (DNS rebinding) and then read it through
//! its visitor's browser. It cannot forge the Host header, so only IP addresses, `localhost` and
//! configured names are answered.

use super::problem::{Answered, Problem, ProblemWords};
use super::site::Site;
use crate::access::record::recipe_of;
use crate::access::{Access, Change, Role, Signed, Way};
use crate::system::journal::{self, Severity};
use crate::system::socket::holds;
use axum::Extension;
use axum::extract::Request;
use axum::http::{HeaderMap, HeaderName, StatusCode, Uri, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use serde_json::{Map, Value};
use std::net::{IpAddr, Ipv6Addr};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Instant;

/// The session's cookie.
pub(super) const COOKIE: &str = "fringed-session";
/// Refused changes of those who have not signed in are recorded so often at most, s: nobody can have
/// the record drop its lines.
const STRANGERS_EVERY_S: u32 = 10;

/// The client's address, added to each request by the server.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Peer(pub IpAddr);

/// Who may make a request, at least.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Least {
    /// Everybody, whatever the configuration says: to sign in.
    Anyone,
    /// As a viewer, and programs at the configured addresses.
    Collector,
    /// A user with this role or more; without signing in everybody is a viewer, unless the
    /// configuration says otherwise.
    User(Role),
}

/// What a row of the table of routes asks for.
#[derive(Clone, Copy, Debug)]
pub struct Rule {
    /// Who may.
    pub least: Least,
    /// The name of the change in the record; none if nothing is changed.
    pub changes: Option<&'static str>,
}

/// The least role of each route that needs more than a viewer, by method and path.
#[derive(Clone, Debug)]
pub struct Needs(pub Arc<Map<String, Value>>);

/// What a change has changed: an extension of the answer, for the record.
#[derive(Clone, Debug, Default)]
pub struct Changed {
    /// In words.
    pub words: String,
    /// The recipe, and the fingerprint of the version that came of it.
    pub recipe: Option<(u16, String)>,
}

impl From<String> for Changed {
    fn from(words: String) -> Self {
        Self {
            words,
            recipe: None,
        }
    }
}

/// What a request with a body may do once its body has come: an extension of the request.
#[derive(Clone, Debug)]
pub(super) struct Permit {
    access: Access,
    token: String,
    rule: Rule,
}

impl Permit {
    /// Checks that its sender still has the role.
    ///
    /// # Errors
    /// It was taken away while the body came.
    pub fn check(&self) -> Answered<()> {
        let signed = self.access.signed_in(&self.token, Instant::now());
        refusal(self.rule, signed.as_ref(), None).map_or(Ok(()), Err)
    }
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

/// Who has made a request.
pub(super) fn signed_in(site: &Site, headers: &HeaderMap) -> Option<Signed> {
    site.access.signed_in(token(headers)?, Instant::now())
}

/// Why a request is refused; `guest` is what somebody may do who has not signed in.
fn refusal(rule: Rule, signed: Option<&Signed>, guest: Option<Least>) -> Option<Problem> {
    let role = match rule.least {
        Least::Anyone => return None,
        Least::Collector if guest == Some(Least::Collector) => return None,
        Least::Collector => Role::Viewer,
        Least::User(role) => role,
    };
    let open = guest == Some(Least::User(Role::Viewer)) && role == Role::Viewer;
    match signed {
        _ if open => None,
        None => {
            let words = "sign in first: POST a user's name and password, or the device's secret, to /api/session";
            Some(Problem::new(StatusCode::UNAUTHORIZED, words))
        }
        Some(signed) if signed.role >= role => None,
        Some(Signed { name, role: own }) => {
            let what = rule
                .changes
                .map_or(String::new(), |what| format!("{what}: "));
            let (is, needed) = (own.with_article(), role.or_more());
            let words = format!("{what}{name} is {is}, and this needs {needed}");
            Some(Problem::new(StatusCode::FORBIDDEN, words).with("role", role.word()))
        }
    }
}

/// What somebody at this address may do without signing in.
fn guest(site: &Site, from: IpAddr) -> Option<Least> {
    // A proxy stands for anybody.
    let collects = holds(&site.collectors, from) && !holds(&site.proxies, from);
    match (site.looking_is_open, collects) {
        (true, _) => Some(Least::User(Role::Viewer)),
        (false, true) => Some(Least::Collector),
        (false, false) => None,
    }
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

/// Lets a request through only for those who may, and records its outcome if it is a change.
pub async fn allowed_only(
    site: Site,
    Extension(Peer(from)): Extension<Peer>,
    Extension(rule): Extension<Rule>,
    mut request: Request,
    next: Next,
) -> Response {
    let subject = request.uri().path().trim_start_matches("/api/").to_owned();
    let token = token(request.headers()).map(str::to_owned);
    let signed = signed_in(&site, request.headers());
    let response = match refusal(rule, signed.as_ref(), guest(&site, from)) {
        Some(problem) => problem.into_response(),
        None => {
            if let (Some(_), Some(token)) = (&signed, token) {
                let access = site.access.clone();
                request.extensions_mut().insert(Permit {
                    access,
                    token,
                    rule,
                });
            }
            if let Some(signed) = &signed {
                request.extensions_mut().insert(signed.clone());
            }
            next.run(request).await
        }
    };
    let Some(action) = rule.changes else {
        return response;
    };
    let refused = response.extensions().get::<ProblemWords>().cloned();
    if signed.is_none() && !is_due(&site) {
        return response;
    }
    let changed = response.extensions().get::<Changed>().cloned();
    record(&site, from, signed, action, subject, refused, changed).await;
    response
}

/// Whether another refusal of a stranger is recorded.
fn is_due(site: &Site) -> bool {
    // From 1 on, as 0 is what nothing was recorded at.
    let now_s = site.station.snapshot().uptime_s.saturating_add(1);
    let last_s = site.stranger_at_s.load(Ordering::Relaxed);
    let due = last_s == 0 || now_s >= last_s + STRANGERS_EVERY_S;
    if due {
        site.stranger_at_s.store(now_s, Ordering::Relaxed);
    }
    due
}

/// Adds a line to the record of changes: why the change was `refused`, else that it was done and what
/// was `changed`, where that is known. If that fails, the log says so.
pub(super) async fn record(
    site: &Site,
    from: IpAddr,
    signed: Option<Signed>,
    action: &'static str,
    subject: String,
    refused: Option<ProblemWords>,
    changed: Option<Changed>,
) {
    let snapshot = site.station.snapshot();
    let (user, role) = signed.map(|signed| (signed.name, signed.role)).unzip();
    let words = changed.as_ref().map(|changed| changed.words.clone());
    let made = changed.and_then(|changed| changed.recipe);
    let change = Change {
        user,
        role,
        outcome: refused.map_or_else(|| "done".into(), |ProblemWords(words)| words),
        changed: words.filter(|words| !words.is_empty()),
        recipe: made
            .as_ref()
            .map(|made| made.0)
            .or_else(|| recipe_of(&subject)),
        fingerprint: made.map(|made| made.1),
        ..Change::of_station(&snapshot, (Way::Page, from), action, subject)
    };
    let stored =
        site.change(move |site| site.access.record().add(&change).map_err(Problem::broken));
    if let Err(problem) = stored.await {
        let line = format!(
            "record the change {action:?}: {}: free space",
            problem.words
        );
        journal::write(Severity::Warning, &line);
        site.log.add(&line);
    }
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
