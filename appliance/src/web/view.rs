//! A snapshot as the JSON that the page and `/api/snapshot` show. Lengths in mm, angles in °,
//! volumes in mm³, shares 0…1.

use serde_json::{Value, json};

use crate::station::result::flag;
use crate::station::snapshot::{status, warning};
use crate::station::{GaugeValue, Health, Placement, ResultRecord, Snapshot, error_code};

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
