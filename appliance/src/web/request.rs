//! Reads a request: its path, its query, and its body with limits of size, time and memory. A body
//! counts only if its sender still has the role when it has come.

use super::gate::Permit;
use super::problem::{Answered, Problem};
use super::site::Site;
use crate::error::shortened;
use crate::recipe::store::incoming::Incoming;
use axum::body::{Body, Bytes, HttpBody as _, to_bytes};
use axum::extract::rejection::{PathRejection, QueryRejection};
use axum::extract::{self, FromRequestParts, Request};
use axum::http::StatusCode;
use axum::http::request::Parts;
use serde::de::DeserializeOwned;
use std::io::{ErrorKind, Write as _};
use std::path::PathBuf;
use std::time::Duration;
use tokio::sync::{OwnedSemaphorePermit, mpsc};
use tokio_stream::StreamExt as _;

/// The query of a request.
pub struct Query<T>(pub T);

/// What a request's path names.
pub struct Path<T>(pub T);

impl<T: DeserializeOwned, S: Send + Sync> FromRequestParts<S> for Query<T> {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, Problem> {
        let read = extract::Query::from_request_parts(parts, state).await;
        let unread = |why: QueryRejection| Problem::new(why.status(), why.body_text());
        read.map(|extract::Query(value)| Self(value))
            .map_err(unread)
    }
}

impl<T: DeserializeOwned + Send, S: Send + Sync> FromRequestParts<S> for Path<T> {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, Problem> {
        let read = extract::Path::from_request_parts(parts, state).await;
        let unread = |why: PathRejection| Problem::new(why.status(), why.body_text());
        read.map(|extract::Path(value)| Self(value)).map_err(unread)
    }
}

/// Largest body in JSON, bytes.
const MAX_JSON: usize = 64 << 10;
/// Largest change of a recipe, bytes: 96 features of 40 corners and 64 gauges take a third of it.
const MAX_EDIT: usize = 256 << 10;
/// Longest wait for it.
const JSON_TIME: Duration = Duration::from_secs(10);

/// Reads a body in JSON.
///
/// # Errors
/// It is too long, too slow, or not the JSON of a `T`.
pub async fn json<T: DeserializeOwned>(request: Request) -> Answered<T> {
    let bytes = read(request, MAX_JSON, JSON_TIME).await?;
    parsed(&bytes)
}

/// Reads a change of a recipe in JSON.
///
/// # Errors
/// As [`json`].
pub async fn edit<T: DeserializeOwned>(request: Request) -> Answered<T> {
    let bytes = read(request, MAX_EDIT, JSON_TIME).await?;
    parsed(&bytes)
}

/// Reads a body in JSON; an empty body gives the default.
///
/// # Errors
/// As [`json`].
pub async fn json_if_any<T: DeserializeOwned + Default>(request: Request) -> Answered<T> {
    let bytes = read(request, MAX_JSON, JSON_TIME).await?;
    match bytes.is_empty() {
        true => Ok(T::default()),
        false => parsed(&bytes),
    }
}

fn parsed<T: DeserializeOwned>(bytes: &[u8]) -> Answered<T> {
    serde_json::from_slice(bytes).map_err(|error| {
        let error = shortened(&error.to_string());
        Problem::unclear(format!("the request's JSON: {error}"))
    })
}

/// A received file, and its place among those that are received at the same time.
pub struct Upload {
    /// The file.
    pub file: Incoming,
    _place: OwnedSemaphorePermit,
}

/// The most bytes of a file, and the longest wait for it.
#[derive(Clone, Copy, Debug)]
pub struct FileBounds {
    bytes: u64,
    time: Duration,
}

/// Those of a recipe: one for 2048 × 2048 pixels has 160 MB.
pub const RECIPE: FileBounds = FileBounds {
    bytes: 256 << 20,
    time: Duration::from_secs(120),
};
/// Those of a backup, which has no 64-bit sizes.
pub const BACKUP: FileBounds = FileBounds {
    bytes: 4 << 30,
    time: Duration::from_secs(1800),
};

/// Reads a body that is a file. It is written to the folder as it comes, so it is never in memory as a
/// whole.
///
/// # Errors
/// Too many files are being received; it is too long or too slow; or there is no room for it.
pub async fn file(
    site: &Site,
    request: Request,
    folder: PathBuf,
    bounds: FileBounds,
) -> Answered<Upload> {
    let place = site.arriving.clone().try_acquire_owned().map_err(|_| {
        Problem::crowded("other files are being imported: wait until they are done")
    })?;
    let (parts, body) = request.into_parts();
    let expected = body.size_hint().lower();
    if expected > bounds.bytes {
        return Err(too_long(bounds.bytes));
    }
    let (chunks, mut received) = mpsc::channel::<Bytes>(1);
    let storing = tokio::task::spawn_blocking(move || {
        let mut file = Incoming::begin(&folder, expected)?;
        while let Some(chunk) = received.blocking_recv() {
            file.write_all(&chunk)?;
        }
        Ok(file)
    });
    let sent = in_time(bounds.time, send(body, bounds.bytes, chunks)).await;
    let stored = storing.await;
    sent?;
    let stored = stored.unwrap_or_else(|_| Err(ErrorKind::Other.into()));
    let file = stored.map_err(|error: std::io::Error| {
        Problem::unstored(format!("store the file: {error}: free space"), &error)
    })?;
    still_may(&parts)?;
    let _place = place;
    Ok(Upload { file, _place })
}

/// Checks that who sent a body still has the role that it needs.
fn still_may(parts: &Parts) -> Answered<()> {
    let permit = parts.extensions.get::<Permit>();
    permit.map_or(Ok(()), Permit::check)
}

/// Sends a body to `chunks` piece by piece, until the receiver is gone.
async fn send(body: Body, most: u64, chunks: mpsc::Sender<Bytes>) -> Answered<()> {
    let mut body = body.into_data_stream();
    let mut left = most;
    while let Some(chunk) = body.next().await {
        let chunk =
            chunk.map_err(|error| Problem::unclear(format!("the request's body: {error}")))?;
        left = left
            .checked_sub(chunk.len() as u64)
            .ok_or_else(|| too_long(most))?;
        if chunks.send(chunk).await.is_err() {
            // It could not be stored; the storing thread answers why.
            break;
        }
    }
    Ok(())
}

async fn read(request: Request, most: usize, time: Duration) -> Answered<Bytes> {
    let (parts, body) = request.into_parts();
    let read = async {
        to_bytes(body, most)
            .await
            .map_err(|_| too_long(most as u64))
    };
    let bytes = in_time(time, read).await?;
    still_may(&parts)?;
    Ok(bytes)
}

async fn in_time<T>(time: Duration, work: impl Future<Output = Answered<T>>) -> Answered<T> {
    tokio::time::timeout(time, work).await.unwrap_or_else(|_| {
        let words = format!(
            "the request's body did not come within {} s",
            time.as_secs()
        );
        Err(Problem::new(StatusCode::REQUEST_TIMEOUT, words))
    })
}

fn too_long(most: u64) -> Problem {
    let words = format!("the request's body is too long: at most {most} bytes are read");
    Problem::new(StatusCode::PAYLOAD_TOO_LARGE, words)
}
