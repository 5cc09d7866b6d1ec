//! Which answer a request gets.

use super::body::{PIECE, Pieces, Then};
use super::fault::Fault;
use super::head::{Head, Plant};
use super::row::{Found, Start};
use super::{csv, health, hostile, now_ms};
use hyper::body::Bytes;
use hyper::header::{CONTENT_TYPE, LOCATION};
use hyper::{Response, StatusCode, Uri};
use std::future::pending;
use std::io;
use std::sync::Arc;
use std::time::Duration;

/// The most results of one answer.
const MOST_RESULTS: u32 = 10_000;
/// A slow head sends so many bytes, then pauses: 10 kB/s.
const SLOW: (usize, Duration) = (1000, Duration::from_millis(100));
/// A head that breaks off has sent so many bytes: the header and some of a result.
const CUT: usize = 700;

type Answer = Response<Pieces>;

/// The answer to a request of the path and query `uri`.
///
/// # Errors
/// If the head is off: the connection is to be closed without an answer.
pub(super) async fn answer(plant: &Arc<Plant>, uri: &Uri) -> io::Result<Answer> {
    let now_ms = now_ms();
    let path = uri
        .path()
        .strip_prefix("/h/")
        .and_then(|path| path.split_once('/'));
    let head =
        path.and_then(|(number, path)| Some((plant.head(number.parse().ok()?, now_ms)?, path)));
    let Some((head, path)) = head else {
        return Ok(status(StatusCode::NOT_FOUND, "no such head"));
    };
    let fault = head.ails();
    match fault {
        Some(Fault::Silence) => pending().await,
        Some(Fault::Restart) => return Err(io::ErrorKind::ConnectionReset.into()),
        _ => {}
    }
    let query = Query(uri.query().unwrap_or_default());
    let (kind, body) = match path {
        "api/results" => {
            let after = query.number("after").unwrap_or(0);
            if fault == Some(Fault::Redirect) {
                return Ok(redirect(&head, uri));
            }
            let body = fault.and_then(|fault| hostile::body(plant, &head, fault, after));
            let limit = query
                .number("limit")
                .unwrap_or(MOST_RESULTS)
                .min(MOST_RESULTS);
            (
                "application/x-ndjson",
                body.unwrap_or_else(|| results(plant, &head, after, limit)),
            )
        }
        "api/history.csv" => {
            let before = query.number("before_seq").unwrap_or(u32::MAX);
            let limit = query.number("limit").unwrap_or(csv::MOST).min(csv::MOST);
            (
                "text/csv; charset=utf-8",
                Pieces::whole(history(&head, before, limit)),
            )
        }
        "healthz" => ("text/plain", Pieces::whole("ok\n")),
        "metrics" => (
            "application/openmetrics-text; version=1.0.0; charset=utf-8",
            Pieces::whole(health::metrics(&head, now_ms)),
        ),
        "api/snapshot" => (
            "application/json",
            Pieces::whole(health::snapshot(&head, now_ms).to_string()),
        ),
        "api/recipes" => (
            "application/json",
            Pieces::whole(health::recipes(&head).to_string()),
        ),
        "api/diagnostics.zip" => packed(health::diagnostics(&head, now_ms))?,
        _ => match recipe(path).filter(|&number| health::numbers(&head).any(|one| one == number)) {
            Some(number) => packed(health::file(&head, number))?,
            None => return Ok(status(StatusCode::NOT_FOUND, "no such path")),
        },
    };
    let body = match fault {
        Some(Fault::Slow) => body.slowly(SLOW.0, SLOW.1),
        Some(Fault::Cut) => body.cut_after(CUT),
        _ => body,
    };
    let mut response = Response::new(body);
    if let Ok(kind) = kind.parse() {
        response.headers_mut().insert(CONTENT_TYPE, kind);
    }
    Ok(response)
}

fn packed(bytes: crate::error::Result<Vec<u8>>) -> io::Result<(&'static str, Pieces)> {
    let bytes = bytes.map_err(io::Error::other)?;
    Ok(("application/zip", Pieces::whole(bytes)))
}

/// The number of `api/recipes/N/file`.
fn recipe(path: &str) -> Option<u16> {
    let number = path.strip_prefix("api/recipes/")?.strip_suffix("/file")?;
    number.parse().ok()
}

fn status(status: StatusCode, words: &'static str) -> Answer {
    let mut response = Response::new(Pieces::whole(format!("{{\"error\":\"{words}\"}}")));
    *response.status_mut() = status;
    response
}

/// The results of the next head.
fn redirect(head: &Head<'_>, uri: &Uri) -> Answer {
    let next = head.number % head.plant.heads + 1;
    let query = uri.query().unwrap_or_default();
    let mut response = status(StatusCode::TEMPORARY_REDIRECT, "elsewhere");
    if let Ok(place) = format!("/h/{next:04}/api/results?{query}").parse() {
        response.headers_mut().insert(LOCATION, place);
    }
    response
}

/// The header and the results behind `after`, made piece by piece.
fn results(plant: &Arc<Plant>, head: &Head<'_>, after: u32, limit: u32) -> Pieces {
    let header = head.header().into_bytes();
    let (plant, number, now_ms) = (plant.clone(), head.number, head.now_ms());
    let (mut header, mut next, mut left) = (Some(header), after.saturating_add(1), limit);
    let mut found = Found::default();
    Pieces::new(move |out| {
        out.append(&mut header.take().unwrap_or_default());
        let Some(head) = plant.head(number, now_ms) else {
            return Then::End;
        };
        let start = Start::of(&head);
        for seq in head.results(next) {
            if left == 0 {
                return Then::End;
            }
            if out.len() >= PIECE {
                return Then::More;
            }
            found.of(&head, seq);
            found.line(out, &head, &start);
            next = seq.saturating_add(1);
            left -= 1;
        }
        Then::End
    })
}

fn history(head: &Head<'_>, before: u32, limit: u32) -> Bytes {
    let mut out = csv::header(&head.plant.gauges);
    let mut found = Found::default();
    let results = head.newest().filter(|&seq| seq < before);
    for seq in results.take(limit as usize) {
        found.of(head, seq);
        out.push_str(&csv::line(head, &found));
    }
    out.into()
}

/// The query of a request.
struct Query<'a>(&'a str);

impl Query<'_> {
    /// The number of this name.
    fn number(&self, name: &str) -> Option<u32> {
        let mut parts = self.0.split('&').filter_map(|part| part.split_once('='));
        parts.find(|(one, _)| *one == name)?.1.parse().ok()
    }
}
