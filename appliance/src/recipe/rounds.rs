//! Round openings of a part that was taught become circles: whether a hole is there is found where
//! its rim should be, wherever the part lies and whatever is seen through it.

use super::archive::Arrays;
use super::golden::TaughtRecipe;
use super::plan::Plan;
use super::{FeatureFile, GaugeFile, Recipe, RecipeFile};
use crate::head::calibration::Calibration;
use algo::inspect::kinds::{Found, Roundness};
use algo::inspect::{Basis, FeatureKind, FoundFeature, SeenRim};
use std::f64::consts::TAU;

/// An opening is round if its rim is off a circle by at most this much, beside what noise makes, px.
const ROUND_PX: f64 = 0.5;
/// It is only found by its rim if golden shows this share of it: where pixels are coarse, or the rim
/// is disturbed, good parts would come near the least share.
const GOLDEN_FOUND: f64 = 0.8;
/// A region reaches so far beyond the opening, px.
const AROUND_PX: f64 = 12.0;
/// Corners of a region.
const CORNERS: usize = 8;
/// The least share of a rim that good parts have.
const LEAST_FOUND: f64 = 0.4;

impl TaughtRecipe {
    /// The same recipe, in which the openings that teaching has found are circles where they are
    /// round. Two frames cannot find a rim: recipes that begin with them stay as they are.
    ///
    /// # Errors
    /// In words, if it could not be packed.
    pub fn with_circles(self) -> Result<Self, String> {
        let Self {
            mut manifest,
            recipe,
            choice,
            ..
        } = self;
        let (arrays, head) = (recipe.arrays, manifest.head()?);
        let mut names = Vec::new();
        for at in 0..manifest.gauges.len() {
            let gauge = &manifest.gauges[at];
            let is_opening = gauge.measures.facts().basis == Basis::Pixels && gauge.low.is_none();
            let place = |name: &String| manifest.features.iter().position(|of| of.name == *name);
            let feature = gauge.of.first().and_then(place);
            let Some(feature) = feature.filter(|_| is_opening && !manifest.two_frames) else {
                continue;
            };
            let circle = around(&manifest.features[feature]);
            if !is_round(&manifest, &arrays, &head, &circle) {
                continue;
            }
            names.push(gauge.name.clone());
            manifest.gauges[at] = GaugeFile {
                low: Some(LEAST_FOUND),
                ..GaugeFile::new(gauge.slot, &gauge.name, Found {}, &[&circle.name])
            };
            manifest.features[feature] = circle;
        }
        if names.is_empty() {
            return Self::sealed(manifest, arrays, choice);
        }
        manifest.tried.retain(|tried| !names.contains(&tried.gauge));
        let mut reasons = choice.reasons;
        reasons.push(format!("{}: round, found by the rim", names.join(", ")));
        reasons.push(Self::CONTOURS.into());
        let mut taught = Self::of(manifest, arrays)?;
        taught.choice.reasons = reasons;
        Ok(taught)
    }
}

/// The region about an opening, of which a diamond is the feature.
fn around(diamond: &FeatureFile) -> FeatureFile {
    let count = diamond.region.len().max(1) as f64;
    let [u, v] = [0, 1].map(|i| diamond.region.iter().map(|of| of[i]).sum::<f64>() / count);
    let reach = diamond
        .region
        .iter()
        .map(|of| (of[0] - u).hypot(of[1] - v))
        .fold(0.0, f64::max);
    let corner = |at: usize| {
        let (sin, cos) = (TAU * at as f64 / CORNERS as f64).sin_cos();
        // Hundredths print shortly.
        let near = |at: f64| (at * 100.0).round() / 100.0;
        [
            near(u + (reach + AROUND_PX) * cos),
            near(v + (reach + AROUND_PX) * sin),
        ]
    };
    let corners = (0..CORNERS).map(corner).collect();
    FeatureFile::new(&*diamond.name, FeatureKind::Circle, corners)
}

/// Whether golden has a round hole there.
fn is_round(
    manifest: &RecipeFile,
    arrays: &Arrays,
    head: &Calibration,
    circle: &FeatureFile,
) -> bool {
    let alone = RecipeFile {
        features: vec![circle.clone()],
        gauges: vec![GaugeFile::new(
            1,
            "roundness",
            Roundness {},
            &[&circle.name],
        )],
        datums: Vec::new(),
        judges_nothing: true,
        ..manifest.clone()
    };
    let found = Recipe::fit(&alone, arrays.clone())
        .and_then(|recipe| Plan::golden(recipe, head).map_err(|error| error.to_string()));
    let Ok(golden) = found else { return false };
    let found = golden.findings;
    let seen = |feature: &&FoundFeature| feature.found >= GOLDEN_FOUND;
    let rim = found.features.iter().filter(seen).find_map(|of| of.rim);
    let (Some(reading), Some(SeenRim { pixel_mm, .. })) = (found.readings[0], rim) else {
        return false;
    };
    let off = reading.value - reading.expected.unwrap_or(0.0);
    off <= ROUND_PX * pixel_mm
}
