//! Round openings of a part that was taught become circles, and long ones slots: whether a hole is there is found where
//! its rim should be, wherever the part lies and whatever is seen through it.

use super::golden::UnsealedRecipe;
use super::planner;
use super::planner::Choice;
use crate::head::calibration::Calibration;
use crate::recipe::file::archive::Arrays;
use crate::recipe::plan::Plan;
use crate::recipe::{FeatureFile, GaugeFile, Recipe, RecipeFile, Refusal};
use crate::system::headway::Headway;
use algo::inspect::kinds::{Found, Roundness};
use algo::inspect::{
    Basis, FeatureKind, Findings, FoundFeature, Geometry, Reading, SeenRim, State,
};
use std::f64::consts::TAU;

/// An opening is round if its rim is off a circle by at most this much, beside what noise makes, px.
const ROUND_PX: f64 = 0.5;
/// An opening is a slot if its rim is off one by at most this much (RMS), px.
const SLOT_PX: f64 = 0.15;
/// It is only found by its rim if golden shows this share of it: where pixels are coarse, or the rim
/// is disturbed, good parts would come near the least share.
const GOLDEN_FOUND: f64 = 0.8;
/// The same of a slot, whose length shows more of what other openings light.
const GOLDEN_SLOT: f64 = 0.6;
/// A slot is so many times as long as it is wide: a round opening whose rim is disturbed is none.
const LONG: f64 = 1.5;
/// A region reaches so far beyond the opening: in pixels, and in mm at least, which fine pixels need.
const AROUND_PX: f64 = 12.0;
const AROUND_MM: f64 = 3.0;
/// What an opening may be, and what is said of it.
const SHAPES: [(FeatureKind, &str); 2] = [
    (FeatureKind::Circle, "round"),
    (FeatureKind::Slot, "a slot"),
];
/// Corners of a region.
const CORNERS: usize = 8;
/// The least share of a rim that good parts have.
const LEAST_FOUND: f64 = 0.4;

impl UnsealedRecipe {
    /// The same recipe, in which the openings that teaching has found are circles where they are
    /// round, and slots where they are that. Two frames cannot find a rim: recipes that begin with them stay as they
    /// are.
    ///
    /// # Errors
    /// In words, if its manifest has no models of a head.
    pub fn with_rims(self, headway: Headway<'_>) -> Result<Self, Refusal> {
        let Self {
            mut manifest,
            arrays,
            choice,
        } = self;
        let head = manifest.head()?;
        let taught = manifest.clone();
        let mut openings = openings(&manifest);
        let reach = AROUND_PX.max(AROUND_MM / pixel_mm(&head));
        let mut rims = Vec::new();
        let looking = [headway.part(0.0, 0.5), headway.part(0.5, 0.8)];
        for ((kind, word), headway) in SHAPES.into_iter().zip(looking) {
            if manifest.two_frames || openings.is_empty() {
                break;
            }
            let around = |of: &OpeningGauge| {
                let diamond = &manifest.features[of.feature];
                let corners = match kind {
                    FeatureKind::Slot => {
                        enclosing(diamond, &arrays.valid, head.camera.width(), reach)
                    }
                    _ => around(diamond, reach),
                };
                FeatureFile::new(&*diamond.name, kind, corners)
            };
            let regions: Vec<FeatureFile> = openings.iter().map(around).collect();
            let found = found(&manifest, &arrays, &head, &regions, headway);
            let mut others = Vec::new();
            for ((opening, region), is_found) in openings.into_iter().zip(regions).zip(found) {
                if !is_found {
                    others.push(opening);
                    continue;
                }
                let gauge = &mut manifest.gauges[opening.gauge];
                *gauge = GaugeFile {
                    low: Some(LEAST_FOUND),
                    ..GaugeFile::new(gauge.slot, &gauge.name, Found {}, &[&region.name])
                };
                manifest.features[opening.feature] = region;
                rims.push((opening, word));
            }
            openings = others;
        }
        let sealed = headway.part(0.8, 1.0);
        keep_fitting((&mut manifest, &taught), &mut rims, &arrays, &head, sealed)?;
        if rims.is_empty() {
            return Ok(Self {
                manifest: taught,
                arrays,
                choice,
            });
        }
        let mut reasons = choice.reasons;
        for (_, word) in SHAPES {
            let of_kind = rims.iter().filter(|(_, of)| *of == word);
            let names: Vec<&str> = of_kind
                .map(|(of, _)| &*manifest.gauges[of.gauge].name)
                .collect();
            if !names.is_empty() {
                reasons.push(format!("{}: {word}, found by the rim", names.join(", ")));
            }
        }
        let is_rim = |name: &str| {
            let mut names = rims.iter().map(|(of, _)| &manifest.gauges[of.gauge].name);
            names.any(|own| own == name)
        };
        manifest.tried.retain(|tried| !is_rim(&tried.gauge));
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
struct OpeningGauge {
    gauge: usize,
    feature: usize,
}

/// Takes back the rims with which production cannot be planned: of which another sequence shows too little.
fn keep_fitting(
    (manifest, taught): (&mut RecipeFile, &RecipeFile),
    rims: &mut Vec<(OpeningGauge, &str)>,
    arrays: &Arrays,
    head: &Calibration,
    mut headway: Headway<'_>,
) -> Result<(), Refusal> {
    while !rims.is_empty() {
        let recipe = Recipe::fit(manifest, arrays.clone())?;
        let planning = headway.part(0.0, 0.5);
        headway = headway.part(0.5, 1.0);
        let unfit = match Plan::check(recipe, head, planning) {
            Ok(()) => break,
            Err(error) => Refusal::from(error),
        };
        let Some(crate::recipe::Element { place: unfit, .. }) = unfit.of else {
            return Err(unfit);
        };
        let at = rims.iter().position(|(of, _)| of.feature == unfit);
        let at = at.ok_or_else(|| format!("feature {unfit} cannot be planned: teach again"))?;
        let (OpeningGauge { gauge, feature }, _) = rims.remove(at);
        manifest.gauges[gauge] = taught.gauges[gauge].clone();
        manifest.features[feature] = taught.features[feature].clone();
    }
    Ok(())
}

fn openings(manifest: &RecipeFile) -> Vec<OpeningGauge> {
    let opening = |(gauge, of): (usize, &GaugeFile)| {
        let is_opening = of.measures.facts().basis == Basis::Pixels && of.low.is_none();
        let name = of.of.first().filter(|_| is_opening)?;
        let place = manifest.features.iter().position(|of| of.name == *name);
        place.map(|feature| OpeningGauge { gauge, feature })
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

/// The middle of a feature's corners.
fn middle(of: &FeatureFile) -> [f64; 2] {
    let count = of.region.len().max(1) as f64;
    [0, 1].map(|i| of.region.iter().map(|of| of[i]).sum::<f64>() / count)
}

/// Hundredths print shortly.
fn short(at: f64) -> f64 {
    (at * 100.0).round() / 100.0
}

/// The region about an opening, of which a diamond is the feature, and so many pixels beyond it.
fn around(diamond: &FeatureFile, beyond: f64) -> Vec<[f64; 2]> {
    let [u, v] = middle(diamond);
    let reach = diamond
        .region
        .iter()
        .map(|of| (of[0] - u).hypot(of[1] - v))
        .fold(0.0, f64::max);
    let corner = |at: usize| {
        let (sin, cos) = (TAU * at as f64 / CORNERS as f64).sin_cos();
        [
            short(u + (reach + beyond) * cos),
            short(v + (reach + beyond) * sin),
        ]
    };
    (0..CORNERS).map(corner).collect()
}

/// The box about all pixels of an opening that golden is not compared at, from the middle of its diamond on, and so
/// many pixels beyond them inside the frame. It has few corners: fingers move them.
fn enclosing(diamond: &FeatureFile, valid: &[u8], width: usize, beyond: f64) -> Vec<[f64; 2]> {
    let [u, v] = middle(diamond);
    let (mut low, mut high) = ([u, v], [u, v]);
    let mut is_seen = vec![false; valid.len()];
    let mut next = vec![(u.round() as usize, v.round() as usize)];
    while let Some((column, row)) = next.pop() {
        let place = row * width + column;
        let is_open = column < width && valid.get(place) == Some(&0);
        if !is_open || std::mem::replace(&mut is_seen[place], true) {
            continue;
        }
        for (i, at) in [column as f64, row as f64].into_iter().enumerate() {
            (low[i], high[i]) = (low[i].min(at), high[i].max(at));
        }
        next.extend([(column + 1, row), (column, row + 1)]);
        next.extend(column.checked_sub(1).map(|column| (column, row)));
        next.extend(row.checked_sub(1).map(|row| (column, row)));
    }
    let last = [width, valid.len() / width.max(1)].map(|pixels| pixels.saturating_sub(1) as f64);
    let [left, top] = low.map(|low| short((low - beyond).max(0.0)));
    let [right, bottom] = [0, 1].map(|i| short((high[i] + beyond).min(last[i])));
    vec![[left, top], [right, top], [right, bottom], [left, bottom]]
}

/// Which of these circles or slots golden has: all are looked for by one plan, without those
/// of which it sees nothing.
fn found(
    manifest: &RecipeFile,
    arrays: &Arrays,
    head: &Calibration,
    rims: &[FeatureFile],
    mut headway: Headway<'_>,
) -> Vec<bool> {
    let mut found = vec![false; rims.len()];
    let mut left: Vec<usize> = (0..rims.len()).collect();
    while !left.is_empty() {
        let looked = left.iter().map(|&at| rims[at].clone()).collect();
        let looking = headway.part(0.0, 0.5);
        headway = headway.part(0.5, 1.0);
        match of_rims(manifest, looked).golden((arrays, head), true, looking) {
            Ok(golden) => {
                for (at, is_found) in left.into_iter().zip(are_found(&golden.findings)) {
                    found[at] = is_found;
                }
                break;
            }
            Err(Refusal {
                of: Some(unseen), ..
            }) if unseen.place < left.len() => drop(left.remove(unseen.place)),
            Err(_) => break,
        }
    }
    found
}

/// A recipe of the form of these circles and slots.
fn of_rims(manifest: &RecipeFile, rims: Vec<FeatureFile>) -> RecipeFile {
    let form = |(slot, rim): (u16, &FeatureFile)| {
        let name = &*rim.name;
        match rim.kind {
            FeatureKind::Circle => GaugeFile::new(slot, name, Roundness {}, &[name]),
            _ => GaugeFile::new(slot, name, Found {}, &[name]),
        }
    };
    RecipeFile {
        gauges: (1..).zip(&rims).map(form).collect(),
        features: rims,
        datums: Vec::new(),
        judges_nothing: true,
        ..manifest.clone()
    }
}

/// Which features are seen and of their form, in the order of the gauges of it.
fn are_found(findings: &Findings) -> impl Iterator<Item = bool> {
    let is_found = |(at, reading): (usize, &Option<Reading>)| {
        let seen = |of: &&FoundFeature| of.feature == at && of.state == State::Found;
        let feature = findings.features.iter().find(seen)?;
        let SeenRim {
            pixel_mm, off_mm, ..
        } = feature.rim?;
        let reading = reading.as_ref()?;
        Some(match feature.geometry? {
            Geometry {
                sizes: [Some(length), Some(width)],
                ..
            } => {
                let is_long = length >= LONG * width;
                is_long && feature.found >= GOLDEN_SLOT && off_mm <= SLOT_PX * pixel_mm
            }
            _ => {
                let off = reading.value - reading.expected.unwrap_or(0.0);
                feature.found >= GOLDEN_FOUND && off <= ROUND_PX * pixel_mm
            }
        })
    };
    let readings = findings.readings.iter().enumerate();
    readings.map(move |reading| is_found(reading).unwrap_or(false))
}
