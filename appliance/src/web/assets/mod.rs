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
    ($($kind:literal: $($file:literal)*;)*) => {
        /// Every file, the page first.
        pub const ALL: &[Asset] = &[
            Asset {
                path: "/",
                kind: "text/html; charset=utf-8",
                text: include_str!("index.html"),
            },
            $($(Asset {
                path: concat!("/", $file),
                kind: $kind,
                text: include_str!($file),
            },)*)*
        ];
    };
}

/// The icon under the name by which browsers ask for one where an answer is not a page.
pub const ICON: Asset = Asset {
    path: "/favicon.ico",
    kind: "image/svg+xml",
    text: include_str!("icon.svg"),
};

assets! {
    "text/css; charset=utf-8": "page.css";
    "image/svg+xml": "icon.svg";
    "text/javascript; charset=utf-8":
        "main.js"
        "element.js"
        "number.js"
        "api.js"
        "stale.js"
        "session.js"
        "verdict.js"
        "gauges.js"
        "trend.js"
        "times.js"
        "picture.js"
        "view.js"
        "mesh.js"
        "surface.js"
        "ring.js"
        "colour.js"
        "question.js"
        "recipes.js"
        "part.js"
        "editor.js"
        "editor-list.js"
        "editor-shapes.js"
        "editor-picture.js"
        "editor-fields.js"
        "editor-rows.js"
        "editor-gauges.js"
        "editor-datum.js"
        "editor-table.js"
        "editor-try.js"
        "found.js"
        "kept.js"
        "scale.js"
        "history.js"
        "chart.js"
        "statistics.js"
        "report.js"
        "studies.js"
        "simulation.js"
        "head.js"
        "live.js"
        "steps.js"
        "geometry.js"
        "registers.js"
        "changes.js"
        "users.js"
        "backup.js"
        "journal.js";
}
