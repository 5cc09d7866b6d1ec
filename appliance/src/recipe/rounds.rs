//! Round openings of a part that was taught become circles: whether a hole is there is found where
//! its rim should be, wherever the part lies and whatever is seen through it.

use super::archive::Arrays;
use super::golden::UnsealedRecipe;
use super::plan::{Plan, PlanError};
use super::planner::{self, Choice};
use super::{FeatureFile, GaugeFile, Recipe, RecipeFile};
use crate::head::calibration::Calibration;
use crate::system::headway::Headway;
use algo::inspect::kinds::{Found, Roundness};
use algo::inspect::{Basis, FeatureKind, Findings, FoundFeature, Reading, SeenRim, State};
use std::f64::consts::TAU;

/// An opening is round if its rim is off a circle by at most this much, beside what noise makes, px.
const ROUND_PX: f64 = 0.5;
/// It is only found by its rim if golden shows this share of it: where pixels are coarse, or the rim
/// is disturbed, good parts would come near the least share.
const GOLDEN_FOUND: f64 = 0.8;
/// A region reaches so far beyond the opening: in pixels, and in mm at least, which fine pixels need.
const AROUND_PX: f64 = 12.0;
const AROUND_MM: f64 = 3.0;
/// Corners of a region.
const CORNERS: usize = 8;
/// The least share of a rim that good parts have.
const LEAST_FOUND: f64 = 0.4;

impl UnsealedRecipe {
    /// The same recipe, in which the openings that teaching has found are circles where they are
    /// round. Two frames cannot find a rim: recipes that begin with them stay as they are.
    ///
    /// # Errors
    /// In words, if its manifest has no models of a head.
    pub fn with_circles(self, headway: Headway<'_>) -> Result<Self, String> {
        let Self {
            mut manifest,
            arrays,
            choice,
        } = self;
        let head = manifest.head()?;
        let openings = openings(&manifest);
        let reach = AROUND_PX.max(AROUND_MM / pixel_mm(&head));
        let circles = openings
            .iter()
            .map(|opening| around(&manifest.features[opening.feature], reach));
        let circles: Vec<FeatureFile> = circles.collect();
        let round = match manifest.two_frames {
            true => vec![false; circles.len()],
            false => round(&manifest, &arrays, &head, &circles, headway),
        };
        let mut names = Vec::new();
        let found = openings.into_iter().zip(circles).zip(round);
        for ((opening, circle), _) in found.filter(|(_, is_round)| *is_round) {
            let gauge = &mut manifest.gauges[opening.gauge];
            names.push(gauge.name.clone());
            *gauge = GaugeFile {
                low: Some(LEAST_FOUND),
                ..GaugeFile::new(gauge.slot, &gauge.name, Found {}, &[&circle.name])
            };
            manifest.features[opening.feature] = circle;
        }
        if names.is_empty() {
            return Ok(Self {
                manifest,
                arrays,
                choice,
            });
        }
        manifest.tried.retain(|tried| !names.contains(&tried.gauge));
        let mut reasons = choice.reasons;
        reasons.push(format!("{}: round, found by the rim", names.join(", ")));
        reasons.push(Self::CONTOURS.into());
        // Golden was seen to have them, so nothing is left to settle but the sequence.
        let choice = planner::choose(&manifest.sequences, &manifest.gauges, arrays.widest());
        manifest.production = choice.production;
        let choice = Choice { reasons, ..choice };
        Ok(Self {
            manifest,
            arrays,
            choice,
        })
    }
}

/// An opening of a recipe: the places of its gauge and of its feature.
struct Opening {
    gauge: usize,
    feature: usize,
}

fn openings(manifest: &RecipeFile) -> Vec<Opening> {
    let opening = |(gauge, of): (usize, &GaugeFile)| {
        let is_opening = of.measures.facts().basis == Basis::Pixels && of.low.is_none();
        let name = of.of.first().filter(|_| is_opening)?;
        let place = manifest.features.iter().position(|of| of.name == *name);
        place.map(|feature| Opening { gauge, feature })
    };
    manifest
        .gauges
        .iter()
        .enumerate()
        .filter_map(opening)
        .collect()
}

/// What a pixel in the middle of the frame sees of the reference plane, mm.
fn pixel_mm(head: &Calibration) -> f64 {
    let camera = &head.camera;
    camera.centre().z / -camera.axis().z / camera.model().fx
}

/// The region about an opening, of which a diamond is the feature, and so many pixels beyond it.
fn around(diamond: &FeatureFile, beyond: f64) -> FeatureFile {
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
            near(u + (reach + beyond) * cos),
            near(v + (reach + beyond) * sin),
        ]
    };
    let corners = (0..CORNERS).map(corner).collect();
    FeatureFile::new(&*diamond.name, FeatureKind::Circle, corners)
}

/// Which of these circles are round holes of golden: all are looked for by one plan, without those
/// of which it sees nothing.
fn round(
    manifest: &RecipeFile,
    arrays: &Arrays,
    head: &Calibration,
    circles: &[FeatureFile],
    mut headway: Headway<'_>,
) -> Vec<bool> {
    let mut round = vec![false; circles.len()];
    let mut left: Vec<usize> = (0..circles.len()).collect();
    while !left.is_empty() {
        let looked = left.iter().map(|&at| circles[at].clone()).collect();
        let recipe = Recipe::fit(&of_roundness(manifest, looked), arrays.clone());
        let Ok(recipe) = recipe else { break };
        let looking = headway.part(0.0, 0.5);
        headway = headway.part(0.5, 1.0);
        match Plan::golden_leniently(recipe, head, looking) {
            Ok(golden) => {
                for (at, is_round) in left.into_iter().zip(are_round(&golden.findings)) {
                    round[at] = is_round;
                }
                break;
            }
            Err(PlanError::Unfit {
                feature: Some(unseen),
                ..
            }) if unseen < left.len() => drop(left.remove(unseen)),
            Err(_) => break,
        }
    }
    round
}

/// A recipe of the roundness of these circles.
fn of_roundness(manifest: &RecipeFile, circles: Vec<FeatureFile>) -> RecipeFile {
    let roundness = |(slot, circle): (u16, &FeatureFile)| {
        let name = &*circle.name;
        GaugeFile::new(slot, name, Roundness {}, &[name])
    };
    RecipeFile {
        gauges: (1..).zip(&circles).map(roundness).collect(),
        features: circles,
        datums: Vec::new(),
        judges_nothing: true,
        ..manifest.clone()
    }
}

/// Which features are seen and round, in the order of the gauges of their roundness.
fn are_round(findings: &Findings) -> impl Iterator<Item = bool> {
    let is_round = |(at, reading): (usize, &Option<Reading>)| {
        let seen = |of: &&FoundFeature| {
            of.feature == at && of.state == State::Found && of.found >= GOLDEN_FOUND
        };
        let rim = findings.features.iter().find(seen)?.rim;
        let SeenRim { pixel_mm, .. } = rim?;
        let reading = reading.as_ref()?;
        Some(reading.value - reading.expected.unwrap_or(0.0) <= ROUND_PX * pixel_mm)
    };
    let readings = findings.readings.iter().enumerate();
    readings.map(move |reading| is_round(reading).unwrap_or(false))
}
