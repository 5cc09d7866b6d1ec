//! The record of changes: a list, newest first, and all of it as CSV.

use super::downloads::{ToClient, attachment};
use super::look::dated;
use super::problem::{Answered, Problem};
use super::request::Query;
use super::site::Site;
use crate::access::record::{CSV_COLUMNS, RecordFilter, csv_line};
use axum::response::{IntoResponse, Json, Response};
use serde_json::{Value, json};
use std::io::Write as _;

/// Lines of a list, unless it asks for another number, and the most.
const USUAL: usize = 200;
const MOST: usize = 10_000;

pub(super) async fn list(
    site: Site,
    Query(mut filter): Query<RecordFilter>,
) -> Answered<Json<Value>> {
    let limit = filter.limit.unwrap_or(USUAL);
    if !(1..=MOST).contains(&limit) {
        return Err(Problem::unclear(format!(
            "limit={limit}: write 1 to {MOST}"
        )));
    }
    // One more shows whether there are others.
    filter.limit = Some(limit + 1);
    let read = site.aside(move |site| {
        let failed = |error| Problem::broken(format!("read the record of changes: {error}"));
        let mut changes = site.access.record().list(&filter).map_err(failed)?;
        let more = changes.len() > limit;
        changes.truncate(limit);
        Ok((dated(site, changes), more))
    });
    let (changes, more) = read.await?;
    Ok(Json(json!({ "changes": changes, "more": more })))
}

pub(super) async fn csv(site: Site, Query(filter): Query<RecordFilter>) -> Answered<Response> {
    let permit = site.files.clone().try_acquire_owned();
    let permit = permit.map_err(|_| Problem::crowded("too many files are being sent: wait"))?;
    let (mut to, body) = ToClient::new();
    let record = site.access.record().clone();
    tokio::task::spawn_blocking(move || {
        let _permit = permit;
        let written = to.write_all(CSV_COLUMNS.as_bytes()).and_then(|()| {
            let mut sent = Ok(());
            let read = record.each(&filter, |line| {
                sent = to.write_all(csv_line(&line).as_bytes());
                sent.is_ok()
            });
            read.and(sent)
        });
        to.end(written);
    });
    let headers = attachment("text/csv; charset=utf-8", "changes.csv");
    Ok((headers, body).into_response())
}
