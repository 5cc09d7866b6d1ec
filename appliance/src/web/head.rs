//! The head: its commissioning step by step, the board to print for it, the live picture, and the part
//! in front of a simulated one.

use super::downloads::attachment;
use super::orders::{Accepted, accepted, not_now};
use super::problem::{Answered, Problem};
use super::request::{self, Path, Query};
use super::site::{Site, alone};
use crate::head::board;
use crate::head::calibration::geometry::MAX_POSES;
use crate::head::commission::{EXPOSURE, GEOMETRY, PoseAction, STEPS, Solving, Step};
use crate::head::exposing::Exposing;
use crate::head::live::Show;
use crate::head::placed::Placed;
use crate::output::board::sheet;
use crate::production::commissioning::StepRequest;
use crate::production::simulation::PutError;
use crate::station::{Event, Request as Command};
use crate::system::computing;
use axum::extract::Request;
use axum::http::{HeaderName, HeaderValue, header};
use axum::response::{IntoResponse, Json, Response};
use serde::Deserialize;
use serde_json::Value;

/// The number of a live picture, which its figures have as well.
const NUMBER: HeaderName = HeaderName::from_static("x-picture");

pub(super) async fn state(site: Site) -> Json<Value> {
    let mut view = site.commission.view(&site.station.snapshot());
    view["placing"] = site.simulation.is_placing().into();
    Json(view)
}

/// A step without options.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct Nothing {}

/// Exposure and gain; what is left out stays.
#[derive(Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct Exposure {
    exposure_us: Option<u32>,
    gain: Option<f64>,
    /// They stay over a restart.
    keep: bool,
}

/// What to do with the poses.
#[derive(Debug, Deserialize)]
#[serde(tag = "action", rename_all = "lowercase", deny_unknown_fields)]
enum Action {
    Pose { board: String, pose: Option<u32> },
    Forget { pose: Option<u32> },
    Solve(Solving),
}

pub(super) async fn step(
    site: Site,
    Path(name): Path<String>,
    request: Request,
) -> Answered<Accepted> {
    let asked = asked(&site, &name, request).await?;
    if site.simulation.is_placing() {
        return Err(Problem::busy(format!(
            "commission the head, step {name}: another part is being put in front of the simulated head: try again when it is there"
        )));
    }
    // Also says why, if the head is not open or the station has something to do.
    let snapshot = site.station.snapshot();
    if site.commission.head().is_none() || !site.commission.begin(&site.station, asked) {
        return Err(not_now(
            &format!("commission the head, step {name}"),
            &snapshot,
        ));
    }
    Ok(accepted())
}

pub(super) async fn end(site: Site, Path(name): Path<String>) -> Answered<Accepted> {
    if !site.commission.is_running(&name) {
        let words = format!("end the step {name}: it is not running");
        return Err(Problem::busy(words));
    }
    site.station.event(Event::Request(Command::EndStep));
    Ok(accepted())
}

async fn asked(site: &Site, name: &str, request: Request) -> Answered<StepRequest> {
    let step = Step::of(name).ok_or_else(|| {
        let [before @ .., last] = STEPS.each_ref().map(|step| step.name);
        let before = before.join(", ");
        Problem::missing(format!("there are the steps {before} and {last}"))
    })?;
    let (mut poses, mut exposing) = (None, None);
    match step.name {
        EXPOSURE => exposing = exposure(site, request::json_if_any(request).await?)?,
        GEOMETRY => {
            poses = Some(geometry(site, request::json(request).await?)?);
        }
        _ => {
            let Nothing {} = request::json_if_any(request).await?;
        }
    }
    Ok(StepRequest {
        step,
        poses,
        exposing,
    })
}

fn exposure(site: &Site, wanted: Exposure) -> Answered<Option<(Exposing, bool)>> {
    let head = site.commission.head();
    let head = head.ok_or_else(|| Problem::busy("set the exposure: no head is open"))?;
    let exposing = Exposing {
        exposure_us: wanted.exposure_us.unwrap_or(head.exposing.exposure_us),
        gain: wanted.gain.unwrap_or(head.exposing.gain),
    };
    let given = wanted.exposure_us.is_some() || wanted.gain.is_some() || wanted.keep;
    if given {
        exposing.check(head.least_gain).map_err(Problem::unfit)?;
        if !head.adjustable {
            let words = "set the exposure: recordings cannot be exposed anew";
            return Err(Problem::unfit(words));
        }
        if exposing.exposure_us != head.exposing.exposure_us {
            let whole = exposing.check_refreshes(head.refresh);
            whole.map_err(Problem::unfit)?;
        }
    }
    Ok(given.then_some((exposing, wanted.keep)))
}

fn geometry(site: &Site, wanted: Action) -> Answered<PoseAction> {
    let most = MAX_POSES as u32;
    let within = |pose: u32| match (1..=most).contains(&pose) {
        true => Ok(pose),
        false => Err(Problem::unfit(format!(
            "pose {pose}: poses are numbered 1 to {most}"
        ))),
    };
    Ok(match wanted {
        Action::Pose { board, pose } => {
            let board =
                board::parse(&board).map_err(|error| Problem::unfit(format!("board: {error}")))?;
            let number = pose.unwrap_or_else(|| site.commission.free_pose());
            PoseAction::Pose(board, within(number)?)
        }
        Action::Forget { pose } => PoseAction::Forget(pose.map(within).transpose()?),
        Action::Solve(solving) => {
            solving.check().map_err(Problem::unfit)?;
            PoseAction::Solve(solving)
        }
    })
}

/// What a live picture is to show.
#[derive(Debug, Deserialize)]
pub(super) struct LiveQuery {
    #[serde(default)]
    show: String,
}

pub(super) async fn live(site: Site, Query(shown): Query<LiveQuery>) -> Answered<Response> {
    let Some(show) = Show::parse(&shown.show) else {
        let words = Show::ALL.map(Show::word).join(", ");
        return Err(Problem::unclear(format!("show: write one of {words}")));
    };
    let snapshot = site.station.snapshot();
    if snapshot.is_working() || snapshot.fault.is_some() {
        return Err(not_now("take a picture", &snapshot));
    }
    let live = site.live.clone();
    let failed = "taking the picture failed; see the log";
    let taken = alone("looking", failed, move || {
        // The measuring task needs the cores.
        computing::give_way();
        live.look(show)
    });
    let (number, png) = taken.await?.map_err(Problem::busy)?;
    let mut response = ([(header::CONTENT_TYPE, "image/png")], png).into_response();
    let headers = response.headers_mut();
    headers.insert(NUMBER, HeaderValue::from(number));
    Ok(response)
}

pub(super) async fn figures(site: Site) -> Answered<Json<Value>> {
    let words = "no live picture was taken yet: ask for one first";
    site.live
        .figures()
        .map(Json)
        .ok_or_else(|| Problem::missing(words))
}

pub(super) async fn pose(site: Site, Path(number): Path<u32>) -> Answered<Response> {
    let png = site
        .aside(move |site| {
            let picture = site.commission.pose_picture(number);
            picture.ok_or_else(|| Problem::missing(format!("there is no picture of pose {number}")))
        })
        .await?;
    Ok(([(header::CONTENT_TYPE, "image/png")], png).into_response())
}

/// Which board is wanted.
#[derive(Debug, Deserialize)]
pub(super) struct BoardQuery {
    #[serde(default)]
    board: String,
}

pub(super) async fn board_pdf(Query(wanted): Query<BoardQuery>) -> Answered<Response> {
    let board =
        board::parse(&wanted.board).map_err(|error| Problem::unclear(format!("board: {error}")))?;
    let sheet = sheet(&board).map_err(|error| Problem::unfit(format!("board: {error}")))?;
    Ok((attachment("application/pdf", "board.pdf"), sheet.pdf).into_response())
}

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
pub(super) async fn put_part(site: Site, request: Request) -> Answered<Json<Value>> {
    let placed: Placed = request::json(request).await?;
    let simulation = site.simulation.clone();
    let failed = "putting the part in place failed; see the log";
    alone("staging", failed, move || simulation.put(&placed)).await??;
    Ok(Json(site.simulation.view()))
}
