//! The table of all paths, and the headers of every answer.

use axum::Router;
use axum::extract::Request;
use axum::http::{HeaderName, HeaderValue, Method, header};
use axum::middleware::{Next, from_fn, from_fn_with_state};
use axum::response::{IntoResponse, Response};
use axum::routing::{MethodFilter, MethodRouter, get, on};
use axum::{Extension, handler::Handler};

use super::gate::{ChangeName, own_page_only, signed_in_only};
use super::problem::Problem;
use super::site::Site;
use super::{
    assets, downloads, gate, head, history, look, metrics, orders, recipes, results, tries, view,
};

/// Only files of this device, nothing inline, not inside a frame of another page.
const CONTENT_SECURITY_POLICY: &str =
    "default-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

/// One method of one path.
pub struct Route {
    /// GET, POST, PUT or DELETE.
    pub method: Method,
    /// The path, with parameters in braces.
    pub path: &'static str,
    /// Its name in the record of changes; none if it changes nothing.
    pub changes: Option<&'static str>,
    answer: MethodRouter<Site>,
}

const GET: (Method, MethodFilter) = (Method::GET, MethodFilter::GET);
const POST: (Method, MethodFilter) = (Method::POST, MethodFilter::POST);
const PUT: (Method, MethodFilter) = (Method::PUT, MethodFilter::PUT);
const DELETE: (Method, MethodFilter) = (Method::DELETE, MethodFilter::DELETE);

fn route<T: 'static>(
    (method, filter): (Method, MethodFilter),
    path: &'static str,
    changes: Option<&'static str>,
    handler: impl Handler<T, Site>,
) -> Route {
    Route {
        method,
        path,
        changes,
        answer: on(filter, handler),
    }
}

fn look<T: 'static>(path: &'static str, handler: impl Handler<T, Site>) -> Route {
    route(GET, path, None, handler)
}

/// A change: needs a session, and is recorded as `action`.
fn change<T: 'static>(
    method: (Method, MethodFilter),
    path: &'static str,
    action: &'static str,
    handler: impl Handler<T, Site>,
) -> Route {
    route(method, path, Some(action), handler)
}

/// Every path that is answered, but for the page's own files.
pub fn routes() -> Vec<Route> {
    vec![
        look("/events", view::follow),
        look("/healthz", look::health),
        look("/readyz", look::readiness),
        look("/metrics", metrics::metrics),
        look("/api/openapi.json", look::openapi),
        look("/api/snapshot", look::snapshot),
        look("/api/picture/{layer}", look::picture),
        look("/api/teach/part", look::part_seen),
        look("/api/trends", history::trends),
        look("/api/registers", look::registers),
        look("/api/log", look::log),
        look("/api/changes", look::changes),
        look("/api/last/cloud.ply", downloads::cloud),
        look("/api/last/recording.zip", downloads::recording),
        look("/api/last/gauges.csv", downloads::gauges),
        look("/api/last/features", look::features),
        look("/api/history", history::list),
        look("/api/history.csv", history::csv),
        look("/api/history/{seq}", history::one),
        look("/api/history/{seq}/picture/{layer}", history::picture),
        look("/api/history/{seq}/features", history::features),
        look("/api/history/{seq}/recording.zip", history::recording),
        look("/api/results", results::after),
        look("/api/diagnostics.zip", downloads::diagnostics),
        look("/api/kinds", recipes::kinds),
        look("/api/recipes", recipes::list),
        look("/api/recipes/{number}", recipes::one),
        look("/api/recipes/{number}/file", recipes::export),
        look("/api/recipes/{number}/picture/{layer}", recipes::picture),
        change(POST, "/api/recipes", "import recipe", recipes::import),
        change(PUT, "/api/recipes/{number}", "edit recipe", recipes::edit),
        route(POST, "/api/recipes/{number}/try", None, tries::attempt),
        change(
            DELETE,
            "/api/recipes/{number}",
            "delete recipe",
            recipes::delete,
        ),
        change(
            POST,
            "/api/recipes/{number}/undo",
            "undo recipe",
            recipes::undo,
        ),
        change(
            POST,
            "/api/recipes/{number}/load",
            "load recipe",
            orders::load,
        ),
        change(
            POST,
            "/api/recipes/{number}/teach",
            "teach recipe",
            orders::teach,
        ),
        change(POST, "/api/trigger", "trigger", orders::trigger),
        change(POST, "/api/reset", "reset errors", orders::reset),
        look("/api/head", head::state),
        look("/api/head/board.pdf", head::board_pdf),
        look("/api/head/live", head::live),
        look("/api/head/live/figures", head::figures),
        look("/api/head/poses/{number}/picture", head::pose),
        change(
            POST,
            "/api/head/steps/{name}",
            "commission head",
            head::step,
        ),
        change(
            DELETE,
            "/api/head/steps/{name}",
            "end step of commissioning",
            head::end,
        ),
        look("/api/simulation/part", head::part),
        change(
            PUT,
            "/api/simulation/part",
            "place simulated part",
            head::put_part,
        ),
        look("/api/session", gate::state),
        route(POST, "/api/session", None, gate::begin),
        route(DELETE, "/api/session", None, gate::end),
    ]
}

/// All paths.
pub fn router(site: Site) -> Router {
    let mut router = Router::new();
    for route in routes() {
        let mut answer = route.answer;
        // The layer that is added last runs first: origin, then session.
        if let Some(action) = route.changes {
            answer = answer
                .route_layer(from_fn_with_state(site.clone(), signed_in_only))
                .route_layer(Extension(ChangeName(action)));
        }
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
        .layer(from_fn_with_state(site.clone(), guarded))
        .with_state(site)
}

/// Refuses requests that do not name this device as their only host, and adds the headers of every
/// answer.
async fn guarded(site: Site, request: Request, next: Next) -> Response {
    let mut response = match gate::check(request.uri(), request.headers(), &site.hosts) {
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
