//! Files to take along: point cloud, gauges, and everything that a distant colleague needs.

use std::io::{Cursor, Write as _};
use std::path::Path;

use axum::extract::State;
use axum::http::header;
use axum::response::{IntoResponse, Response};
use serde_json::{Value, json};
use zip::result::ZipError;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

use super::problem::Problem;
use super::site::Site;
use super::{metrics, view};
use crate::history::Filter;

/// A file to be stored under a name.
pub(super) fn attachment(kind: &'static str, name: String, bytes: Vec<u8>) -> Response {
    let name = format!("attachment; filename=\"{name}\"");
    let headers = [
        (header::CONTENT_TYPE, kind.to_owned()),
        (header::CONTENT_DISPOSITION, name),
    ];
    (headers, bytes).into_response()
}

pub(super) async fn cloud(State(site): State<Site>) -> Result<Response, Problem> {
    let made = site.aside(|site| {
        let asked = site.maps.ask(|cycle| {
            let cloud = cycle.plan.cloud(cycle.frames)?;
            Some((cycle.seq, cloud))
        });
        let words =
            "the frames of the last result are gone, or the station is busy; trigger a measurement";
        asked.flatten().ok_or_else(|| Problem::missing(words))
    });
    let (seq, cloud) = made.await?;
    Ok(attachment(
        "application/octet-stream",
        format!("{seq}.ply"),
        cloud,
    ))
}

pub(super) async fn gauges(State(site): State<Site>) -> Result<Response, Problem> {
    let snapshot = site.station.snapshot();
    let words = "nothing was measured yet; trigger a measurement";
    let result = snapshot
        .result
        .as_deref()
        .ok_or_else(|| Problem::missing(words))?;
    let mut csv = String::from("seq,verdict,gauge,value,sigma,low,high,unit,pass,valid,doubtful\n");
    let number = |value: Option<f64>| value.map_or(String::new(), |value| value.to_string());
    for gauge in &result.inspection.gauges {
        let decision = gauge.decision;
        csv += &format!(
            "{},{},\"{}\",{},{},{},{},{},{},{},{}\n",
            result.seq,
            result.verdict.word(),
            gauge.name.replace('"', "\"\""),
            number(gauge.value.filter(|_| decision.valid)),
            number(gauge.sigma),
            number(gauge.low),
            number(gauge.high),
            gauge.unit.symbol(),
            u8::from(decision.pass),
            u8::from(decision.valid),
            u8::from(decision.doubtful),
        );
    }
    Ok(attachment(
        "text/csv; charset=utf-8",
        format!("{}.csv", result.seq),
        csv.into_bytes(),
    ))
}

/// A folder and the folders in it as a ZIP.
///
/// # Errors
/// If a file cannot be read.
pub(super) fn zipped(folder: &Path) -> Result<Vec<u8>, ZipError> {
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    let stored = SimpleFileOptions::default().compression_method(CompressionMethod::Stored);
    let mut waiting = vec![folder.to_path_buf()];
    while let Some(here) = waiting.pop() {
        for entry in std::fs::read_dir(here)? {
            let path = entry?.path();
            if path.is_dir() {
                waiting.push(path);
            } else if let Ok(name) = path.strip_prefix(folder) {
                let parts: Vec<_> = name.iter().map(|part| part.to_string_lossy()).collect();
                zip.start_file(parts.join("/"), stored)?;
                zip.write_all(&std::fs::read(&path)?)?;
            }
        }
    }
    Ok(zip.finish()?.into_inner())
}

/// A ZIP of everything that explains a device's behaviour; no secrets.
pub(super) async fn diagnostics(State(site): State<Site>) -> Result<Response, Problem> {
    let packed = site.aside(|site| pack(site).map_err(|error| Problem::broken(error.to_string())));
    let serial = site.station.snapshot().identity.serial.clone();
    let safe: String = serial.chars().filter(char::is_ascii_alphanumeric).collect();
    Ok(attachment(
        "application/zip",
        format!("fringed-{safe}.zip"),
        packed.await?,
    ))
}

fn pack(site: &Site) -> Result<Vec<u8>, ZipError> {
    let snapshot = site.station.snapshot();
    let text = |value: &Value| format!("{value:#}\n");
    let recipes: Vec<Value> = site
        .recipes
        .numbers()
        .into_iter()
        .map(|number| match site.recipes.manifest(number) {
            Ok(file) => serde_json::to_value(file).unwrap_or_default(),
            Err(words) => json!({ "number": number, "error": words }),
        })
        .collect();
    let results = site.history.results(&Filter::default());
    let results = results.map_or_else(|error| json!(error.to_string()), |results| json!(results));
    let changes = site.access.changes().latest().unwrap_or_default();
    let members = [
        ("snapshot.json", text(&view::snapshot(&snapshot))),
        ("registers.json", text(&(site.registers)(&snapshot))),
        ("log.json", text(&Value::from(site.log.latest()))),
        ("changes.json", text(&Value::from(changes))),
        ("results.json", text(&results)),
        ("recipes.json", text(&Value::from(recipes))),
        ("metrics.txt", metrics::text(site)),
        ("fringed.toml", site.configuration.clone()),
    ];
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    let stored = SimpleFileOptions::default().compression_method(CompressionMethod::Stored);
    for (name, content) in members {
        zip.start_file(name, stored)?;
        zip.write_all(content.as_bytes())?;
    }
    Ok(zip.finish()?.into_inner())
}
