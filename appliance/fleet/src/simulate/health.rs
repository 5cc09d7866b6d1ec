//! State of a head: snapshot, metrics, recipes, in the shapes of the daemon's API.

use super::figures::{millionths, mixed};
use super::gauge::decision;
use super::head::{Counted, Head};
use super::row::{Found, fingerprint, recipe};
use crate::error::{Exit, Result};
use serde_json::{Value, json};
use std::fmt::Write as _;
use std::io::{Cursor, Write as _};

/// The version that heads report.
const VERSION: &str = env!("CARGO_PKG_VERSION");
/// Distance of projector points from their epipolar lines, millionths of a projector pixel, on a
/// head that is well and one that drifts.
const STEADY: i64 = 80_000;
const DRIFTING: i64 = 600_000;
/// Results of a head's history by verdict, in the order of [`Counted::counts`]. Counts what the head
/// has made since the last call.
fn counts(counted: &mut Counted, head: &Head<'_>) -> [u64; 3] {
    if counted.history != head.history() {
        *counted = Counted {
            history: head.history(),
            ..Counted::default()
        };
    }
    let mut found = Found::default();
    for seq in head.results(counted.last + 1) {
        found.of(head, seq);
        counted.counts[match found.verdict {
            "PASS" => 0,
            "FAIL" => 1,
            _ => 2,
        }] += 1;
        counted.last = seq;
    }
    counted.counts
}

fn drift(head: &Head<'_>) -> i64 {
    if head.character().drifts {
        DRIFTING
    } else {
        STEADY
    }
}

fn latest(head: &Head<'_>) -> Option<Found> {
    let mut found = Found::default();
    found.of(head, head.newest().next()?);
    Some(found)
}

fn temperature(head: &Head<'_>) -> i64 {
    48_000_000 + (mixed(u64::from(head.number)) % 9_000_000) as i64
}

/// `GET /api/snapshot`.
pub(super) fn snapshot(head: &Head<'_>, now_ms: u64) -> Value {
    let latest = latest(head);
    let number = recipe(head.number, head.last());
    let mm = |number: i64| number as f64 / 1e6;
    let gauge = |(gauge, (value, bits)): (&super::gauge::Gauge, &(Option<i64>, u16))| {
        let set = |bit: u16| bits & bit != 0;
        json!({
            "slot": gauge.slot, "name": gauge.name, "unit": gauge.unit, "value": value.map(mm),
            "sigma": mm(gauge.sigma()), "uncertainty": mm(gauge.u()),
            "low": gauge.low.map(mm), "high": gauge.high.map(mm),
            "decision": {
                "pass": set(decision::PASS), "valid": set(decision::VALID), "low": set(decision::LOW),
                "high": set(decision::HIGH), "doubtful": set(decision::DOUBTFUL), "absent": false,
            },
            "reason": value.is_none().then_some(super::gauge::REASON),
        })
    };
    json!({
        "heartbeat": (now_ms / 100) % 65_536,
        "worker_alive": true,
        "uptime_s": now_ms.saturating_sub(head.start_ms()) / 1000,
        "boot_id": &head.history()[..8],
        "state": "READY",
        "ready": true,
        "online": true,
        "warming_up": false,
        "calibration_valid": true,
        "warnings": [],
        "error": null,
        "fault": null,
        "recipe": { "number": number, "fingerprint": fingerprint(head, number), "name": name(number) },
        "counters": {
            "triggers": head.last(), "results": head.last(), "missed": 0, "sequence": head.last(), "buffered": 0,
        },
        "identity": {
            "vendor": "fringed", "product": "fringed 3-D smart sensor", "serial": head.serial(), "version": VERSION,
        },
        "health": { "cpu_temperature_c": mm(temperature(head)), "drift_px": mm(drift(head)), "clock_synchronised": true },
        "result": latest.map(|found| json!({
            "seq": found.seq, "recipe": found.recipe, "recipe_name": name(found.recipe), "verdict": found.verdict,
            "time_utc_us": head.at_ms(found.seq) * 1000, "fingerprint": fingerprint(head, found.recipe),
            "gauges": head.plant.gauges.iter().zip(&found.gauges).map(gauge).collect::<Vec<_>>(),
        })),
    })
}

/// `GET /metrics`: the names, types and labels of the daemon's, with what a plant looks at.
pub(super) fn metrics(head: &Head<'_>, now_ms: u64) -> String {
    let serial = head.serial();
    let uptime = now_ms.saturating_sub(head.start_ms()) / 1000;
    let [pass, fail, invalid] = match head.plant.counted.lock() {
        Ok(mut counted) => counts(counted.entry(head.number).or_default(), head),
        Err(_) => [0; 3],
    };
    let mut out = format!(
        "# TYPE fringed_build info\nfringed_build_info{{version=\"{VERSION}\",serial=\"{serial}\"}} 1\n\
         # TYPE fringed_ready gauge\nfringed_ready 1\n\
         # TYPE fringed_fault gauge\nfringed_fault 0\n\
         # TYPE fringed_measuring_task_alive gauge\nfringed_measuring_task_alive 1\n\
         # TYPE fringed_state gauge\nfringed_state 3\n\
         # TYPE fringed_error_code gauge\nfringed_error_code 0\n\
         # TYPE fringed_buffered_results gauge\nfringed_buffered_results 0\n\
         # TYPE fringed_uptime_seconds gauge\nfringed_uptime_seconds {uptime}\n\
         # TYPE fringed_temperature_celsius gauge\nfringed_temperature_celsius{{part=\"processor\"}} {}\n\
         # TYPE fringed_drift_pixels gauge\nfringed_drift_pixels {}\n\
         # TYPE fringed_results counter\n\
         fringed_results_total{{verdict=\"PASS\"}} {pass}\n\
         fringed_results_total{{verdict=\"FAIL\"}} {fail}\n\
         fringed_results_total{{verdict=\"INVALID\"}} {invalid}\n\
         # TYPE fringed_triggers counter\nfringed_triggers_total {}\n\
         # TYPE fringed_missed_triggers counter\nfringed_missed_triggers_total 0\n",
        millionths(temperature(head)),
        millionths(drift(head)),
        head.last(),
    );
    if let Some(found) = latest(head) {
        // Writing to a string cannot fail.
        let _ = write!(
            out,
            "# TYPE fringed_cycle_seconds gauge\n\
             fringed_cycle_seconds{{part=\"exposure\"}} {}\nfringed_cycle_seconds{{part=\"total\"}} {}\n\
             # TYPE fringed_coverage_ratio gauge\nfringed_coverage_ratio {}\n\
             # TYPE fringed_gauge gauge\n",
            millionths(i64::from(found.exposure_us)),
            millionths(i64::from(found.exposure_us + found.processing_us)),
            millionths(i64::from(found.coverage) * 1000),
        );
        for (gauge, (value, _)) in head.plant.gauges.iter().zip(&found.gauges) {
            let name = gauge.name.replace('"', "\\\"");
            let value = value.map_or("NaN".into(), millionths);
            let (unit, slot) = (gauge.unit, gauge.slot);
            let _ = writeln!(
                out,
                "fringed_gauge{{gauge=\"{name}\",unit=\"{unit}\",slot=\"{slot}\"}} {value}"
            );
        }
    }
    out + "# EOF\n"
}

fn name(number: u16) -> String {
    format!("Bracket {number}")
}

/// The numbers of a head's recipes.
pub(super) fn numbers(head: &Head<'_>) -> impl Iterator<Item = u16> + use<> {
    1..=if head.number.is_multiple_of(4) { 2 } else { 1 }
}

/// `GET /api/recipes`.
pub(super) fn recipes(head: &Head<'_>) -> Value {
    let rows: Vec<Value> = numbers(head)
        .map(|number| {
            json!({
                "number": number, "name": name(number), "part_number": 100 + number,
                "fingerprint": fingerprint(head, number).repeat(8), "taught_at_unix_s": 1_790_000_000,
                "features": 0, "gauges": head.plant.gauges.len(), "judges_nothing": false, "frames": 12,
                "before": null,
            })
        })
        .collect();
    json!({ "free": rows.len() + 1, "recipes": rows, "deleted": [] })
}

/// A recipe's file: an archive with a manifest, and arrays of 100 kB that no compression makes
/// smaller.
///
/// # Errors
/// If the archive cannot be made.
pub(super) fn file(head: &Head<'_>, number: u16) -> Result<Vec<u8>> {
    let manifest = json!({
        "format": "fringed recipe", "number": number, "name": name(number),
        "fingerprint": fingerprint(head, number).repeat(8),
    });
    let seed = mixed(head.plant.seed) ^ u64::from(number);
    let golden: Vec<u8> = (0..12_500u64)
        .flat_map(|place| mixed(seed ^ place << 16).to_le_bytes())
        .collect();
    archive(&[
        ("recipe.json", format!("{manifest:#}\n").as_bytes()),
        ("golden.npy", &golden),
    ])
}

/// `GET /api/diagnostics.zip`: configuration and calibration, and what a person asks for.
///
/// # Errors
/// If the archive cannot be made.
pub(super) fn diagnostics(head: &Head<'_>, now_ms: u64) -> Result<Vec<u8>> {
    let snapshot = format!("{:#}\n", snapshot(head, now_ms));
    let configuration = configuration(head);
    let calibration = json!({ "format": "fringed calibration", "made_by": head.serial() });
    archive(&[
        ("snapshot.json", snapshot.as_bytes()),
        ("fringed.toml", configuration.as_bytes()),
        ("calibration.json", calibration.to_string().as_bytes()),
    ])
}

/// The configuration file of a head.
fn configuration(head: &Head<'_>) -> String {
    format!("# Head {}\n[http]\nlisten = \"0.0.0.0:80\"\n", head.number)
}

fn archive(members: &[(&str, &[u8])]) -> Result<Vec<u8>> {
    let failed = Exit::Software.because::<std::io::Error>("pack an archive");
    let mut zip = zip::ZipWriter::new(Cursor::new(Vec::new()));
    let stored =
        zip::write::SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored);
    for (name, content) in members {
        zip.start_file(*name, stored)
            .map_err(|error| failed(error.into()))?;
        zip.write_all(content).map_err(&failed)?;
    }
    let packed = zip.finish().map_err(|error| failed(error.into()))?;
    Ok(packed.into_inner())
}
