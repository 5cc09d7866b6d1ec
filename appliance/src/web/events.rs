//! Server-sent events: the snapshot when it changes, and a heartbeat that shows that the page is not looking at the past.

use std::convert::Infallible;
use std::time::Duration;

use axum::extract::State;
use axum::http::StatusCode;
use axum::response::sse::{Event, Sse};
use axum::response::{IntoResponse, Response};
use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;

use super::problem::Problem;
use super::site::{MAX_FOLLOWERS, Site};
use super::view;
use crate::station::{Micros, Snapshot, StationHandle};

/// An event comes at least this often.
pub const HEARTBEAT: Duration = Duration::from_secs(1);
/// And at most this often.
pub const SHORTEST: Duration = Duration::from_millis(200);

/// The stream of one page; ends when the page goes away.
pub(super) async fn follow(State(site): State<Site>) -> Response {
    let Ok(permit) = site.followers.clone().try_acquire_owned() else {
        let words = format!("{MAX_FOLLOWERS} pages are open already; close one");
        return Problem::new(StatusCode::SERVICE_UNAVAILABLE, words).into_response();
    };
    let (sender, receiver) = mpsc::channel::<Result<Event, Infallible>>(1);
    let handle = site.station.clone();
    tokio::spawn(async move {
        let _permit = permit;
        send(handle, sender).await;
    });
    Sse::new(ReceiverStream::new(receiver)).into_response()
}

async fn send(handle: StationHandle, sender: mpsc::Sender<Result<Event, Infallible>>) {
    let mut snapshots = handle.subscribe();
    loop {
        let shown = snapshots.borrow_and_update().clone();
        let event = Event::default()
            .event("snapshot")
            .data(view::snapshot(&shown).to_string());
        if sender.send(Ok(event)).await.is_err() {
            return;
        }
        let heartbeat = tokio::time::sleep(HEARTBEAT);
        tokio::time::sleep(SHORTEST).await;
        // Only time has passed: wait for something to see.
        let something = snapshots.wait_for(|now| timeless(now) != timeless(&shown));
        tokio::select! {
            () = heartbeat => {}
            () = sender.closed() => return,
            changed = something => if changed.is_err() { return },
        }
    }
}

/// The snapshot without what changes with every tick.
fn timeless(snapshot: &Snapshot) -> Snapshot {
    Snapshot {
        at: Micros(0),
        uptime_s: 0,
        heartbeat: 0,
        ..snapshot.clone()
    }
}
