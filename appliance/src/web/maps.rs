//! Maps of a part as organised arrays, for programs: of the last result, of one whose frames are kept,
//! and of golden.
//!
//! They are worked out by a thread of their own, not by the measuring task, for one part at a time, and sent
//! as they are written.

use super::downloads::{Download, GONE, send};
use super::history::{layers, looking_back, unknown};
use super::problem::{Answered, Problem};
use super::request::Path;
use super::site::Site;
use crate::history::{Entry, JudgedPart};
use crate::output::npz::{OrganisedMaps, units};
use crate::recipe::plan::{GoldenView, Layers};
use crate::recipe::store::LoadedRecipe;
use axum::response::Response;
use serde_json::{Value, json};
use std::sync::Arc;

/// How x, y and z lie.
const AXES: &str = "the head's world: z is the height above the plane z = 0";

const KIND: &str = "application/octet-stream";

pub(super) async fn last(site: Site) -> Answered<Response> {
    let place = site.kept.clone().lock_owned().await;
    send(&site, KIND, move |site| {
        let _place = place;
        let part = site.last_cycle.ask(JudgedPart::clone);
        let part = part.ok_or_else(|| Problem::missing(GONE))?;
        let sigma = part.calibration.sigma.as_ref().map(|sigma| sigma.height_mm);
        looking_back(|| {
            let layers = part.plan.layers(part.sequence, &part.frames);
            let layers = layers.ok_or_else(|| Problem::missing(GONE))?;
            of(site, &Entry::of(&part.record), sigma, Arc::new(layers))
        })
    })
    .await
}

pub(super) async fn kept(site: Site, Path(seq): Path<u32>) -> Answered<Response> {
    let place = site.kept.clone().lock_owned().await;
    send(&site, KIND, move |site| {
        let layers = layers(site, place, seq)?;
        let entry = site.history.result(seq)?.ok_or_else(|| unknown(seq))?;
        let judge = site.recipes.manifest(entry.recipe).ok();
        let judge = judge.filter(|file| file.fingerprint.starts_with(&entry.fingerprint));
        let sigma = judge.and_then(|file| Some(file.calibration_sigma?.height_mm));
        looking_back(|| of(site, &entry, sigma, layers))
    })
    .await
}

/// The maps of a result.
fn of(
    site: &Site,
    entry: &Entry,
    calibration_sigma_mm: Option<f64>,
    layers: Arc<Layers>,
) -> Answered<(String, Download)> {
    let gauges = entry.gauges.iter().map(|gauge| {
        json!({
            "slot": gauge.slot, "name": gauge.name, "unit": gauge.unit, "value": gauge.value,
            "sigma": gauge.sigma, "U": gauge.uncertainty,
        })
    });
    let mut meta = described(site, calibration_sigma_mm);
    meta["history"] = json!(site.history.id()?);
    meta["seq"] = json!(entry.seq);
    meta["recipe"] = json!(entry.recipe);
    meta["fingerprint"] = json!(entry.fingerprint);
    meta["gauges"] = gauges.collect();
    let points = layers.points(1);
    // The page's picture may have them, too.
    let layers = Arc::unwrap_or_clone(layers);
    let maps = OrganisedMaps {
        width: layers.width,
        points,
        sigma: layers.sigma_mm,
        deviation: layers.deviation_mm,
        modulation: layers.modulation,
        meta,
    };
    let name = format!("{}-maps.npz", entry.seq);
    Ok((name, Download::Maps(Box::new(maps))))
}

fn described(site: &Site, calibration_sigma_mm: Option<f64>) -> Value {
    json!({
        "serial": site.station.snapshot().identity.serial, "units": units(), "axes": AXES,
        "calibration_sigma_mm": calibration_sigma_mm,
        "U": "of a height: 2 * sqrt(sigma**2 + calibration_sigma_mm**2)",
    })
}

pub(super) async fn golden(site: Site, Path(number): Path<u16>) -> Answered<Response> {
    let place = site.kept.clone().lock_owned().await;
    send(&site, KIND, move |site| {
        let _place = place;
        let LoadedRecipe { file, recipe, .. } = site.recipes.load_to_edit(number)?;
        let head = file.head().map_err(Problem::unfit)?;
        let view = GoldenView::new(&recipe, &head).map_err(Problem::unfit)?;
        let points = looking_back(|| Ok(view.points(&recipe, 1)))?;
        let sigma = file.calibration_sigma.map(|sigma| sigma.height_mm);
        let mut meta = described(site, sigma);
        meta["recipe"] = json!(number);
        meta["fingerprint"] = json!(file.fingerprint);
        let unknown = vec![f32::NAN; recipe.arrays.golden_height.len()];
        let maps = OrganisedMaps {
            width: recipe.conditions.camera.0 as usize,
            points,
            sigma: unknown.clone(),
            deviation: unknown,
            modulation: recipe.arrays.modulation.to_vec(),
            meta,
        };
        let name = format!("{number:04}-maps.npz");
        Ok((name, Download::Maps(Box::new(maps))))
    })
    .await
}
