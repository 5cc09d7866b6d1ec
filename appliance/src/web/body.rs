//! Reading what a request carries: bounded in size and in time.

use std::time::Duration;

use axum::body::{Body, Bytes, to_bytes};
use axum::http::StatusCode;
use serde::de::DeserializeOwned;

use super::problem::Problem;
use crate::error::shortened;

/// The most of a request in JSON, in bytes: 32 regions of 100 corners are a tenth of it.
const MAX_JSON: usize = 64 << 10;
/// Longest wait for it.
const JSON_TIME: Duration = Duration::from_secs(10);
/// The most of a file, in bytes: a recipe for 2048 × 2048 pixels has 160 MB.
const MAX_FILE: usize = 256 << 20;
/// Longest wait for it.
const FILE_TIME: Duration = Duration::from_secs(120);

/// A request's JSON.
///
/// # Errors
/// It is too long, too slow or not what is expected.
pub async fn json<T: DeserializeOwned>(body: Body) -> Result<T, Problem> {
    let bytes = read(body, MAX_JSON, JSON_TIME).await?;
    parsed(&bytes)
}

/// A request's JSON, or what `T` is without any where the request carries none.
///
/// # Errors
/// As [`json`].
pub async fn json_if_any<T: DeserializeOwned + Default>(body: Body) -> Result<T, Problem> {
    let bytes = read(body, MAX_JSON, JSON_TIME).await?;
    match bytes.is_empty() {
        true => Ok(T::default()),
        false => parsed(&bytes),
    }
}

fn parsed<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, Problem> {
    serde_json::from_slice(bytes).map_err(|error| {
        let error = shortened(&error.to_string());
        Problem::unclear(format!("the request's JSON: {error}"))
    })
}

/// A request's file.
///
/// # Errors
/// It is too long or too slow.
pub async fn file(body: Body) -> Result<Bytes, Problem> {
    read(body, MAX_FILE, FILE_TIME).await
}

async fn read(body: Body, most: usize, time: Duration) -> Result<Bytes, Problem> {
    match tokio::time::timeout(time, to_bytes(body, most)).await {
        Ok(Ok(bytes)) => Ok(bytes),
        Ok(Err(error)) => {
            let words = format!("the request's body: {error}; at most {most} bytes are read");
            Err(Problem::new(StatusCode::PAYLOAD_TOO_LARGE, words))
        }
        Err(_) => {
            let words = format!(
                "the request's body did not come within {} s",
                time.as_secs()
            );
            Err(Problem::new(StatusCode::REQUEST_TIMEOUT, words))
        }
    }
}
