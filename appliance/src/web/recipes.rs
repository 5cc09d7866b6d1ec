//! Recipes: list, show, export, import, edit, delete, and undo.

use axum::Extension;
use axum::body::Body;
use axum::extract::Request;
use axum::http::StatusCode;
use axum::response::{Json, Response};
use serde_json::{Value, json};

use super::downloads::{Download, send};
use super::gate::Changed;
use super::look::{Level, SURFACE};
use super::map::{Drawn, Map, Plane, map, surface};
use super::orders::{self, Reload};
use super::problem::{Answered, Problem};
use super::request;
use super::request::{Path, Query};
use super::site::Site;
use crate::recipe::edit::{self, Edit, Edited};
use crate::recipe::plan::{GoldenView, Plan, PlanError};
use crate::recipe::store::LoadedRecipe;
use crate::recipe::store::exchange::Destination;
use crate::recipe::{ChangeError, LoadError, Recipe, RecipeFile};
use crate::station::control::MAX_RECIPE;
use std::collections::HashMap;
use std::time::{Duration, Instant};

/// A recipe whose planning takes longer is stored with a warning.
const SLOW: Duration = Duration::from_secs(5);

impl From<LoadError> for Problem {
    fn from(error: LoadError) -> Self {
        match error {
            LoadError::Unknown(_) => Self::missing(error),
            _ => Self::unfit(error),
        }
    }
}

impl From<ChangeError> for Problem {
    fn from(error: ChangeError) -> Self {
        let words = error.to_string();
        match error {
            ChangeError::Load(error) => error.into(),
            ChangeError::Nothing(_) | ChangeError::Missing { .. } => Self::missing(words),
            ChangeError::Outdated(_) => Self::busy(words).with("why", "outdated"),
            ChangeError::Taken { number, .. } => Self::busy(words).with("taken", number),
            ChangeError::Unfit(_) => Self::unfit(words),
            ChangeError::Store(error) | ChangeError::Write { source: error, .. } => {
                Self::unstored(words, &error)
            }
        }
    }
}

pub(super) async fn list(site: Site) -> Answered<Json<Value>> {
    let listed = site.aside(|site| Ok(listed(site))).await?;
    Ok(Json(listed))
}

/// What gauges can measure.
pub(super) async fn kinds() -> Json<Value> {
    Json(crate::recipe::file::kinds::json())
}

fn listed(site: &Site) -> Value {
    let recipes = &site.recipes;
    // Without the record it is not known who made them.
    let makers = site.access.record().makers().unwrap_or_default();
    let summary = |file: &RecipeFile| summary(file, &makers);
    let rows = recipes.numbers().into_iter().map(|number| {
        let mut row = match recipes.manifest(number) {
            Ok(file) => summary(&file),
            Err(error) => json!({ "number": number, "error": error.words }),
        };
        row["before"] = recipes.manifest_before(number).as_ref().map(summary).into();
        row
    });
    let deleted = recipes.deleted().into_iter();
    let deleted = deleted.filter_map(|number| Some(summary(&recipes.manifest_before(number)?)));
    json!({
        "recipes": rows.collect::<Vec<_>>(), "deleted": deleted.collect::<Vec<_>>(), "free": recipes.free(),
    })
}

fn summary(file: &RecipeFile, makers: &HashMap<String, String>) -> Value {
    let taught_by = Some(&file.taught_by).filter(|by| !by.starts_with("fringed"));
    json!({
        "number": file.number, "name": file.name, "part_number": file.part_number,
        "fingerprint": file.fingerprint, "taught_at_unix_s": file.taught_at_unix_s,
        "made_by": makers.get(&file.fingerprint).or(taught_by),
        "features": file.features.len(), "gauges": file.gauges.len(), "judges_nothing": file.judges_nothing,
        "everything": file.everything,
        "frames": file.sequences.get(file.production).map(|sequence| sequence.frames.len()),
    })
}

/// `recipe.json`: everything of a recipe except its arrays.
pub(super) async fn one(site: Site, Path(number): Path<u16>) -> Answered<Json<Value>> {
    let read = site.aside(move |site| site.recipes.manifest(number).map_err(Problem::missing));
    let file = serde_json::to_value(read.await?);
    file.map(Json).map_err(Problem::broken)
}

pub(super) async fn export(site: Site, Path(number): Path<u16>) -> Answered<Response> {
    send(&site, "application/zip", move |site| {
        let opened = site.recipes.file(number);
        let failed = |error| Problem::missing(format!("read recipe {number}: {error}"));
        let file = Download::Stored(opened.map_err(failed)?);
        Ok((format!("{number:04}.recipe"), file))
    })
    .await
}

pub(super) async fn picture(
    site: Site,
    Path((number, layer)): Path<(u16, String)>,
    Query(level): Query<Level>,
) -> Answered<Map> {
    site.aside(move |site| {
        let LoadedRecipe { file, recipe, .. } = site.recipes.load_to_edit(number)?;
        let head = file.head().map_err(Problem::unfit)?;
        let view = GoldenView::new(&recipe, &head).map_err(Problem::unfit)?;
        let width = recipe.conditions.camera.0 as usize;
        let arrays = &recipe.arrays;
        let plain = |values, unit| map(values, width, unit, Drawn::Plain, None);
        let mut picture = match layer.as_str() {
            "height" => plain(&arrays.golden_height, "mm"),
            "modulation" => plain(&arrays.modulation, "counts"),
            SURFACE => {
                let sampling = level.sampling(width)?;
                let mut planes = Plane::points(view.points(&recipe, sampling.stride));
                let light = &arrays.modulation;
                planes.push(Plane::of(
                    "modulation",
                    "counts",
                    light,
                    sampling,
                    Drawn::Plain,
                ));
                surface(&planes, sampling, None)
            }
            _ => {
                let words = "a recipe has height, modulation and surface";
                return Err(Problem::missing(words));
            }
        };
        picture.description["pixel_mm"] = view.pixel_mm().into();
        Ok(picture)
    })
    .await
}

pub(super) async fn edit(
    site: Site,
    Path(number): Path<u16>,
    request: Request<Body>,
) -> Answered<(Extension<Changed>, Json<Value>)> {
    let wanted: Edit = request::edit(request).await?;
    let edited = site.change(move |site| {
        let mut note = None;
        let fits = |recipe| {
            note = tried(site, recipe).map_err(|error| error.to_string())?;
            Ok(())
        };
        let edited = edit::edit(&site.recipes, number, wanted, fits)?;
        Ok((edited, note))
    });
    let (edited, note) = edited.await?;
    let Edited {
        fingerprint,
        changed,
        other_slots,
    } = edited;
    let slots = other_slots.map(|slots| format!("the PLC finds gauges elsewhere, {slots}"));
    let note = slots.into_iter().chain(note);
    let note = note.reduce(|all, note| format!("{all}; {note}"));
    let Reload { active, loading } = orders::reload(&site, number).await;
    let answer = json!({
        "fingerprint": fingerprint, "active": active, "loading": loading, "note": note,
    });
    let changed = Changed {
        words: changed,
        recipe: Some((number, fingerprint)),
    };
    Ok((Extension(changed), Json(answer)))
}

/// Brings back the previous generation, or a deleted recipe.
pub(super) async fn undo(
    site: Site,
    Path(number): Path<u16>,
) -> Answered<(Extension<Changed>, Json<Value>)> {
    orders::recipes_unused(&site, "undo a recipe")?;
    let (file, before) = site
        .change(move |site| {
            let calibration = site.calibration.get();
            let calibration = calibration.map(|calibration| calibration.fingerprint());
            let before = site.recipes.present(number);
            let file = site.recipes.undo(number, calibration.as_deref())?;
            Ok((file, before))
        })
        .await?;
    let Reload { active, loading } = orders::reload(&site, number).await;
    let changed = match before {
        Some(before) => file.differences(&before),
        None => "brought back".into(),
    };
    // The version was made by whom the record names for it.
    let changed = Changed::from(format!("fingerprint {:.8}: {changed}", file.fingerprint));
    let answer = json!({
        "number": number, "name": file.name, "fingerprint": file.fingerprint, "active": active, "loading": loading,
    });
    Ok((Extension(changed), Json(answer)))
}

/// Deletes a recipe that is not the active one; undo brings it back.
pub(super) async fn delete(site: Site, Path(number): Path<u16>) -> Answered<Json<Value>> {
    orders::recipes_unused(&site, "delete a recipe")?;
    if site.station.snapshot().active() == Some(number) {
        return Err(Problem::busy(format!(
            "delete recipe {number}: it is the active one: load another recipe first"
        )));
    }
    site.change(move |site| Ok(site.recipes.delete(number)?))
        .await?;
    Ok(Json(json!({ "number": number })))
}

/// Checks that a recipe that is to be stored can be used; answers with the reason where that cannot
/// be checked on this head.
///
/// # Errors
/// [`PlanError::Unfit`]: it was made for this head and cannot be used on it.
fn tried(site: &Site, recipe: Recipe) -> Result<Option<String>, PlanError> {
    let Some(calibration) = site.calibration.get() else {
        let words =
            "no calibrated head is open: whether the recipe can be used shows when it is loaded";
        return Ok(Some(words.into()));
    };
    let begun = Instant::now();
    let planned = Plan::try_out(recipe, &calibration);
    let took = begun.elapsed();
    match planned {
        Ok(()) if took > SLOW => Ok(Some(format!(
            "planning it takes {:.0} s, and so does each load: a PLC that changes recipes waits; fewer or coarser gauges take less",
            took.as_secs_f64()
        ))),
        Ok(()) => Ok(None),
        Err(error @ PlanError::Unfit { .. }) => Err(error),
        Err(error) => Ok(Some(error.to_string())),
    }
}

/// Takes a recipe from a file: under the number in the file or another one, and in place of a
/// stored recipe only on request.
pub(super) async fn import(
    site: Site,
    Query(to): Query<Destination>,
    request: Request<Body>,
) -> Answered<(StatusCode, Extension<Changed>, Json<Value>)> {
    if let Some(number) = to
        .number
        .filter(|number| !(1..=MAX_RECIPE).contains(number))
    {
        return Err(Problem::unfit(format!(
            "import as recipe {number}: numbers are 1 to {MAX_RECIPE}"
        )));
    }
    let folder = site.recipes.folder().to_path_buf();
    let upload = request::file(&site, request, folder, request::RECIPE).await?;
    let stored = site.change(move |site| {
        let mut recipe = upload.file.recipe().map_err(Problem::unfit)?;
        let id = recipe.id.clone();
        // What is said of it is said of the number that it gets.
        recipe.id.number = to.number.unwrap_or(id.number);
        let tried = tried(site, recipe).map_err(Problem::unfit)?;
        let replace = "add ?replace=true to replace it";
        let imported = site.recipes.take(upload.file, id, to, replace)?;
        let notes = imported.note().into_iter().chain(tried);
        let note = notes.reduce(|all, note| format!("{all}; {note}"));
        Ok((imported, note))
    });
    let (imported, note) = stored.await?;
    let changed = Extension(Changed {
        words: imported.changed(),
        recipe: Some((imported.id.number, imported.id.fingerprint.clone())),
    });
    let id = imported.id;
    let answer = json!({
        "number": id.number, "name": id.name, "fingerprint": id.fingerprint, "note": note,
    });
    Ok((StatusCode::CREATED, changed, Json(answer)))
}
