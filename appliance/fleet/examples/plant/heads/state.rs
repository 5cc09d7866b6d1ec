//! State of a head: snapshot, metrics and recipes in the format of the daemon's API, as far as the
//! programs of a plant read them.

use super::Head;
use super::results::{fingerprint, mixed, recipe, row};
use serde_json::{Value, json};
use std::fmt::Write as _;
use std::io::{self, Cursor, Write as _};
use std::ops::RangeInclusive;
use std::sync::PoisonError;
use zip::ZipWriter;
use zip::write::SimpleFileOptions;

/// The version that heads report.
const VERSION: &str = env!("CARGO_PKG_VERSION");
/// Distance of projector points from their epipolar lines, projector pixels, on a head that is well
/// and one that drifts.
const STEADY: f64 = 0.08;
const DRIFTING: f64 = 0.6;
/// What the metrics are.
pub const METRICS: &str = "application/openmetrics-text; version=1.0.0; charset=utf-8";

/// Results of a head's history: PASS, FAIL, INVALID. Works out what was made since the last call.
fn counts(head: &Head) -> [u32; 3] {
    let counted = &head.plant.counted;
    let mut counted = counted.lock().unwrap_or_else(PoisonError::into_inner);
    let of_head = counted.entry((head.number, head.history)).or_default();
    let [last, pass, fail, invalid] = of_head;
    for seq in head.results(*last + 1) {
        *last = seq;
        match &*row(head, seq).verdict {
            "PASS" => *pass += 1,
            "FAIL" => *fail += 1,
            _ => *invalid += 1,
        }
    }
    [*pass, *fail, *invalid]
}

fn drift(head: &Head) -> f64 {
    if head.character.drifts {
        DRIFTING
    } else {
        STEADY
    }
}

/// `GET /api/snapshot`.
pub fn snapshot(head: &Head) -> Value {
    let number = recipe(head, head.last());
    json!({
        "identity": { "serial": head.serial(), "version": VERSION },
        "state": "READY",
        "recipe": { "number": number, "fingerprint": fingerprint(head, number), "name": name(number) },
        "health": { "drift_px": drift(head) },
    })
}

/// `GET /metrics`: the names, types and labels of the daemon's, with what a plant looks at.
pub fn metrics(head: &Head) -> String {
    let mut out = String::new();
    let mut family = |kind: &str, name: &str, samples: &[(&str, f64)]| {
        let end = match kind {
            "counter" => "_total",
            "info" => "_info",
            _ => "",
        };
        // Writing to a string cannot fail.
        let _ = writeln!(out, "# TYPE {name} {kind}");
        for (labels, value) in samples {
            let _ = writeln!(out, "{name}{end}{labels} {value}");
        }
    };
    let build = format!(r#"{{version="{VERSION}",serial="{}"}}"#, head.serial());
    family("info", "fringed_build", &[(&build, 1.0)]);
    let uptime_s = head.now_ms.saturating_sub(head.start_ms) / 1000;
    for (name, value) in [
        ("fringed_ready", 1.0),
        ("fringed_fault", 0.0),
        ("fringed_measuring_task_alive", 1.0),
        ("fringed_state", 3.0),
        ("fringed_error_code", 0.0),
        ("fringed_buffered_results", 0.0),
        ("fringed_uptime_seconds", uptime_s as f64),
        ("fringed_drift_pixels", drift(head)),
        ("fringed_free_storage_bytes", 2e10),
        ("fringed_results_unasked_seconds", 0.0),
    ] {
        family("gauge", name, &[("", value)]);
    }
    let celsius = 48.0 + (mixed(u64::from(head.number)) % 9_000_000) as f64 / 1e6;
    let celsius = (r#"{part="processor"}"#, celsius);
    family("gauge", "fringed_temperature_celsius", &[celsius]);
    let [pass, fail, invalid] = counts(head).map(f64::from);
    let results = [
        (r#"{verdict="PASS"}"#, pass),
        (r#"{verdict="FAIL"}"#, fail),
        (r#"{verdict="INVALID"}"#, invalid),
    ];
    family("counter", "fringed_results", &results);
    family(
        "counter",
        "fringed_triggers",
        &[("", f64::from(head.last()))],
    );
    family("counter", "fringed_missed_triggers", &[("", 0.0)]);
    family("counter", "fringed_unclean_starts", &[("", 0.0)]);
    let clock = (r#"{warning="clock_unsynced"}"#, 0.0);
    family("gauge", "fringed_warning", &[clock]);
    if let Some(row) = head.newest().next().map(|seq| row(head, seq)) {
        let seconds = |us: u32| f64::from(us) / 1e6;
        let cycle = [
            (r#"{part="exposure"}"#, seconds(row.exposure_us)),
            (
                r#"{part="total"}"#,
                seconds(row.exposure_us + row.processing_us),
            ),
        ];
        family("gauge", "fringed_cycle_seconds", &cycle);
        family("gauge", "fringed_coverage_ratio", &[("", row.coverage)]);
        let gauges = row.gauges.iter().map(|gauge| {
            let (name, unit, slot) = (&gauge.name, &gauge.unit, gauge.slot);
            let labels = format!(r#"{{gauge={name:?},unit="{unit}",slot="{slot}"}}"#);
            (labels, gauge.value.unwrap_or(f64::NAN))
        });
        let gauges: Vec<_> = gauges.collect();
        let gauges: Vec<_> = gauges
            .iter()
            .map(|(labels, value)| (&**labels, *value))
            .collect();
        family("gauge", "fringed_gauge", &gauges);
    }
    out + "# EOF\n"
}

fn name(number: u16) -> String {
    format!("Bracket {number}")
}

/// The numbers of a head's recipes.
pub fn numbers(head: &Head) -> RangeInclusive<u16> {
    1..=if head.number.is_multiple_of(4) { 2 } else { 1 }
}

/// A recipe in the list, and in its file.
fn entry(head: &Head, number: u16) -> Value {
    let fingerprint = fingerprint(head, number).repeat(8);
    json!({ "number": number, "name": name(number), "fingerprint": fingerprint })
}

/// `GET /api/recipes`.
pub fn recipes(head: &Head) -> Value {
    let rows: Vec<_> = numbers(head).map(|number| entry(head, number)).collect();
    json!({ "recipes": rows })
}

/// A recipe's file: an archive with a manifest, and arrays of 100 kB that no compression makes
/// smaller.
///
/// # Errors
/// If the archive cannot be made.
pub fn file(head: &Head, number: u16) -> io::Result<Vec<u8>> {
    let seed = mixed(head.plant.options.seed) ^ u64::from(number);
    let golden = (0..12_500).flat_map(|place: u64| mixed(seed ^ place << 16).to_le_bytes());
    archive([
        ("recipe.json", entry(head, number).to_string().into()),
        ("golden.npy", golden.collect()),
    ])
}

/// `GET /api/diagnostics.zip`: configuration and calibration, and what a person asks for.
///
/// # Errors
/// If the archive cannot be made.
pub fn diagnostics(head: &Head) -> io::Result<Vec<u8>> {
    let configuration = format!("# Head {}\n[http]\nlisten = \"0.0.0.0:80\"\n", head.number);
    let calibration = json!({ "format": "fringed calibration", "made_by": head.serial() });
    archive([
        ("snapshot.json", snapshot(head).to_string().into()),
        ("fringed.toml", configuration.into()),
        ("calibration.json", calibration.to_string().into()),
    ])
}

fn archive<const N: usize>(members: [(&str, Vec<u8>); N]) -> io::Result<Vec<u8>> {
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    let stored = SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored);
    for (name, content) in members {
        zip.start_file(name, stored)?;
        zip.write_all(&content)?;
    }
    Ok(zip.finish()?.into_inner())
}
