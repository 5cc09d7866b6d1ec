//! Queries and paths of requests; what cannot be read of them is answered as any problem is.

use axum::extract::rejection::{PathRejection, QueryRejection};
use axum::extract::{self, FromRequestParts};
use axum::http::request::Parts;
use serde::de::DeserializeOwned;

use super::problem::Problem;

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
