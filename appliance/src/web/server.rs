//! The HTTP server: the table of all paths with the role that each needs, the headers of every answer, and connections, which are
//! accepted within their limits and closed where they are too slow.

use super::gate::Least::{self, Anyone, Collector, User};
use super::gate::{self, Needs, Peer, Rule, own_page_only};
use super::problem::Problem;
use super::site::Site;
use super::slots::{Slot, Slots};
use super::view::{self, Following};
use super::{
    assets, backup, changes, downloads, head, history, look, maps, metrics, orders, recipes,
    results, session, statistics, studies, tries, triggers, users,
};
use crate::access::Role::{self, Engineer, Operator, Technician, Viewer};
use crate::system::clock;
use axum::extract::Request;
use axum::handler::Handler;
use axum::http::{HeaderName, HeaderValue, Method, header};
use axum::middleware::{Next, from_fn, from_fn_with_state};
use axum::response::{IntoResponse, Response};
use axum::routing::{MethodFilter, MethodRouter, get, on};
use axum::{Extension, Router};
use hyper::body::Incoming;
use hyper::server::conn::http1;
use hyper::service::{Service as _, service_fn};
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use std::convert::Infallible;
use std::future::{Future, poll_fn};
use std::io::{self, ErrorKind};
use std::net::SocketAddr;
use std::pin::Pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use tokio::io::AsyncWrite as _;
use tokio::net::{TcpListener, TcpStream};
use tokio_io_timeout::TimeoutStream;

/// Only files of this device, nothing inline, not inside a frame of another page.
const CONTENT_SECURITY_POLICY: &str =
    "default-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

/// One method of one path.
pub struct Route {
    /// GET, POST, PUT or DELETE.
    pub method: Method,
    /// The path, with parameters in braces.
    pub path: &'static str,
    /// Who may ask for it.
    pub least: Least,
    /// Its name in the record of changes; none if it changes nothing.
    pub changes: Option<&'static str>,
    answer: MethodRouter<Site>,
}

const GET: (Method, MethodFilter) = (Method::GET, MethodFilter::GET);
const POST: (Method, MethodFilter) = (Method::POST, MethodFilter::POST);
const PUT: (Method, MethodFilter) = (Method::PUT, MethodFilter::PUT);
const DELETE: (Method, MethodFilter) = (Method::DELETE, MethodFilter::DELETE);

type Answering = Pin<Box<dyn Future<Output = Response> + Send>>;

/// Any handler, behind one type: what axum does for a type of handler it does once.
#[derive(Clone)]
struct BoxedHandler(Arc<dyn Fn(Request, Site) -> Answering + Send + Sync>);

impl Handler<(), Site> for BoxedHandler {
    type Future = Answering;

    fn call(self, request: Request, site: Site) -> Answering {
        (self.0)(request, site)
    }
}

fn route<T: 'static>(
    least: Least,
    (method, filter): (Method, MethodFilter),
    path: &'static str,
    changes: Option<&'static str>,
    handler: impl Handler<T, Site>,
) -> Route {
    Route {
        method,
        path,
        least,
        changes,
        answer: on(
            filter,
            BoxedHandler(Arc::new(move |request, site| {
                Box::pin(handler.clone().call(request, site))
            })),
        ),
    }
}

fn look<T: 'static>(path: &'static str, handler: impl Handler<T, Site>) -> Route {
    route(User(Viewer), GET, path, None, handler)
}

/// As [`look`], also for programs at the configured addresses.
fn collect<T: 'static>(path: &'static str, handler: impl Handler<T, Site>) -> Route {
    route(Collector, GET, path, None, handler)
}

/// A change by a user with a role or more, which is recorded as `action`.
fn change<T: 'static>(
    role: Role,
    method: (Method, MethodFilter),
    path: &'static str,
    action: &'static str,
    handler: impl Handler<T, Site>,
) -> Route {
    route(User(role), method, path, Some(action), handler)
}

/// What changes nothing and is not for every viewer.
fn only<T: 'static>(
    role: Role,
    method: (Method, MethodFilter),
    path: &'static str,
    handler: impl Handler<T, Site>,
) -> Route {
    route(User(role), method, path, None, handler)
}

/// Every path that is answered, but for the page's own files.
#[rustfmt::skip]
pub fn routes() -> Vec<Route> {
    vec![
        look("/events", view::follow),
        collect("/healthz", look::health),
        collect("/readyz", look::readiness),
        collect("/metrics", metrics::metrics),
        look("/api/openapi.json", look::openapi),
        collect("/api/snapshot", look::snapshot),
        look("/api/picture/{layer}", look::picture),
        look("/api/teach/part", look::part_seen),
        look("/api/trends", history::trends),
        look("/api/registers", look::registers),
        look("/api/log", look::log),
        look("/api/changes", changes::list),
        look("/api/changes.csv", changes::csv),
        look("/api/last/cloud.ply", downloads::cloud),
        look("/api/last/maps.npz", maps::last),
        look("/api/last/recording.zip", downloads::recording),
        look("/api/last/gauges.csv", downloads::gauges),
        look("/api/last/features", look::features),
        look("/api/history", history::list),
        look("/api/history.csv", history::csv),
        look("/api/history/{seq}", history::one),
        look("/api/history/{seq}/picture/{layer}", history::picture),
        look("/api/history/{seq}/features", history::features),
        look("/api/history/{seq}/maps.npz", maps::kept),
        look("/api/history/{seq}/recording.zip", history::recording),
        collect("/api/results", results::after),
        look("/api/statistics", statistics::statistics),
        look("/api/diagnostics.zip", downloads::diagnostics),
        look("/api/kinds", recipes::kinds),
        look("/api/recipes", recipes::list),
        look("/api/recipes/{number}", recipes::one),
        look("/api/recipes/{number}/file", recipes::export),
        look("/api/recipes/{number}/maps.npz", maps::golden),
        look("/api/recipes/{number}/picture/{layer}", recipes::picture),
        change(Engineer, POST, "/api/recipes", "import recipe", recipes::import),
        change(Technician, PUT, "/api/recipes/{number}", "edit recipe", recipes::edit),
        only(Technician, POST, "/api/recipes/{number}/try", tries::attempt),
        change(Engineer, DELETE, "/api/recipes/{number}", "delete recipe", recipes::delete),
        change(Technician, POST, "/api/recipes/{number}/undo", "undo recipe", recipes::undo),
        change(Operator, POST, "/api/recipes/{number}/load", "load recipe", orders::load),
        change(Technician, POST, "/api/recipes/{number}/teach", "teach recipe", orders::teach),
        change(Operator, POST, "/api/trigger", "trigger", triggers::trigger),
        change(Operator, POST, "/api/reset", "reset errors", orders::reset),
        look("/api/head", head::state),
        look("/api/head/board.pdf", head::board_pdf),
        only(Technician, GET, "/api/head/live", head::live),
        only(Technician, GET, "/api/head/live/figures", head::figures),
        look("/api/head/poses/{number}/picture", head::pose),
        change(Technician, POST, "/api/head/steps/{name}", "commission head", head::step),
        change(Technician, DELETE, "/api/head/steps/{name}", "end step of commissioning", head::end),
        look("/api/simulation/part", head::part),
        change(Engineer, PUT, "/api/simulation/part", "place simulated part", head::put_part),
        look("/api/studies", studies::list),
        look("/api/studies/{number}", studies::one),
        look("/api/studies/{number}/{name}", studies::file),
        change(Technician, POST, "/api/studies", "begin study", studies::begin),
        change(Technician, POST, "/api/studies/{number}/{name}", "run or pause study", studies::order),
        change(Technician, DELETE, "/api/studies/{number}", "delete study", studies::delete),
        only(Engineer, GET, "/api/users", users::list),
        change(Engineer, PUT, "/api/users/{name}", "set user", users::set),
        change(Engineer, DELETE, "/api/users/{name}", "remove user", users::remove),
        change(Engineer, GET, "/api/backup.zip", "back up", backup::make),
        only(Engineer, GET, "/api/restore", backup::state),
        change(Engineer, POST, "/api/restore", "check backup", backup::check),
        change(Engineer, PUT, "/api/restore", "order restore", backup::order),
        change(Engineer, DELETE, "/api/restore", "discard restore", backup::discard),
        change(Engineer, POST, "/api/restore/undo", "order undo of restore", backup::undo),
        change(Engineer, POST, "/api/restart", "restart", backup::restart),
        route(Anyone, GET, "/api/session", None, session::state),
        route(Anyone, POST, "/api/session", None, session::begin),
        route(Anyone, PUT, "/api/session", None, session::set_password),
        route(Anyone, DELETE, "/api/session", None, session::end),
    ]
}

/// The least role of each route that needs more than a viewer.
fn needs() -> Needs {
    let needs = routes().into_iter().filter_map(|route| match route.least {
        User(role) if role > Viewer => Some((
            format!("{} {}", route.method, route.path),
            role.word().into(),
        )),
        _ => None,
    });
    Needs(Arc::new(needs.collect()))
}

/// All paths.
pub fn router(site: Site) -> Router {
    let mut router = Router::new();
    for route in routes() {
        // The layer that is added last runs first: origin, then role.
        let mut answer = route
            .answer
            .route_layer(from_fn_with_state(site.clone(), gate::allowed_only))
            .route_layer(Extension(Rule {
                least: route.least,
                changes: route.changes,
            }));
        if route.method != Method::GET {
            answer = answer.route_layer(from_fn(own_page_only));
        }
        router = router.route(route.path, answer);
    }
    for asset in assets::ALL {
        router = router.route(asset.path, get(move || async move { asset.answer() }));
    }
    router = router.route(assets::ICON.path, get(async || assets::ICON.answer()));
    router
        .fallback(|| async { Problem::missing("there is no such page; start at /") })
        .layer(Extension(needs()))
        .layer(from_fn_with_state(site.clone(), guarded))
        .with_state(site)
}

/// Refuses requests that do not name this device as their only host, and adds the headers of every
/// answer.
async fn guarded(site: Site, request: Request, next: Next) -> Response {
    let mut response = match gate::check_host(request.uri(), request.headers(), &site.hosts) {
        Ok(()) => next.run(request).await,
        Err(problem) => problem.into_response(),
    };
    let fixed: [(HeaderName, &'static str); 5] = [
        (header::CONTENT_SECURITY_POLICY, CONTENT_SECURITY_POLICY),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (header::X_FRAME_OPTIONS, "DENY"),
        (header::REFERRER_POLICY, "no-referrer"),
        // An old page or picture must never be shown as the present one.
        (header::CACHE_CONTROL, "no-store"),
    ];
    for (name, value) in fixed {
        let value = HeaderValue::from_static(value);
        response.headers_mut().insert(name, value);
    }
    response
}

/// The most connections at a time.
const MOST_CONNECTIONS: usize = 64;
/// The most of them from one address: a browser opens 6.
const MOST_EACH: usize = 16;
/// Longest wait for a request and its header.
const HEADER_TIME: Duration = Duration::from_secs(10);
/// Longest wait for a client to accept the next bytes of an answer.
const WRITE_TIME: Duration = Duration::from_secs(15);
/// Longest wait for a client to end what it sends after an answer that refuses it.
const LAST_TIME: Duration = Duration::from_secs(10);
/// The most header lines of a request.
const MOST_HEADERS: usize = 64;
/// The most bytes of a connection that are buffered.
const READ_AHEAD: usize = 64 << 10;
/// Pause after a connection that could not be accepted.
const ACCEPT_PAUSE: Duration = Duration::from_millis(100);

/// Serves the page on `listener` until `shutdown`. Open connections end with the runtime, not
/// before.
pub async fn serve(listener: TcpListener, site: Site, shutdown: impl Future<Output = ()>) {
    let router = router(site.clone());
    let slots = Slots::new(MOST_CONNECTIONS, MOST_EACH);
    let accepting = async {
        loop {
            match listener.accept().await {
                // Without a slot it is closed at once: all others are being answered.
                Ok((stream, peer)) => {
                    if let Some(slot) = slots.enter(site.holder(peer.ip()), Instant::now()) {
                        tokio::spawn(answer(stream, peer, Arc::new(slot), router.clone()));
                    }
                }
                // No file descriptor is left, or the client is gone: others can still be served.
                Err(_) => tokio::time::sleep(ACCEPT_PAUSE).await,
            }
        }
    };
    tokio::select! {
        () = accepting => {}
        () = shutdown => {}
    }
}

/// Answers the requests of one connection.
async fn answer(stream: TcpStream, peer: SocketAddr, slot: Arc<Slot>, router: Router) {
    if clock::is_past_calendars() {
        // hyper would panic: it puts a date into each answer.
        refuse(&stream).await;
        return;
    }
    let mut stream = TimeoutStream::new(stream);
    stream.set_write_timeout(Some(WRITE_TIME));
    let asked = slot.clone();
    let refused = Arc::new(AtomicBool::new(false));
    let refusing = refused.clone();
    let inner = TowerToHyperService::new(router);
    let service = service_fn(move |mut request: axum::http::Request<Incoming>| {
        asked.mark(None);
        request.extensions_mut().insert(Peer(peer.ip()));
        let (answered, answering) = (asked.clone(), inner.call(request));
        let refused = refusing.clone();
        Box::pin(async move {
            let Ok(response) = answering.await;
            let refuses =
                response.status().is_client_error() || response.status().is_server_error();
            refused.store(refuses, Ordering::Relaxed);
            if response.extensions().get::<Following>().is_none() {
                answered.mark(Some(Instant::now()));
            }
            Ok::<_, Infallible>(response)
        })
    });
    let connection = http1::Builder::new()
        .timer(TokioTimer::new())
        .header_read_timeout(HEADER_TIME)
        .max_headers(MOST_HEADERS)
        .max_buf_size(READ_AHEAD)
        .serve_connection(TokioIo::new(Box::pin(stream)), service)
        .without_shutdown();
    let answering = async {
        // A connection that the client breaks off is not an error of the server.
        let Ok(ended) = connection.await else { return };
        let mut stream = ended.io.into_inner();
        // Fails only where the client is gone.
        let _ = poll_fn(|context| stream.as_mut().poll_shutdown(context)).await;
        if refused.load(Ordering::Relaxed) {
            let _ = tokio::time::timeout(LAST_TIME, drain(stream.get_ref())).await;
        }
    };
    tokio::select! {
        () = answering => {}
        () = slot.left() => {}
    }
}

/// Reads what a client still sends, until it ends: a socket that is closed before breaks off the
/// answer on its way to the client.
async fn drain(stream: &TcpStream) -> io::Result<()> {
    let mut sent = vec![0; READ_AHEAD];
    loop {
        stream.readable().await?;
        match stream.try_read(&mut sent) {
            Ok(0) => return Ok(()),
            Err(error) if error.kind() != ErrorKind::WouldBlock => return Err(error),
            _ => tokio::task::yield_now().await,
        }
    }
}

/// Answers a connection while the system clock shows a time that HTTP cannot express.
pub(super) async fn refuse(stream: &TcpStream) {
    let words =
        r#"{"error":"the clock of this device is before 1970 or past the year 9999: set it"}"#;
    let answer = format!(
        "HTTP/1.1 503 Service Unavailable\r\nContent-Type: application/json\r\nContent-Length: {}\r\n\
         Connection: close\r\n\r\n{words}",
        words.len()
    );
    let answered = async {
        stream.readable().await?;
        stream.try_read(&mut [0; 4096])?;
        stream.writable().await?;
        stream.try_write(answer.as_bytes())
    };
    // A client that breaks off or sends nothing is not an error of the server.
    let _ = tokio::time::timeout(HEADER_TIME, answered).await;
}
