//! Files to take along: point cloud, gauges, and everything that a distant colleague needs.

use std::convert::Infallible;
use std::io::{Cursor, Write as _};
use std::path::Path;

use axum::body::{Body, Bytes};
use axum::extract::State;
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde_json::{Value, json};
use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;
use zip::result::ZipError;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

use super::problem::Problem;
use super::site::Site;
use super::{metrics, view};
use crate::history::{FailedPart, Filter};

/// Bytes of a file that are handed to a connection at a time.
const CHUNK: usize = 64 << 10;

/// A file to be stored under a name, both made by `work`; a few at a time.
///
/// # Errors
/// Too many are on their way, or what `work` answers.
pub(super) async fn file(
    site: &Site,
    kind: &'static str,
    work: impl FnOnce(&Site) -> Result<(String, Vec<u8>), Problem> + Send + 'static,
) -> Result<Response, Problem> {
    let permit = site.files.clone().try_acquire_owned().map_err(|_| {
        let words = "too many files are being taken along already: wait until one is done";
        Problem::new(StatusCode::SERVICE_UNAVAILABLE, words)
    })?;
    let (name, bytes) = site.aside(work).await?;
    let headers = [
        (header::CONTENT_TYPE, kind.to_owned()),
        (header::CONTENT_LENGTH, bytes.len().to_string()),
        (
            header::CONTENT_DISPOSITION,
            format!("attachment; filename=\"{name}\""),
        ),
    ];
    let (sender, receiver) = mpsc::channel::<Result<Bytes, Infallible>>(1);
    tokio::spawn(async move {
        // Held until the client has taken the file or is gone.
        let _permit = permit;
        let mut rest = Bytes::from(bytes);
        while !rest.is_empty() {
            let chunk = rest.split_to(CHUNK.min(rest.len()));
            if sender.send(Ok(chunk)).await.is_err() {
                return;
            }
        }
    });
    Ok((headers, Body::from_stream(ReceiverStream::new(receiver))).into_response())
}

pub(super) async fn cloud(State(site): State<Site>) -> Result<Response, Problem> {
    file(&site, "application/octet-stream", |site| {
        let asked = site.maps.ask(|cycle| {
            let cloud = cycle.plan.cloud(cycle.frames)?;
            Some((format!("{}.ply", cycle.seq()), cloud))
        });
        asked.flatten().ok_or_else(|| Problem::missing(GONE))
    })
    .await
}

/// Without frames there is nothing to take along.
const GONE: &str =
    "the frames of the last result are gone, or the station is busy; trigger a measurement";

pub(super) async fn recording(State(site): State<Site>) -> Result<Response, Problem> {
    file(&site, "application/zip", |site| {
        let asked = site.maps.ask(|cycle| FailedPart {
            record: cycle.record.clone(),
            frames: cycle.frames.to_vec(),
            plan: cycle.plan.clone(),
            calibration: cycle.calibration.clone(),
        });
        let part = asked.ok_or_else(|| Problem::missing(GONE))?;
        let folder = site.history.scratch();
        let written = part.write(&folder);
        let packed = written.map_err(|error| error.to_string()).and_then(|()| {
            zipped(&folder).map_err(|error| format!("pack the recording: {error}: free space"))
        });
        // Whatever cannot be removed now, the next start removes.
        let _ = std::fs::remove_dir_all(&folder);
        let name = format!("{}-recording.zip", part.record.seq);
        Ok((name, packed.map_err(Problem::broken)?))
    })
    .await
}

pub(super) async fn gauges(State(site): State<Site>) -> Result<Response, Problem> {
    file(&site, "text/csv; charset=utf-8", gauges_csv).await
}

fn gauges_csv(site: &Site) -> Result<(String, Vec<u8>), Problem> {
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
    Ok((format!("{}.csv", result.seq), csv.into_bytes()))
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
    file(&site, "application/zip", |site| {
        let packed = pack(site).map_err(|error| Problem::broken(error.to_string()));
        let serial = &site.station.snapshot().identity.serial;
        let safe: String = serial.chars().filter(char::is_ascii_alphanumeric).collect();
        Ok((format!("fringed-{safe}.zip"), packed?))
    })
    .await
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
