//! Server-sent events: the snapshot whenever it changes, and once a second so that the page knows
//! that it is current.
//!
//! The connection of a follower ends with its stream, and that of a refused one with the refusal,
//! so its slot is free again.

use std::convert::Infallible;
use std::time::{Duration, Instant};

use axum::Extension;
use axum::http::{HeaderValue, StatusCode, header};
use axum::response::sse::{Event, Sse};
use axum::response::{IntoResponse, Response};
use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;

use super::gate::Peer;
use super::problem::Problem;
use super::site::{MAX_FOLLOWERS, MAX_FOLLOWERS_EACH, Site};
use super::slots::Slot;
use super::view;
use crate::station::{Micros, Snapshot, StationHandle};

/// Longest time between two events.
const HEARTBEAT: Duration = Duration::from_secs(1);
/// Shortest time between two events.
const SHORTEST: Duration = Duration::from_millis(200);

/// Marks an answer that goes on until its page is closed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Following;

/// The stream of one page; ends when the page is closed, or when another address gets its slot.
pub(super) async fn follow(site: Site, Extension(Peer(address)): Extension<Peer>) -> Response {
    let mut response = match site.followers.enter(site.holder(address), Instant::now()) {
        Some(slot) => stream(site.station.clone(), slot),
        None => {
            let words = format!(
                "{MAX_FOLLOWERS} pages are open already, or {MAX_FOLLOWERS_EACH} from this address; close one"
            );
            Problem::new(StatusCode::SERVICE_UNAVAILABLE, words).into_response()
        }
    };
    let close = HeaderValue::from_static("close");
    response.headers_mut().insert(header::CONNECTION, close);
    response
}

fn stream(handle: StationHandle, slot: Slot) -> Response {
    slot.mark(None);
    let (sender, receiver) = mpsc::channel::<Result<Event, Infallible>>(1);
    tokio::spawn(async move {
        tokio::select! {
            () = send(handle, sender) => {}
            () = slot.left() => {}
        }
    });
    let events = Sse::new(ReceiverStream::new(receiver));
    (Extension(Following), events).into_response()
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
        // An event that only shows the time is not worth sending before the heartbeat.
        let something = snapshots.wait_for(|now| timeless(now) != timeless(&shown));
        tokio::select! {
            () = heartbeat => {}
            () = sender.closed() => return,
            changed = something => if changed.is_err() { return },
        }
    }
}

/// The snapshot without the values that change with every tick.
fn timeless(snapshot: &Snapshot) -> Snapshot {
    Snapshot {
        at: Micros(0),
        uptime_s: 0,
        heartbeat: 0,
        ..snapshot.clone()
    }
}
