//! The part in front of a simulated head: shows it, and replaces it.

use axum::body::Body;
use axum::response::Json;
use serde_json::Value;

use super::body::json;
use super::problem::{Answered, Problem};
use super::site::{Site, alone};
use crate::head::placed::Placed;
use crate::production::simulation::PutError;

impl From<PutError> for Problem {
    fn from(error: PutError) -> Self {
        match error {
            PutError::Unfit(words) => Self::unfit(words),
            PutError::Busy(words) => Self::busy(words),
        }
    }
}

pub(super) async fn part(site: Site) -> Json<Value> {
    Json(site.simulation.view())
}

/// Answers once the next cycle sees the part.
pub(super) async fn put(site: Site, body: Body) -> Answered<Json<Value>> {
    let placed: Placed = json(body).await?;
    let simulation = site.simulation.clone();
    let failed = "putting the part in place failed; see the log";
    alone("staging", failed, move || simulation.put(&placed)).await??;
    Ok(Json(site.simulation.view()))
}
