//! An answer about an error: a status, and as JSON what was attempted and the remedy.

use axum::http::{HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Json, Response};
use serde_json::{Value, json};
use std::fmt::Display;
use std::io::{self, ErrorKind};

/// Seconds in Retry-After, where too many requests are being answered.
const RETRY_AFTER_S: u64 = 5;

/// An error that the client gets.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Problem {
    /// The HTTP status.
    pub status: StatusCode,
    /// What was attempted, and the remedy.
    pub words: String,
    /// What programs need beside the words, by its key.
    pub more: Vec<(&'static str, Value)>,
    /// After how many seconds the same request may be answered.
    pub after_s: Option<u64>,
}

impl Problem {
    /// A problem with any status.
    pub fn new(status: StatusCode, words: impl Display) -> Self {
        Self {
            status,
            words: words.to_string(),
            more: Vec::new(),
            after_s: (status == StatusCode::SERVICE_UNAVAILABLE).then_some(RETRY_AFTER_S),
        }
    }

    /// The same, to be tried again after some seconds.
    #[must_use]
    pub fn after(mut self, seconds: u64) -> Self {
        self.after_s = Some(seconds);
        self
    }

    /// The same with something that programs need.
    #[must_use]
    pub fn with(mut self, key: &'static str, value: impl Into<Value>) -> Self {
        self.more.push((key, value.into()));
        self
    }

    /// A file could not be written: 507 if there is no room, else 500.
    pub fn unstored(words: impl Display, error: &io::Error) -> Self {
        let full = [ErrorKind::StorageFull, ErrorKind::QuotaExceeded].contains(&error.kind());
        let status = match full {
            true => StatusCode::INSUFFICIENT_STORAGE,
            false => StatusCode::INTERNAL_SERVER_ERROR,
        };
        Self::new(status, words)
    }
}

macro_rules! problems {
    ($($(#[$doc:meta])* $name:ident = $status:ident;)*) => {
        impl Problem {
            $($(#[$doc])* pub fn $name(words: impl Display) -> Self {
                Self::new(StatusCode::$status, words)
            })*
        }
    };
}

problems! {
    /// 400: the request cannot be understood.
    unclear = BAD_REQUEST;
    /// 404: there is no such thing, or not yet.
    missing = NOT_FOUND;
    /// 503: too many requests do the same at the moment.
    crowded = SERVICE_UNAVAILABLE;
    /// 409: not possible in the present state.
    busy = CONFLICT;
    /// 422: understood, but its content cannot be used.
    unfit = UNPROCESSABLE_ENTITY;
    /// 500: the program or its machine is at fault.
    broken = INTERNAL_SERVER_ERROR;
}

impl IntoResponse for Problem {
    fn into_response(self) -> Response {
        let mut body = json!({ "error": self.words });
        for (key, value) in self.more {
            body[key] = value;
        }
        let mut response = (self.status, Json(body)).into_response();
        if let Some(seconds) = self.after_s {
            let after = HeaderValue::from(seconds);
            response.headers_mut().insert(header::RETRY_AFTER, after);
        }
        response.extensions_mut().insert(ProblemWords(self.words));
        response
    }
}

/// An answer, or the problem that the client gets instead.
pub type Answered<T> = Result<T, Problem>;

/// The words of a problem, for the record of changes.
#[derive(Clone, Debug)]
pub struct ProblemWords(pub String);
