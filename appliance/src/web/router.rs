//! The paths of the page and the headers of every answer.

use std::sync::Arc;

use axum::Router;
use axum::extract::{Request, State};
use axum::http::{HeaderMap, HeaderName, HeaderValue, StatusCode, header};
use axum::middleware::{Next, from_fn_with_state};
use axum::response::{IntoResponse, Json, Response};
use axum::routing::get;
use tokio::sync::Semaphore;

use super::{events, host, view};
use crate::station::StationHandle;

/// Gives the PNG of the last measured height, or `None` before the first. May take its time: called on a blocking thread.
pub type HeightPicture = Arc<dyn Fn() -> Option<Vec<u8>> + Send + Sync>;

/// The most pages that follow the events at a time.
pub const MAX_FOLLOWERS: usize = 16;

/// Only files of this device, nothing inline, in nobody's frame.
const CONTENT_SECURITY_POLICY: &str =
    "default-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

/// What the page shows.
#[derive(Clone)]
pub struct Site {
    handle: StationHandle,
    height: HeightPicture,
    hosts: Arc<[String]>,
    followers: Arc<Semaphore>,
}

impl Site {
    /// The page of a station. `hosts` are the names, besides IP addresses and `localhost`, under which it is reached.
    pub fn new(handle: StationHandle, height: HeightPicture, hosts: Vec<String>) -> Self {
        Self {
            handle,
            height,
            hosts: hosts.into(),
            followers: Arc::new(Semaphore::new(MAX_FOLLOWERS)),
        }
    }
}

/// All paths.
pub fn router(site: Site) -> Router {
    Router::new()
        .route(
            "/",
            get(|| {
                file(
                    "text/html; charset=utf-8",
                    include_str!("assets/index.html"),
                )
            }),
        )
        .route(
            "/page.css",
            get(|| file("text/css; charset=utf-8", include_str!("assets/page.css"))),
        )
        .route(
            "/page.js",
            get(|| {
                file(
                    "text/javascript; charset=utf-8",
                    include_str!("assets/page.js"),
                )
            }),
        )
        .route(
            "/icon.svg",
            get(|| file("image/svg+xml", include_str!("assets/icon.svg"))),
        )
        .route("/events", get(follow))
        .route("/api/snapshot", get(snapshot))
        .route("/height.png", get(height))
        .route("/healthz", get(health))
        .fallback(|| async { (StatusCode::NOT_FOUND, "there is no such page; start at /\n") })
        .layer(from_fn_with_state(site.clone(), guarded))
        .with_state(site)
}

/// Refuses foreign Host headers and puts the headers that every answer has.
async fn guarded(
    State(site): State<Site>,
    headers: HeaderMap,
    request: Request,
    next: Next,
) -> Response {
    let host = headers
        .get(header::HOST)
        .and_then(|host| host.to_str().ok())
        .unwrap_or("");
    let mut response = if host::is_allowed(host, &site.hosts) {
        next.run(request).await
    } else {
        let words = "this device does not go by the name in the Host header; use its IP address, or add the name to the config\n";
        (StatusCode::MISDIRECTED_REQUEST, words).into_response()
    };
    let fixed: [(HeaderName, &'static str); 3] = [
        (header::CONTENT_SECURITY_POLICY, CONTENT_SECURITY_POLICY),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (header::REFERRER_POLICY, "no-referrer"),
    ];
    for (name, value) in fixed {
        response
            .headers_mut()
            .insert(name, HeaderValue::from_static(value));
    }
    // A page or picture from yesterday must never look like today's.
    response
        .headers_mut()
        .insert(header::CACHE_CONTROL, HeaderValue::from_static("no-store"));
    response
}

async fn file(kind: &'static str, text: &'static str) -> impl IntoResponse {
    ([(header::CONTENT_TYPE, kind)], text)
}

async fn follow(State(site): State<Site>) -> Response {
    match site.followers.clone().try_acquire_owned() {
        Ok(permit) => events::stream(site.handle, permit).into_response(),
        Err(_) => {
            let words = format!("{MAX_FOLLOWERS} pages are open already; close one\n");
            (StatusCode::SERVICE_UNAVAILABLE, words).into_response()
        }
    }
}

async fn snapshot(State(site): State<Site>) -> impl IntoResponse {
    Json(view::snapshot(&site.handle.snapshot()))
}

async fn height(State(site): State<Site>) -> Response {
    match tokio::task::spawn_blocking(move || (site.height)()).await {
        Ok(Some(png)) => ([(header::CONTENT_TYPE, "image/png")], png).into_response(),
        Ok(None) => (
            StatusCode::NOT_FOUND,
            "nothing was measured yet; trigger a measurement\n",
        )
            .into_response(),
        Err(_) => (
            StatusCode::INTERNAL_SERVER_ERROR,
            "the height picture could not be drawn; see the log\n",
        )
            .into_response(),
    }
}

async fn health(State(site): State<Site>) -> Response {
    if site.handle.snapshot().worker_alive {
        (StatusCode::OK, "ok\n").into_response()
    } else {
        (
            StatusCode::SERVICE_UNAVAILABLE,
            "the measuring task missed its deadline\n",
        )
            .into_response()
    }
}
