//! Answers that change nothing: snapshot, pictures, registers, log, record of changes, health and
//! readiness.

use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Json, Response};
use serde::Deserialize;
use serde_json::{Value, json};

use super::map::{Drawn, Map, Plane, Sampling, map, surface};
use super::problem::{Answered, Problem};
use super::request::{Path, Query};
use super::site::Site;
use super::view;
use crate::recipe::plan::{Layers, ShownDeviation};
use crate::recipe::{FeatureView, RecipeId};
use crate::station::Verdict;
use crate::station::snapshot::status;

/// The description of this API.
pub const OPENAPI: &str = include_str!("openapi.json");

pub(super) async fn openapi() -> impl IntoResponse {
    ([(header::CONTENT_TYPE, "application/json")], OPENAPI)
}

pub(super) async fn snapshot(site: Site) -> Json<Value> {
    Json(view::snapshot(&site.station.snapshot()))
}

pub(super) async fn health(site: Site) -> Response {
    if site.station.snapshot().worker_alive {
        (StatusCode::OK, "ok\n").into_response()
    } else {
        let words = "the measuring task missed its deadline\n";
        (StatusCode::SERVICE_UNAVAILABLE, words).into_response()
    }
}

pub(super) async fn readiness(site: Site) -> Response {
    let snapshot = site.station.snapshot();
    if snapshot.worker_alive && snapshot.is(status::READY) {
        return (StatusCode::OK, "ready\n").into_response();
    }
    let words = snapshot.refusal_words();
    let words = words.unwrap_or_else(|| "the measuring task missed its deadline".into());
    let words = format!("not ready: {words}\n");
    (StatusCode::SERVICE_UNAVAILABLE, words).into_response()
}

/// The pictures of a measured part.
const LAYERS: [&str; 4] = ["height", "deviation", "modulation", SURFACE];
/// The picture that has points.
pub(super) const SURFACE: &str = "surface";
/// The coarsest level of a surface.
const MAX_LEVEL: u32 = 5;
/// The direction in which deviations are measured.
const DIRECTION: &str = "along the normal";

/// How fine a surface is: every 2^level-th pixel, as fine as other maps if left out. Other keys, such
/// as the page's `seq`, by which no browser takes one part's answer for another's, have no meaning.
#[derive(Clone, Copy, Debug, Deserialize)]
pub(super) struct Level {
    level: Option<u32>,
}

impl Level {
    /// Which pixels of frames of `width` columns are sent.
    ///
    /// # Errors
    /// There is no such level.
    pub(super) fn sampling(self, width: usize) -> Answered<Sampling> {
        match self.level {
            None => Ok(Sampling::usual(width)),
            Some(level) if level <= MAX_LEVEL => Ok(Sampling {
                width,
                stride: 1 << level,
            }),
            Some(level) => Err(Problem::unfit(format!(
                "level {level}: write 0 to {MAX_LEVEL}"
            ))),
        }
    }
}

/// What was found on a part.
pub(super) fn found(
    seq: u32,
    verdict: Verdict,
    id: &RecipeId,
    features: &[FeatureView<'_>],
) -> Value {
    json!({
        "seq": seq, "recipe": id.number, "fingerprint": id.fingerprint, "verdict": verdict.word(),
        "features": features,
    })
}

pub(super) async fn features(site: Site) -> Answered<Response> {
    site.aside(|site| {
        let asked = site.last_cycle.ask(|part| {
            let (_, features) = part.plan.look(part.sequence, &part.frames);
            let record = &part.record;
            found(record.seq, record.verdict, part.plan.id(), &features)
        });
        let answer = asked.map(|found| Json(found).into_response());
        Ok(answer.unwrap_or_else(none))
    })
    .await
}

/// Not an error: the page asks for what belongs to every result.
fn none() -> Response {
    let words = "the frames are gone, or nothing was measured yet: trigger a cycle";
    (StatusCode::NO_CONTENT, [("x-none", words)]).into_response()
}

pub(super) async fn picture(
    site: Site,
    Path(layer): Path<String>,
    Query(level): Query<Level>,
) -> Answered<Response> {
    site.aside(move |site| {
        let at = place_of(&layer)?;
        let Some((seq, layers)) = site.last_cycle.layers(site.last_seq()) else {
            return Ok(none());
        };
        Ok(map_of(&layers, at, seq, level)?.into_response())
    })
    .await
}

/// What teaching took for the part, and the place for which it was refused.
pub(super) async fn part_seen(site: Site) -> Answered<Response> {
    site.aside(|site| {
        let Some(seen) = site.seen.get() else {
            let words = "nothing was taught since the start";
            return Ok((StatusCode::NO_CONTENT, [("x-none", words)]).into_response());
        };
        let sampling = Sampling::usual(seen.width);
        let plane = |name, unit, values| Plane::of(name, unit, values, sampling, Drawn::Plain);
        let planes = [
            plane("modulation", "counts", &seen.modulation[..]),
            plane("part", "", &seen.part),
        ];
        let mut picture = surface(&planes, sampling, None);
        picture.description["place"] = json!(seen.place);
        picture.description["marking"] = json!(seen.marking);
        Ok(picture.into_response())
    })
    .await
}

/// The place of a picture in [`LAYERS`].
///
/// # Errors
/// If there is no such picture.
pub(super) fn place_of(layer: &str) -> Answered<usize> {
    let at = LAYERS.iter().position(|known| *known == layer);
    at.ok_or_else(|| Problem::missing("there are height, deviation, modulation and surface"))
}

/// One of the maps of a part, by its place in [`LAYERS`].
///
/// # Errors
/// There is no such level.
pub(super) fn map_of(layers: &Layers, at: usize, seq: u32, level: Level) -> Answered<Map> {
    let limit = layers.shown.gauge.as_ref().and_then(|gauge| {
        let limits = [gauge.low, gauge.high].into_iter().flatten();
        limits.map(f64::abs).max_by(f64::total_cmp)
    });
    let deviation = Drawn::Deviation { limit };
    if LAYERS[at] == SURFACE {
        let sampling = level.sampling(layers.width)?;
        let mut planes = Plane::points(layers.points(sampling.stride));
        planes.extend([
            Plane::of("deviation", "mm", &layers.deviation_mm, sampling, deviation),
            Plane::of(
                "modulation",
                "counts",
                &layers.modulation,
                sampling,
                Drawn::Plain,
            ),
        ]);
        return Ok(surface(&planes, sampling, Some(seq)));
    }
    let (values, unit, drawn) = [
        (&layers.height_mm, "mm", Drawn::Plain),
        (&layers.deviation_mm, "mm", deviation),
        (&layers.modulation, "counts", Drawn::Plain),
    ][at];
    let mut map = map(values, layers.width, unit, drawn, Some(seq));
    let words = [
        "z of each pixel, as the part lies".into(),
        words(&layers.shown),
        "modulation of the finest fringes, as the part lies".into(),
    ];
    map.description["words"] = words[at].clone().into();
    if LAYERS[at] == "deviation" {
        let shown = &layers.shown;
        map.description["shown"] = json!({
            "side": shown.side, "motion_taken_back": shown.placed, "gauge": shown.gauge,
        });
    }
    Ok(map)
}

/// What a map of deviations shows, for people.
fn words(shown: &ShownDeviation) -> String {
    let motion = match (shown.aligned, shown.placed) {
        (true, true) => "motion taken back",
        (true, false) => "motion not found and not taken back",
        (false, _) => "as the part lies",
    };
    let ShownDeviation { side, gauge, .. } = shown;
    let mean = match side {
        1 => "pixel by pixel".into(),
        side => format!("mean over {side} × {side} px"),
    };
    let colours = match gauge {
        Some(gauge) if gauge.low.or(gauge.high).is_some() => {
            format!("colours to twice the limits of {}", gauge.name)
        }
        Some(gauge) => format!("{} has no limits", gauge.name),
        None => "no gauge of this recipe measures it".into(),
    };
    format!("deviation from golden {DIRECTION}, {motion}, {mean}; {colours}")
}

pub(super) async fn registers(site: Site) -> Json<Value> {
    Json((site.registers)(&site.station.snapshot()))
}

pub(super) async fn log(site: Site) -> Answered<Json<Value>> {
    let lines = site
        .aside(|site| Ok(dated(site, site.log.latest())))
        .await?;
    Ok(Json(json!({ "lines": lines })))
}

/// Adds to lines without a time the time by a browser's clock, if the start of their `boot_id`, or
/// this one, was dated by one.
pub(super) fn dated(site: &Site, mut lines: Vec<Value>) -> Vec<Value> {
    // The times of starts are in the history.
    let starts = site.history.starts().unwrap_or_default();
    let this = format!("{:08x}", site.station.snapshot().boot_id);
    for line in lines.iter_mut().filter(|line| line["utc_us"].is_null()) {
        let start = starts.get(line["boot_id"].as_str().unwrap_or(&this));
        if let (Some(start), Some(s)) = (start, line["uptime_s"].as_u64()) {
            line["browser_utc_us"] = start.saturating_add(s.saturating_mul(1_000_000)).into();
        }
    }
    lines
}
