//! Recipes: list, look, export, import, edit.

use axum::body::Body;
use axum::extract::{Path, Request, State};
use axum::http::StatusCode;
use axum::response::{Json, Response};
use serde_json::{Value, json};

use super::downloads::file;
use super::map::{Map, map};
use super::problem::Problem;
use super::site::Site;
use super::{body, orders};
use crate::plan::{Plan, PlanError};
use crate::recipe::edit::{self, Edit, EditError};
use crate::recipe::store::Loaded;
use crate::recipe::{LoadError, Recipe};

impl From<LoadError> for Problem {
    fn from(error: LoadError) -> Self {
        match &error {
            LoadError::Unknown(_) => Self::missing(error.to_string()),
            LoadError::Corrupt { .. } => Self::unfit(error.to_string()),
        }
    }
}

impl From<EditError> for Problem {
    fn from(error: EditError) -> Self {
        let words = error.to_string();
        match error {
            EditError::Load(error) => error.into(),
            EditError::Outdated(_) => Self::busy(words),
            EditError::Unfit(_) => Self::unfit(words),
            EditError::Store(_) => Self::broken(words),
        }
    }
}

pub(super) async fn list(State(site): State<Site>) -> Result<Json<Value>, Problem> {
    let rows = site
        .aside(|site| {
            let numbers = site.recipes.numbers();
            Ok(numbers
                .into_iter()
                .map(|number| match site.recipes.manifest(number) {
                    Ok(file) => json!({
                        "number": number, "name": file.name, "part_number": file.part_number,
                        "fingerprint": file.fingerprint, "taught_at_unix_s": file.taught_at_unix_s,
                        "gauges": file.gauges.len(),
                        "frames": file.sequences.get(file.production).map(|sequence| sequence.frames.len()),
                    }),
                    Err(words) => json!({ "number": number, "error": words }),
                })
                .collect::<Vec<_>>())
        })
        .await?;
    Ok(Json(json!({ "recipes": rows })))
}

/// Everything of a recipe that is no array: `recipe.json`.
pub(super) async fn one(
    State(site): State<Site>,
    Path(number): Path<u16>,
) -> Result<Json<Value>, Problem> {
    let read = site.aside(move |site| site.recipes.manifest(number).map_err(Problem::missing));
    let file = serde_json::to_value(read.await?);
    file.map(Json)
        .map_err(|error| Problem::broken(error.to_string()))
}

pub(super) async fn export(
    State(site): State<Site>,
    Path(number): Path<u16>,
) -> Result<Response, Problem> {
    file(&site, "application/zip", move |site| {
        let read = site.recipes.bytes(number);
        let failed = |error| Problem::missing(format!("read recipe {number}: {error}"));
        Ok((format!("{number:04}.recipe"), read.map_err(failed)?))
    })
    .await
}

pub(super) async fn picture(
    State(site): State<Site>,
    Path((number, layer)): Path<(u16, String)>,
) -> Result<Map, Problem> {
    site.aside(move |site| {
        let Loaded { recipe, .. } = site.recipes.load_to_edit(number)?;
        let width = recipe.file.camera.width as usize;
        match layer.as_str() {
            "height" => Ok(map(&recipe.arrays.golden_height, width, "mm", false, None)),
            "modulation" => Ok(map(&recipe.arrays.modulation, width, "counts", false, None)),
            _ => Err(Problem::missing("a recipe has height and modulation")),
        }
    })
    .await
}

pub(super) async fn edit(
    State(site): State<Site>,
    Path(number): Path<u16>,
    request: Request<Body>,
) -> Result<Json<Value>, Problem> {
    let wanted: Edit = body::json(request.into_body()).await?;
    let edited = site.change(move |site| {
        let mut note = None;
        let fits = |recipe| {
            note = tried(site, recipe)?;
            Ok(())
        };
        let fingerprint = edit::edit(&site.recipes, number, wanted, fits)?;
        Ok((fingerprint, note))
    });
    let (fingerprint, note) = edited.await?;
    let active = site.station.snapshot().active();
    let loading = active == Some(number) && orders::begin_load(&site, number).is_ok();
    Ok(Json(
        json!({ "fingerprint": fingerprint, "loading": loading, "note": note }),
    ))
}

/// Tries out a recipe that is to be stored; where that cannot be done here, words that say why.
///
/// # Errors
/// In words: it cannot be used on this head, though it was made for it.
fn tried(site: &Site, recipe: Recipe) -> Result<Option<String>, String> {
    let Some(calibration) = site.calibration.get() else {
        let words =
            "no calibrated head is open: whether the recipe can be used shows when it is loaded";
        return Ok(Some(words.into()));
    };
    match Plan::try_out(recipe, &calibration) {
        Ok(()) => Ok(None),
        Err(error @ PlanError::OtherCalibration { .. }) => Ok(Some(error.to_string())),
        Err(error) => Err(error.to_string()),
    }
}

pub(super) async fn import(
    State(site): State<Site>,
    request: Request<Body>,
) -> Result<(StatusCode, Json<Value>), Problem> {
    let bytes = body::file(request.into_body()).await?;
    let stored = site.change(move |site| {
        let recipe =
            Recipe::from_bytes(&bytes).map_err(|error| Problem::unfit(error.to_string()))?;
        let (number, name) = (recipe.file.number, recipe.file.name.clone());
        let fingerprint = recipe.file.fingerprint.clone();
        let note = tried(site, recipe).map_err(Problem::unfit)?;
        let saved = site.recipes.save(number, &bytes);
        saved.map_err(|error| {
            Problem::broken(format!("store recipe {number}: {error}: free space"))
        })?;
        Ok(json!({ "number": number, "name": name, "fingerprint": fingerprint, "note": note }))
    });
    Ok((StatusCode::CREATED, Json(stored.await?)))
}
