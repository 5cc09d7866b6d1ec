//! The files of the page itself, compiled in.

use axum::http::header;
use axum::response::{IntoResponse, Response};

/// One file.
#[derive(Clone, Copy, Debug)]
pub struct Asset {
    /// Where it is.
    pub path: &'static str,
    kind: &'static str,
    text: &'static str,
}

impl Asset {
    /// Its answer.
    pub fn answer(self) -> Response {
        ([(header::CONTENT_TYPE, self.kind)], self.text).into_response()
    }

    /// Its content.
    pub fn text(&self) -> &'static str {
        self.text
    }
}

macro_rules! assets {
    ($($path:literal $kind:literal $file:literal;)*) => {
        /// Every file.
        pub const ALL: &[Asset] = &[$(Asset {
            path: $path,
            kind: $kind,
            text: include_str!($file),
        }),*];
    };
}

/// The icon under the name by which browsers ask for one where an answer is not a page.
pub const ICON: Asset = Asset {
    path: "/favicon.ico",
    kind: "image/svg+xml",
    text: include_str!("icon.svg"),
};

assets! {
    "/" "text/html; charset=utf-8" "index.html";
    "/page.css" "text/css; charset=utf-8" "page.css";
    "/icon.svg" "image/svg+xml" "icon.svg";
    "/main.js" "text/javascript; charset=utf-8" "main.js";
    "/element.js" "text/javascript; charset=utf-8" "element.js";
    "/number.js" "text/javascript; charset=utf-8" "number.js";
    "/api.js" "text/javascript; charset=utf-8" "api.js";
    "/stale.js" "text/javascript; charset=utf-8" "stale.js";
    "/session.js" "text/javascript; charset=utf-8" "session.js";
    "/verdict.js" "text/javascript; charset=utf-8" "verdict.js";
    "/gauges.js" "text/javascript; charset=utf-8" "gauges.js";
    "/trend.js" "text/javascript; charset=utf-8" "trend.js";
    "/times.js" "text/javascript; charset=utf-8" "times.js";
    "/picture.js" "text/javascript; charset=utf-8" "picture.js";
    "/ring.js" "text/javascript; charset=utf-8" "ring.js";
    "/colour.js" "text/javascript; charset=utf-8" "colour.js";
    "/question.js" "text/javascript; charset=utf-8" "question.js";
    "/recipes.js" "text/javascript; charset=utf-8" "recipes.js";
    "/editor.js" "text/javascript; charset=utf-8" "editor.js";
    "/kept.js" "text/javascript; charset=utf-8" "kept.js";
    "/scale.js" "text/javascript; charset=utf-8" "scale.js";
    "/history.js" "text/javascript; charset=utf-8" "history.js";
    "/simulation.js" "text/javascript; charset=utf-8" "simulation.js";
    "/head.js" "text/javascript; charset=utf-8" "head.js";
    "/live.js" "text/javascript; charset=utf-8" "live.js";
    "/steps.js" "text/javascript; charset=utf-8" "steps.js";
    "/geometry.js" "text/javascript; charset=utf-8" "geometry.js";
    "/registers.js" "text/javascript; charset=utf-8" "registers.js";
    "/journal.js" "text/javascript; charset=utf-8" "journal.js";
}
