//! An answer about an error: a status, and as JSON what was attempted and the remedy.

use axum::http::{HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Json, Response};
use serde_json::json;
use std::io::{self, ErrorKind};

/// Seconds in Retry-After, where too many requests are being answered.
const RETRY_AFTER_S: &str = "5";

/// An error that the client gets.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Problem {
    /// The HTTP status.
    pub status: StatusCode,
    /// What was attempted, and the remedy.
    pub words: String,
    /// The number of the recipe that must be replaced for it.
    pub taken: Option<u16>,
}

impl Problem {
    /// A problem with any status.
    pub fn new(status: StatusCode, words: impl Into<String>) -> Self {
        Self {
            status,
            words: words.into(),
            taken: None,
        }
    }

    /// 400: the request cannot be understood.
    pub fn unclear(words: impl Into<String>) -> Self {
        Self::new(StatusCode::BAD_REQUEST, words)
    }

    /// 404: there is no such thing, or not yet.
    pub fn missing(words: impl Into<String>) -> Self {
        Self::new(StatusCode::NOT_FOUND, words)
    }

    /// 503: too many requests do the same at the moment.
    pub fn crowded(words: impl Into<String>) -> Self {
        Self::new(StatusCode::SERVICE_UNAVAILABLE, words)
    }

    /// 409: not possible in the present state.
    pub fn busy(words: impl Into<String>) -> Self {
        Self::new(StatusCode::CONFLICT, words)
    }

    /// 422: understood, but its content cannot be used.
    pub fn unfit(words: impl Into<String>) -> Self {
        Self::new(StatusCode::UNPROCESSABLE_ENTITY, words)
    }

    /// A file could not be written: 507 if there is no room, else 500.
    pub fn unstored(words: impl Into<String>, error: &io::Error) -> Self {
        let full = [ErrorKind::StorageFull, ErrorKind::QuotaExceeded].contains(&error.kind());
        let status = match full {
            true => StatusCode::INSUFFICIENT_STORAGE,
            false => StatusCode::INTERNAL_SERVER_ERROR,
        };
        Self::new(status, words)
    }

    /// 500: the program or its machine is at fault.
    pub fn broken(words: impl Into<String>) -> Self {
        Self::new(StatusCode::INTERNAL_SERVER_ERROR, words)
    }
}

impl IntoResponse for Problem {
    fn into_response(self) -> Response {
        let mut body = json!({ "error": self.words });
        if let Some(number) = self.taken {
            body["taken"] = number.into();
        }
        let mut response = (self.status, Json(body)).into_response();
        if self.status == StatusCode::SERVICE_UNAVAILABLE {
            let soon = HeaderValue::from_static(RETRY_AFTER_S);
            response.headers_mut().insert(header::RETRY_AFTER, soon);
        }
        response.extensions_mut().insert(Outcome(self.words));
        response
    }
}

/// The words of a problem, for the record of changes.
#[derive(Clone, Debug)]
pub struct Outcome(pub String);
