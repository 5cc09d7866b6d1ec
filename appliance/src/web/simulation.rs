//! The part in front of a simulated head: shows it, and replaces it.

use axum::body::Body;
use axum::extract::State;
use axum::response::Json;
use serde_json::Value;
use tokio::sync::oneshot;

use super::body::json;
use super::problem::Problem;
use super::site::Site;
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

pub(super) async fn part(State(site): State<Site>) -> Json<Value> {
    Json(site.simulation.view())
}

/// Answers once the next cycle sees the part.
pub(super) async fn put(State(site): State<Site>, body: Body) -> Result<Json<Value>, Problem> {
    let placed: Placed = json(body).await?;
    let simulation = site.simulation.clone();
    let (done, answer) = oneshot::channel();
    let broken = || Problem::broken("putting the part in place failed; see the log");
    // A thread of its own: a stop would wait for one of the runtime's.
    std::thread::Builder::new()
        .name("staging".into())
        .spawn(move || {
            // The client may have closed its connection.
            let _ = done.send(simulation.put(&placed));
        })
        .map_err(|_| broken())?;
    answer.await.map_err(|_| broken())??;
    Ok(Json(site.simulation.view()))
}
