//! The snapshot as JSON, and as server-sent events: whenever it changes, and once a second so that the
//! page knows that it is current. Lengths in mm, angles in °, volumes in mm³, shares 0…1.
//!
//! The connection of a follower ends with its stream, and that of a refused one with the refusal, so
//! its slot is free again.

use super::gate::Peer;
use super::problem::Problem;
use super::site::{MAX_FOLLOWERS, MAX_FOLLOWERS_EACH, Site};
use super::slots::Slot;
use crate::station::result::flag;
use crate::station::snapshot::{status, warning};
use crate::station::{
    GaugeValue, Health, Micros, Placement, ResultRecord, Snapshot, StationHandle, error_code,
};
use axum::Extension;
use axum::http::{HeaderValue, StatusCode, header};
use axum::response::sse::{Event, Sse};
use axum::response::{IntoResponse, Response};
use serde_json::{Value, json};
use std::convert::Infallible;
use std::time::{Duration, Instant};
use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;

/// The whole snapshot.
pub fn snapshot(snapshot: &Snapshot) -> Value {
    let in_flight = u32::from(snapshot.is(status::BUSY) || snapshot.is(status::PROCESSING));
    json!({
        "heartbeat": snapshot.heartbeat,
        "worker_alive": snapshot.worker_alive,
        "uptime_s": snapshot.uptime_s,
        "boot_id": format!("{:08x}", snapshot.boot_id),
        "state": snapshot.state_word,
        "ready": snapshot.is(status::READY),
        "online": snapshot.is(status::ONLINE),
        "warming_up": snapshot.is(status::WARMING_UP),
        "calibration_valid": snapshot.is(status::CALIBRATION_VALID),
        "missed_trigger": snapshot.is(status::MISSED_TRIGGER),
        "buffer_overflow": snapshot.is(status::BUFFER_OVERFLOW),
        "warnings": warning::words(snapshot.warnings).collect::<Vec<_>>(),
        "error": snapshot.error.as_ref().map(|words| json!({
            "code": snapshot.error_code, "family": error_code::family(snapshot.error_code), "words": words,
        })),
        "fault": snapshot.fault.as_ref().map(|fault| json!({
            "code": fault.code, "family": error_code::family(fault.code), "cause": fault.cause, "remedy": fault.remedy,
        })),
        "recipe": snapshot.recipe.as_ref().map(|recipe| json!({
            "number": recipe.number, "fingerprint": format!("{:08x}", recipe.crc), "name": recipe.name,
        })),
        "refusal": snapshot.refusal.map(|reason| json!({ "reason": reason, "words": snapshot.refusal_words() })),
        "requested_recipe": snapshot.requested_recipe,
        "recipe_result": snapshot.recipe_result.number(),
        "counters": {
            "triggers": snapshot.triggers,
            "results": snapshot.triggers.wrapping_sub(in_flight),
            "missed": snapshot.missed,
            "sequence": snapshot.result_seq,
            "buffered": snapshot.buffered,
        },
        "last_token": snapshot.last_token,
        "load": snapshot.load,
        "teach": snapshot.teach,
        "identity": snapshot.identity,
        "health": health(&snapshot.health),
        "result": snapshot.result.as_deref().map(result),
    })
}

/// Measured values of system, head and clients; null where not known.
fn health(health: &Health) -> Value {
    let pace = &health.pace;
    let mut shown = json!(health);
    shown["camera_hz"] = json!(f64::from(pace.camera_centihertz) / 100.0);
    shown["projector_hz"] = json!(f64::from(pace.refresh_millihertz) / 1000.0);
    let system = &health.system;
    shown["power"] = json!(
        system
            .power
            .map(|power| json!({ "now": power.now(), "since_start": power.since_start() }))
    );
    shown["drift_px"] = json!(health.drift.map(|drift| drift.rms_px));
    let version =
        |numbers: Option<[u16; 2]>| numbers.map(|[major, minor]| format!("{major}.{minor}"));
    shown["kernel"] = json!(version(system.kernel));
    shown["libcamera"] = json!(version(system.libcamera));
    shown
}

fn result(record: &ResultRecord) -> Value {
    let found = &record.inspection;
    let mut shown = json!(record);
    shown["fingerprint"] = json!(format!("{:08x}", record.recipe_crc));
    for (name, bit) in [
        ("simulated", flag::SIMULATED),
        ("doubtful", flag::DOUBTFUL),
        ("judges_nothing", flag::JUDGES_NOTHING),
    ] {
        shown[name] = json!(record.flags() & bit != 0);
    }
    shown["gauges"] = found.gauges.iter().map(gauge).collect();
    shown["placement"] = found.placement.as_ref().map(placement).into();
    shown["processing_us"] = json!(record.stages().processing_us());
    shown["stages"] = json!(record.stages());
    shown
}

/// Shifts in mm, turns in degrees; null where the part's shape does not determine them.
fn placement(placement: &Placement) -> Value {
    json!({
        "components": Placement::COMPONENTS,
        "values": placement.values,
        "reach_mm": placement.reach_mm,
        "outliers": placement.outliers,
    })
}

fn gauge(gauge: &GaugeValue) -> Value {
    let mut shown = json!(gauge);
    shown["unit"] = json!(gauge.unit.symbol());
    shown
}

/// Longest time between two events.
const HEARTBEAT: Duration = Duration::from_secs(1);
/// Shortest time between two events.
const SHORTEST: Duration = Duration::from_millis(200);

/// Marks an answer that goes on until its page is closed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Following;

/// The stream of one page; ends when the page is closed, or when another address gets its slot.
pub(super) async fn follow(site: Site, Extension(Peer(address)): Extension<Peer>) -> Response {
    let mut response = match site.followers.enter(site.holder(address), Instant::now()) {
        Some(slot) => stream(site.station.clone(), slot),
        None => {
            let words = format!(
                "{MAX_FOLLOWERS} pages are open already, or {MAX_FOLLOWERS_EACH} from this address; close one"
            );
            Problem::new(StatusCode::SERVICE_UNAVAILABLE, words).into_response()
        }
    };
    let close = HeaderValue::from_static("close");
    response.headers_mut().insert(header::CONNECTION, close);
    response
}

fn stream(handle: StationHandle, slot: Slot) -> Response {
    slot.mark(None);
    let (sender, receiver) = mpsc::channel::<Result<Event, Infallible>>(1);
    tokio::spawn(async move {
        tokio::select! {
            () = send(handle, sender) => {}
            () = slot.left() => {}
        }
    });
    let events = Sse::new(ReceiverStream::new(receiver));
    (Extension(Following), events).into_response()
}

async fn send(handle: StationHandle, sender: mpsc::Sender<Result<Event, Infallible>>) {
    let mut snapshots = handle.subscribe();
    loop {
        let shown = snapshots.borrow_and_update().clone();
        let event = Event::default()
            .event("snapshot")
            .data(snapshot(&shown).to_string());
        if sender.send(Ok(event)).await.is_err() {
            return;
        }
        let heartbeat = tokio::time::sleep(HEARTBEAT);
        tokio::time::sleep(SHORTEST).await;
        // An event that only shows the time is not worth sending before the heartbeat.
        let something = snapshots.wait_for(|now| timeless(now) != timeless(&shown));
        tokio::select! {
            () = heartbeat => {}
            () = sender.closed() => return,
            changed = something => if changed.is_err() { return },
        }
    }
}

/// The snapshot without the values that change with every tick.
fn timeless(snapshot: &Snapshot) -> Snapshot {
    Snapshot {
        at: Micros(0),
        uptime_s: 0,
        heartbeat: 0,
        ..snapshot.clone()
    }
}
