//! Results for a program that collects those of many stations: a line of JSON each.
//!
//! Cycles must not pay for it. Database and JSON are the work of a thread of its own that runs only
//! where a core has nothing else to do, and rests after each page, because a core that works takes
//! memory and clock from the others; a client that does not receive holds one page of results until
//! its connection is closed, and no more than a few may ask at a time.

use std::io::{self, Write};
use std::sync::atomic::Ordering::Relaxed;
use std::time::{Duration, Instant};

use axum::http::header;
use axum::response::{IntoResponse, Response};
use serde::{Deserialize, Serialize};

use super::downloads::{ToClient, sent_alone};
use super::problem::{Answered, Problem};
use super::request::Query;
use super::site::Site;
use crate::history::carry::EarlierHistory;
use crate::history::export::{After, Page};
use crate::history::{Entry, GaugeEntry};
use crate::station::Verdict;
use crate::station::gauge::decision;
use crate::system::computing;

/// The most results of one answer, and how many it has unless it asks for fewer.
const MOST: usize = 10_000;

/// A rest is so many times as long as the work on a page.
const REST: u32 = 5;
/// But not longer than this: a client that receives slowly has waited already.
const LONGEST: Duration = Duration::from_millis(20);

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct AfterQuery {
    #[serde(default)]
    after: u32,
    limit: Option<usize>,
}

/// The first line.
#[derive(Serialize)]
struct FirstLine<'a> {
    serial: &'a str,
    history: &'a str,
    first: Option<u32>,
    last: Option<u32>,
    /// The results up to a SEQ were kept under another id before.
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    earlier: &'a [EarlierHistory],
}

/// Any other line. Lengths in mm, angles in °, volumes in mm³, shares 0…1.
#[derive(Serialize)]
pub(super) struct Line<'a> {
    serial: &'a str,
    history: &'a str,
    seq: u32,
    at_unix_ms: Option<u64>,
    clock: &'static str,
    recipe: u16,
    fingerprint: &'a str,
    part_id: u32,
    press_stroke: u32,
    request: Option<&'a str>,
    verdict: Verdict,
    reason: Option<&'a str>,
    error_code: u16,
    flags: u16,
    exposure_us: u32,
    processing_us: u32,
    coverage: f64,
    placement: Option<[Option<f64>; 6]>,
    gauges: Vec<Gauge<'a>>,
}

#[derive(Serialize)]
struct Gauge<'a> {
    slot: u16,
    name: &'a str,
    unit: &'a str,
    value: Option<f64>,
    sigma: Option<f64>,
    u: Option<f64>,
    low: Option<f64>,
    high: Option<f64>,
    decision: u16,
    reason: Option<&'a str>,
}

pub(super) async fn after(site: Site, Query(wanted): Query<AfterQuery>) -> Answered<Response> {
    let permit = site.collecting.clone().try_acquire_owned();
    let crowded = "too many programs collect results: wait until one is done";
    let permit = permit.map_err(|_| Problem::crowded(crowded))?;
    let failed = "reading the history failed; see the log";
    let body = sent_alone("collecting", failed, move |mut to, begun| {
        // Held until the client has received everything or is gone.
        let _permit = permit;
        computing::stand_back();
        let now = site.station.snapshot();
        site.collected_at_s.store(now.uptime_s, Relaxed);
        let serial = &*now.identity.serial;
        let limit = wanted.limit.unwrap_or(MOST).min(MOST);
        let walk = site.history.after(wanted.after, limit);
        match walk.and_then(|mut walk| walk.page().map(|page| (walk, page))) {
            Err(error) => drop(begun.send(Err(error.into()))),
            Ok((walk, page)) => {
                if begun.send(Ok(())).is_ok() {
                    let written = write(&mut to, serial, walk, page);
                    to.end(written);
                }
            }
        }
    });
    let body = body.await?;
    Ok(([(header::CONTENT_TYPE, "application/x-ndjson")], body).into_response())
}

fn write(to: &mut ToClient, serial: &str, mut walk: After, mut page: Page) -> io::Result<()> {
    let (history, earlier) = (walk.id().to_owned(), walk.earlier().to_vec());
    let header = FirstLine {
        serial,
        history: &history,
        first: page.first,
        last: page.last,
        earlier: &earlier,
    };
    line(to, &header)?;
    while !page.results.is_empty() {
        let begun = Instant::now();
        for entry in &page.results {
            line(to, &of(serial, &history, entry))?;
        }
        page = walk.page().map_err(io::Error::other)?;
        if !page.results.is_empty() {
            std::thread::sleep((begun.elapsed() * REST).min(LONGEST));
        }
    }
    Ok(())
}

pub(super) fn line(to: &mut ToClient, line: &impl Serialize) -> io::Result<()> {
    serde_json::to_writer(&mut *to, line)?;
    to.write_all(b"\n")
}

pub(super) fn of<'a>(serial: &'a str, history: &'a str, entry: &'a Entry) -> Line<'a> {
    let (us, clock) = match (entry.time_utc_us, entry.browser_utc_us) {
        (Some(us), _) => (Some(us), "synchronised"),
        (None, Some(us)) => (Some(us), "browser"),
        (None, None) => (None, "none"),
    };
    Line {
        serial,
        history,
        seq: entry.seq,
        at_unix_ms: us.map(|us| us / 1000),
        clock,
        recipe: entry.recipe,
        fingerprint: &entry.fingerprint,
        part_id: entry.part_id,
        press_stroke: entry.press_stroke,
        request: entry.request.as_deref(),
        verdict: entry.verdict,
        reason: entry.reason.as_deref(),
        error_code: entry.error_code,
        flags: entry.flags,
        exposure_us: entry.exposure_us,
        processing_us: entry.total_us.saturating_sub(entry.exposure_us),
        coverage: f64::from(entry.coverage_permille) / 1e3,
        placement: entry.placement.map(|placement| placement.values),
        gauges: entry.gauges.iter().map(gauge).collect(),
    }
}

fn gauge(gauge: &GaugeEntry) -> Gauge<'_> {
    Gauge {
        slot: gauge.slot,
        name: &gauge.name,
        unit: &gauge.unit,
        // What is not valid is no number, whatever was found.
        value: gauge
            .value
            .filter(|_| gauge.decision & decision::VALID != 0),
        sigma: gauge.sigma,
        u: gauge.uncertainty,
        low: gauge.low,
        high: gauge.high,
        decision: gauge.decision,
        reason: gauge.reason.as_deref(),
    }
}
