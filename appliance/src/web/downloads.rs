//! Downloads: point cloud, recording and gauges of the last result, and the diagnostic bundle.

use std::fs::File;
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use axum::body::{Body, Bytes};
use axum::http::{HeaderName, header};
use axum::response::{IntoResponse, Response};
use serde_json::{Value, json};
use tokio::sync::mpsc::{self, error::TrySendError};
use tokio::sync::oneshot;
use tokio_stream::StreamExt as _;
use tokio_stream::wrappers::ReceiverStream;
use zip::ZipWriter;
use zip::result::ZipError;

use super::problem::{Answered, Problem};
use super::request::Query;
use super::site::Site;
use super::{metrics, view};
use crate::access::record::RecordFilter;
use crate::history::{Filter, JudgedPart, name_of};
use crate::output::cloud::Pixels;
use crate::output::npz::OrganisedMaps;
use crate::storage::archive::{packed, stored};

/// Bytes of a file that are sent to its client at a time.
const CHUNK: usize = 64 << 10;
/// The same of maps, which have tens of megabytes.
const LARGE_CHUNK: usize = 1 << 20;

/// Lines of the record of changes in the diagnostic bundle.
const MOST_CHANGES: usize = 1000;

/// What is sent.
pub(super) enum Download {
    /// A file in memory.
    Bytes(Vec<u8>),
    /// A stored file.
    Stored(File),
    /// A folder, as a ZIP.
    Folder(Packed),
    /// Maps, as NPZ.
    Maps(Box<OrganisedMaps>),
}

impl Download {
    /// Its bytes, where they are known beforehand.
    fn length(&self) -> io::Result<Option<u64>> {
        Ok(match self {
            Self::Bytes(bytes) => Some(bytes.len() as u64),
            Self::Stored(file) => Some(file.metadata()?.len()),
            Self::Folder(_) | Self::Maps(_) => None,
        })
    }

    fn write(self, to: &mut ToClient) -> io::Result<()> {
        match self {
            Self::Bytes(bytes) => bytes
                .chunks(CHUNK)
                .try_for_each(|chunk| to.write_all(chunk)),
            Self::Stored(mut file) => io::copy(&mut file, to).map(drop),
            Self::Folder(packed) => packed.write(to).map_err(io::Error::other),
            Self::Maps(maps) => {
                to.most = LARGE_CHUNK;
                maps.write(to).map_err(io::Error::other)
            }
        }
    }
}

/// Sends a file whose name and content `work` finds or makes; a few at a time, and each no faster
/// than its client receives it.
///
/// # Errors
/// Too many files are being sent, or what `work` answers.
pub(super) async fn send(
    site: &Site,
    kind: &'static str,
    work: impl FnOnce(&Site) -> Answered<(String, Download)> + Send + 'static,
) -> Answered<Response> {
    let permit =
        site.files.clone().try_acquire_owned().map_err(|_| {
            Problem::crowded("too many files are being sent: wait until one is done")
        })?;
    let (name, content) = site.aside(work).await?;
    let length = content.length();
    let length = length.map_err(|error| Problem::broken(format!("read {name}: {error}")))?;
    let (mut to, body) = ToClient::new();
    tokio::task::spawn_blocking(move || {
        // Held until the client has received the file or is gone.
        let _permit = permit;
        let written = content.write(&mut to);
        to.end(written);
    });
    let length = length.map(|bytes| [(header::CONTENT_LENGTH, bytes.to_string())]);
    Ok((attachment(kind, &name), length, body).into_response())
}

/// The headers of a file that the browser keeps under this name.
pub(super) fn attachment(kind: &str, name: &str) -> [(HeaderName, String); 2] {
    let disposition = format!("attachment; filename=\"{name}\"");
    [
        (header::CONTENT_TYPE, kind.to_owned()),
        (header::CONTENT_DISPOSITION, disposition),
    ]
}

/// The files of a folder, to be sent as a ZIP piece by piece: a recording with its recipe is too
/// large to be in memory for each client.
pub(super) struct Packed {
    /// The folder's name in the ZIP.
    name: String,
    members: Vec<(PathBuf, File)>,
}

impl Packed {
    /// Opens every file in a folder and its subfolders, so that they can be read even if the folder
    /// is removed meanwhile.
    ///
    /// # Errors
    /// Whatever the file system answers.
    pub(super) fn of(folder: &Path, name: String) -> io::Result<Self> {
        let mut members = Vec::new();
        let mut waiting = vec![folder.to_path_buf()];
        while let Some(here) = waiting.pop() {
            for entry in std::fs::read_dir(here)? {
                let path = entry?.path();
                if path.is_dir() {
                    waiting.push(path);
                } else if let Ok(inside) = path.strip_prefix(folder) {
                    members.push((inside.to_path_buf(), File::open(&path)?));
                }
            }
        }
        members.sort_by(|(a, _), (b, _)| a.cmp(b));
        Ok(Self { name, members })
    }

    fn write(self, to: &mut ToClient) -> Result<(), ZipError> {
        let mut zip = ZipWriter::new_stream(to);
        for (inside, mut file) in self.members {
            let parts: Vec<_> = inside.iter().map(|part| part.to_string_lossy()).collect();
            zip.start_file(format!("{}/{}", self.name, parts.join("/")), stored())?;
            io::copy(&mut file, &mut zip)?;
        }
        zip.finish().map(drop)
    }
}

/// Sends bytes to a client, no faster than it receives them; one that does not take a chunk within
/// [`SLOW`] is given up, so that it holds its place no longer.
pub(super) struct ToClient {
    sender: mpsc::Sender<Result<Bytes, io::Error>>,
    chunk: Vec<u8>,
    /// Bytes of a chunk.
    most: usize,
    /// Whether all of the answer was sent.
    whole: Arc<AtomicBool>,
    /// Longest wait for the client to take a chunk.
    slow: Duration,
}

/// Longest wait for a client to take a chunk: a link of 2 kB a second does.
const SLOW: Duration = Duration::from_secs(30);
/// How often it is looked whether it has.
const LOOK: Duration = Duration::from_millis(2);

impl ToClient {
    /// It, and the body of the answer that sends what is written to it.
    pub(super) fn new() -> (Self, Body) {
        let (sender, receiver) = mpsc::channel(1);
        let whole = Arc::new(AtomicBool::new(false));
        let sent = whole.clone();
        let broken = move || {
            let broken = !sent.load(Ordering::Acquire);
            broken.then(|| Err(io::ErrorKind::BrokenPipe.into()))
        };
        let end = tokio_stream::iter(std::iter::once_with(broken).flatten());
        let body = Body::from_stream(ReceiverStream::new(receiver).chain(end));
        let to = Self {
            sender,
            chunk: Vec::new(),
            most: CHUNK,
            whole,
            slow: SLOW,
        };
        (to, body)
    }

    /// Ends the answer. Where writing failed it breaks off, so the client knows that it is not
    /// whole.
    pub(super) fn end(mut self, written: io::Result<()>) {
        let sent = written.and_then(|()| self.flush()).is_ok();
        self.whole.store(sent, Ordering::Release);
    }
}

impl io::Write for ToClient {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.chunk.extend_from_slice(bytes);
        if self.chunk.len() >= self.most {
            self.flush()?;
        }
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        let next = Vec::with_capacity(self.chunk.len());
        let mut chunk = Ok(Bytes::from(std::mem::replace(&mut self.chunk, next)));
        let begun = Instant::now();
        loop {
            chunk = match self.sender.try_send(chunk) {
                Ok(()) => return Ok(()),
                // The client is gone.
                Err(TrySendError::Closed(_)) => return Err(io::ErrorKind::BrokenPipe.into()),
                Err(TrySendError::Full(_)) if begun.elapsed() > self.slow => {
                    return Err(io::ErrorKind::TimedOut.into());
                }
                Err(TrySendError::Full(chunk)) => chunk,
            };
            std::thread::sleep(LOOK);
        }
    }
}

/// Has a thread of its own make an answer and send it, as its priority is changed for good. The thread
/// says when the answer begins, or why there is none.
///
/// # Errors
/// What the thread says; `failed`, where there is no thread or it panics.
pub(super) async fn sent_alone(
    name: &str,
    failed: &str,
    work: impl FnOnce(ToClient, oneshot::Sender<Answered<()>>) + Send + 'static,
) -> Answered<Body> {
    let (to, body) = ToClient::new();
    let (begun, beginning) = oneshot::channel();
    let thread = std::thread::Builder::new().name(name.into());
    let spawned = thread.spawn(move || work(to, begun));
    spawned.map_err(|_| Problem::broken(failed))?;
    beginning.await.map_err(|_| Problem::broken(failed))??;
    Ok(body)
}

/// Which pixels of the part are sent.
#[derive(Debug, Default, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct CloudQuery {
    pixels: Pixels,
}

pub(super) async fn cloud(
    site: Site,
    Query(CloudQuery { pixels }): Query<CloudQuery>,
) -> Answered<Response> {
    send(&site, "application/octet-stream", move |site| {
        let asked = site.last_cycle.ask(move |cycle| {
            let layers = cycle.plan.layers(cycle.sequence, &cycle.frames)?;
            Some((
                format!("{}.ply", cycle.record.seq),
                Download::Bytes(layers.cloud(pixels)),
            ))
        });
        asked.flatten().ok_or_else(|| Problem::missing(GONE))
    })
    .await
}

/// The answer where the frames of the last result are needed and missing.
pub(super) const GONE: &str =
    "the frames of the last result are gone, or the station is busy; trigger a cycle";

pub(super) async fn recording(site: Site) -> Answered<Response> {
    send(&site, "application/zip", |site| {
        let asked = site.last_cycle.ask(JudgedPart::clone);
        let part = asked.ok_or_else(|| Problem::missing(GONE))?;
        let scratch = site.history.scratch();
        let recipes = site.recipes.generations(part.plan.id().number);
        let written = part.write(&scratch, &recipes, u64::MAX);
        let packed = written
            .map_err(|error| error.to_string())
            .and_then(|()| Packed::of(&scratch, name_of(&part.record)).map_err(unpacked));
        // Its files are open. What cannot be removed now is removed at the next start.
        let _ = std::fs::remove_dir_all(&scratch);
        let name = format!("{}-recording.zip", part.record.seq);
        Ok((name, Download::Folder(packed.map_err(Problem::broken)?)))
    })
    .await
}

/// A recording that cannot be packed, in words.
pub(super) fn unpacked(error: io::Error) -> String {
    format!("pack the recording: {error}: free space")
}

pub(super) async fn gauges(site: Site) -> Answered<Response> {
    send(&site, "text/csv; charset=utf-8", gauges_csv).await
}

fn gauges_csv(site: &Site) -> Answered<(String, Download)> {
    let snapshot = site.station.snapshot();
    let words = "nothing was measured yet; trigger a cycle";
    let result = snapshot
        .result
        .as_deref()
        .ok_or_else(|| Problem::missing(words))?;
    let mut csv = String::from(
        "seq,verdict,gauge,value,sigma,low,high,unit,pass,valid,doubtful,uncertainty,expected,slot,absent\n",
    );
    let number = |value: Option<f64>| value.map_or(String::new(), |value| value.to_string());
    for gauge in &result.inspection.gauges {
        let decision = gauge.decision;
        csv += &format!(
            "{},{},\"{}\",{},{},{},{},{},{},{},{},{},{},{},{}\n",
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
            number(gauge.uncertainty),
            number(gauge.expected),
            gauge.slot,
            u8::from(decision.absent),
        );
    }
    Ok((
        format!("{}.csv", result.seq),
        Download::Bytes(csv.into_bytes()),
    ))
}

/// A ZIP of everything that explains a device's behaviour; no secrets.
pub(super) async fn diagnostics(site: Site) -> Answered<Response> {
    send(&site, "application/zip", |site| {
        let packed = pack(site).map_err(Problem::broken);
        let serial = &site.station.snapshot().identity.serial;
        let safe: String = serial.chars().filter(char::is_ascii_alphanumeric).collect();
        Ok((format!("fringed-{safe}.zip"), Download::Bytes(packed?)))
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
            Err(error) => json!({ "number": number, "error": error.words }),
        })
        .collect();
    let results = site.history.results(&Filter::default());
    let results = results.map_or_else(|error| json!(error.to_string()), |results| json!(results));
    let changes = site
        .access
        .record()
        .list(&RecordFilter {
            limit: Some(MOST_CHANGES),
            ..RecordFilter::default()
        })
        .unwrap_or_default();
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
    // Its maps are large, and beside it on the device.
    let calibration = site.calibration_file.as_deref();
    let calibration = calibration.and_then(|file| std::fs::read_to_string(file).ok());
    packed(
        members
            .into_iter()
            .chain(calibration.map(|text| ("calibration.json", text))),
        0,
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn a_client_that_takes_nothing_is_given_up_and_what_it_has_does_not_look_whole() {
        let answer = |taken: bool| async move {
            let (mut to, body) = ToClient::new();
            to.slow = Duration::from_millis(20);
            let sending = std::thread::spawn(move || {
                let sent = to.write_all(b"one").and_then(|()| to.flush());
                let sent = sent.and_then(|()| to.write_all(b"two"));
                let kept = sent.and_then(|()| to.flush());
                let why = kept.as_ref().err().map(io::Error::kind);
                to.end(kept);
                why
            });
            if taken {
                let whole = axum::body::to_bytes(body, 100).await.unwrap();
                return (sending.join().unwrap(), Some(whole));
            }
            let why = sending.join().unwrap();
            (why, axum::body::to_bytes(body, 100).await.ok())
        };
        let (why, whole) = answer(true).await;
        assert_eq!((why, whole.as_deref()), (None, Some(&b"onetwo"[..])));
        assert_eq!(answer(false).await, (Some(io::ErrorKind::TimedOut), None));
    }
}
