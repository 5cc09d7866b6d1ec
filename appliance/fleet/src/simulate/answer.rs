//! Which answer a request gets.

use super::body::{Body, body};
use super::fault::Fault;
use super::head::{Head, Plant};
use super::row::{line, row};
use super::{csv, health, hostile};
use hyper::header::{CONTENT_TYPE, HeaderName, LOCATION};
use hyper::{Response, StatusCode, Uri};
use std::future::pending;
use std::io;
use std::iter::once;
use std::sync::Arc;

/// The most results of one answer.
const MOST_RESULTS: u32 = 10_000;

type Answer = Response<Body>;

/// The answer to a request of the path and query `uri`.
///
/// # Errors
/// If the head is off: the connection is to be closed without an answer.
pub(super) async fn answer(plant: &Arc<Plant>, uri: &Uri) -> io::Result<Answer> {
    let path = uri.path().strip_prefix("/h/");
    let path = path.and_then(|path| path.split_once('/'));
    let head = path.and_then(|(number, path)| {
        let head = plant.head(number.parse().ok()?, crate::now_ms())?;
        Some((head, path))
    });
    let Some((head, path)) = head else {
        return Ok(status(StatusCode::NOT_FOUND));
    };
    let fault = head.ails;
    match fault {
        Some(Fault::Silence) => pending().await,
        Some(Fault::Restart) => return Err(io::ErrorKind::ConnectionReset.into()),
        _ => {}
    }
    let query = uri.query().unwrap_or_default();
    let number = |name: &str, default: u32| {
        let mut parts = query.split('&').filter_map(|part| part.split_once('='));
        let given = parts.find(|(one, _)| *one == name);
        given
            .and_then(|(_, text)| text.parse().ok())
            .unwrap_or(default)
    };
    let (kind, whole) = match path {
        "api/results" if fault == Some(Fault::Redirect) => {
            let elsewhere = format!("/h/{:04}/api/results?{query}", head.next());
            let answer = status(StatusCode::TEMPORARY_REDIRECT);
            return Ok(with(answer, LOCATION, &elsewhere));
        }
        "api/results" => {
            let after = number("after", 0);
            let limit = number("limit", MOST_RESULTS).min(MOST_RESULTS);
            let hostile = fault.and_then(|fault| hostile::lines(&head, fault, after));
            let lines = hostile.unwrap_or_else(|| results(&head, after, limit));
            let answer = Response::new(body(lines, fault));
            return Ok(with(answer, CONTENT_TYPE, "application/x-ndjson"));
        }
        "api/history.csv" => {
            let before = number("before_seq", u32::MAX);
            let text = csv::history(&head, before, number("limit", csv::MOST));
            ("text/csv; charset=utf-8", text.into_bytes())
        }
        "healthz" => ("text/plain", b"ok\n".to_vec()),
        "metrics" => (health::METRICS, health::metrics(&head).into_bytes()),
        "api/snapshot" => ("application/json", line(&health::snapshot(&head))),
        "api/recipes" => ("application/json", line(&health::recipes(&head))),
        "api/diagnostics.zip" => ("application/zip", health::diagnostics(&head)?),
        _ => match recipe(path).filter(|number| health::numbers(&head).contains(number)) {
            Some(number) => ("application/zip", health::file(&head, number)?),
            None => return Ok(status(StatusCode::NOT_FOUND)),
        },
    };
    Ok(with(
        Response::new(body(once(whole), fault)),
        CONTENT_TYPE,
        kind,
    ))
}

/// The number of `api/recipes/N/file`.
fn recipe(path: &str) -> Option<u16> {
    let number = path.strip_prefix("api/recipes/")?.strip_suffix("/file")?;
    number.parse().ok()
}

fn status(status: StatusCode) -> Answer {
    let mut answer = Response::new(body(once(status.to_string().into_bytes()), None));
    *answer.status_mut() = status;
    answer
}

fn with(mut answer: Answer, name: HeaderName, value: &str) -> Answer {
    let value = value.parse().ok();
    value.and_then(|value| answer.headers_mut().insert(name, value));
    answer
}

/// The header and the results behind `after`.
fn results(head: &Head, after: u32, limit: u32) -> hostile::Lines {
    let found = head.results(after.saturating_add(1)).take(limit as usize);
    let (header, head) = (line(&head.header()), head.clone());
    Box::new(once(header).chain(found.map(move |seq| line(&row(&head, seq)))))
}
