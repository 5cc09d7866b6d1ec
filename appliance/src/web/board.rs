//! The board for a calibration as a PDF, so that it can be printed from the phone that sets up the
//! head.

use axum::http::header;
use axum::response::{IntoResponse, Response};
use serde::Deserialize;

use super::problem::{Answered, Problem};
use super::query::Query;
use crate::head::board::parse;
use crate::output::board::sheet;

/// Which board is wanted.
#[derive(Debug, Deserialize)]
pub(super) struct BoardQuery {
    #[serde(default)]
    board: String,
}

pub(super) async fn pdf(Query(wanted): Query<BoardQuery>) -> Answered<Response> {
    let board =
        parse(&wanted.board).map_err(|error| Problem::unclear(format!("board: {error}")))?;
    let sheet = sheet(&board).map_err(|error| Problem::unfit(format!("board: {error}")))?;
    let headers = [
        (header::CONTENT_TYPE, "application/pdf"),
        (
            header::CONTENT_DISPOSITION,
            "attachment; filename=\"board.pdf\"",
        ),
    ];
    Ok((headers, sheet.pdf).into_response())
}
