//! The limits that teaching sets: good parts are within them, as predicted, and dents are not.

use super::placement::{Bed, TIMEOUT, bed, naming, taught_asking};
use algo::geometry::Vector;
use algo::units::Height;
use appliance::recipe::Recipe;
use appliance::recipe::file::GoodPartsFile;
use appliance::recipe::plan::Plan;
use appliance::recipe::teach::golden::Naming;
use appliance::station::{Inspection, Verdict};
use sim::parts::{Defect, Flowerpot, SheetMetal};
use sim::scenario::Noise;
use sim::{Part, Placement, Scenario};
use std::time::Instant;
use tests::random::Random;

const STOCK: [&str; 10] = [
    "cone",
    "sawtooth",
    "sphere",
    "tube",
    "flowerpot",
    "spline",
    "face",
    "handset",
    "plane",
    "sheet_metal",
];
/// Of the dents.
const DEPTH_MM: f64 = 0.3;
/// Of the dents.
const DIAMETER_MM: f64 = 8.0;
/// The tolerance for which the limits are set, ± mm.
const TOLERANCE_MM: f64 = 0.15;
/// Half the height of the flowerpot's wall; z = 0 is its middle.
const POT_HALF_HEIGHT_MM: f64 = 74.5;
/// The cosine of the angle between the flowerpot's wall and its axis.
const POT_COSINE: f64 = 0.967;
/// Neighbours that are further apart are not on the same surface.
const STEP_MM: f64 = 6.0;

/// The default head with a stock part, and the paper's noise from a seed.
fn scenario(kind: &str, seed: u64) -> Scenario {
    let text = format!("[noise]\nnoise_counts = 6.375\nseed = {seed}\n[part]\nkind = \"{kind}\"\n");
    Scenario::from_toml(&text, kind).unwrap()
}

/// The scenario with a quarter of the pixels, and a quarter of the rays of each.
fn small(kind: &str, seed: u64) -> Scenario {
    let mut scenario = scenario(kind, seed);
    (scenario.rig.camera.width, scenario.rig.camera.height) = (256, 256);
    scenario.sub_rays = 2;
    scenario
}

/// A production line: a taught part in front of its head, with its plan and the prediction.
struct Line {
    bed: Bed,
    plan: Plan,
    predicted: GoodPartsFile,
}

fn line(scenario: &Scenario) -> Line {
    let (bed, recipe, predicted) = taught(scenario);
    Line::new(bed, recipe, predicted)
}

/// A head, and the recipe and prediction that were taught from the part in front of it.
fn taught(scenario: &Scenario) -> (Bed, Recipe, GoodPartsFile) {
    taught_with_limit(scenario, TOLERANCE_MM).unwrap()
}

fn taught_with_limit(
    scenario: &Scenario,
    limit_mm: f64,
) -> Result<(Bed, Recipe, GoodPartsFile), String> {
    let mut bed = bed(scenario);
    let naming = Naming {
        limit_mm: Some(limit_mm),
        ..naming(3.0)
    };
    let taught = taught_asking(&mut bed, &naming)?;
    let predicted = taught.manifest.good_parts.unwrap();
    let words = predicted.words();
    assert!(
        words
            .iter()
            .all(|reason| taught.choice.reasons.contains(reason))
    );
    Ok((bed, taught.recipe, predicted))
}

/// Runs a cycle as in production: longer sequences follow if a shorter one is not enough.
pub(crate) fn cycle(bed: &mut Bed, plan: &Plan) -> Inspection {
    let mut sequence = 0;
    loop {
        let mut frames = Vec::new();
        let mut keep = |_, frame| frames.push(frame);
        let indices = plan.indices(sequence);
        bed.head.acquire(indices, TIMEOUT, &mut keep).unwrap();
        let found = plan.inspect(sequence, &frames, Instant::now());
        sequence += 1;
        if found.step_up.is_none() || sequence == plan.sequence_count() {
            return found;
        }
    }
}

impl Line {
    fn new(mut bed: Bed, recipe: Recipe, predicted: GoodPartsFile) -> Self {
        let plan = Plan::new(recipe, &bed.calibration, true).unwrap();
        let rasters = plan.rasters(&bed.calibration).unwrap();
        bed.head.load(rasters).unwrap();
        Self {
            bed,
            plan,
            predicted,
        }
    }

    fn judge(&mut self) -> Inspection {
        cycle(&mut self.bed, &self.plan)
    }

    /// |deviation| of `parts` good parts, mm; all must pass.
    fn good(&mut self, name: &str, parts: usize) -> Vec<f64> {
        let judged = (0..parts).map(|at| {
            let found = self.judge();
            let values = found.gauges.iter().map(|gauge| gauge.value);
            let values: Vec<_> = values.collect();
            let verdict = found.verdict();
            assert_eq!(verdict, Verdict::Pass, "{name}, part {at}: {values:?}");
            values[0].unwrap().abs()
        });
        judged.collect()
    }

    /// Replaces the part by one with a dent.
    fn dent(&self, pot: bool, place: Vector) {
        let defects = vec![Defect::Dent {
            x: place.x,
            y: place.y,
            depth_mm: DEPTH_MM,
            diameter_mm: DIAMETER_MM,
        }];
        let part = match pot {
            true => Part::Flowerpot(Flowerpot {
                defects,
                ..Flowerpot::default()
            }),
            false => Part::SheetMetal(SheetMetal {
                defects,
                ..Default::default()
            }),
        };
        self.bed.stage.place(&part, &Placement::default()).unwrap();
    }

    /// The point that a pixel sees, if any.
    fn point(&self, heights: &[f32], at: usize) -> Option<Vector> {
        let width = self.plan.conditions().camera.0 as usize;
        let z = f64::from(*heights.get(at)?);
        let triangulator = self.plan.production().triangulator();
        let height = z.is_finite().then(|| Height::from_mm(z))?;
        triangulator.point(at % width, at / width, height)
    }

    /// Places with a uniform distribution over the visible surface. They are at least the dent's
    /// radius away from the flowerpot's rim and from the edges and openings of the sheet metal, and
    /// not at a silhouette.
    fn places(&self, pot: bool, count: usize, seed: u64) -> Vec<Vector> {
        let width = self.plan.conditions().camera.0 as usize;
        let heights = self.bed.stage.truth().height;
        let point = |at: usize| self.point(&heights, at);
        let area = |at: usize| match (point(at), point(at + 1), point(at + width)) {
            (Some(here), Some(beside), Some(below)) => {
                let (along, down) = (beside - here, below - here);
                let whole = along.length().max(down.length()) < STEP_MM;
                if whole {
                    along.cross(down).length()
                } else {
                    0.0
                }
            }
            _ => 0.0,
        };
        let areas: Vec<f64> = (0..heights.len()).map(area).collect();
        let total: f64 = areas.iter().sum();
        let rim = POT_HALF_HEIGHT_MM - DIAMETER_MM / 2.0 * POT_COSINE;
        // The two pixels at a silhouette are never compared; on the sheet metal the radius of a
        // dent is 12 pixels.
        let reach = if pot { 2 } else { 12 };
        let keeps_away = |at: usize, middle: Vector| {
            let (row, column) = (at / width, at % width);
            let seen = |row: usize| {
                let mut columns = column.saturating_sub(reach)..(column + reach + 1).min(width);
                columns.all(|u| point(row * width + u).is_some())
            };
            (!pot || middle.z.abs() < rim) && (row.saturating_sub(reach)..=row + reach).all(seen)
        };
        let mut random = Random::new(seed);
        let mut places = Vec::new();
        while places.len() < count {
            let mut left = random.share() * total;
            let beyond = |area: &f64| {
                left -= area;
                left < 0.0
            };
            let Some(at) = areas.iter().position(beyond) else {
                continue;
            };
            places.extend(point(at).filter(|&middle| keeps_away(at, middle)));
        }
        places
    }
}

/// Teaches goldens and measures good parts of each: all pass, and the largest deviations are as
/// predicted, within relative bounds.
fn keep_their_limits(
    kinds: &[&str],
    goldens: u64,
    parts: usize,
    scenario: fn(&str, u64) -> Scenario,
    [mean_within, scatter_within]: [f64; 2],
) {
    for kind in kinds {
        let (mut values, mut predicted) = (Vec::new(), Vec::new());
        for seed in 1..=goldens {
            let mut line = line(&scenario(kind, seed));
            assert_eq!(line.predicted.limit_mm, TOLERANCE_MM, "{kind}");
            assert!(line.predicted.beyond < 1e-5, "{kind}: {:?}", line.predicted);
            let GoodPartsFile {
                left_out, weighed, ..
            } = line.predicted;
            assert!(left_out + weighed < 0.10, "{kind}: {:?}", line.predicted);
            predicted.push(line.predicted);
            values.extend(line.good(kind, parts));
        }
        let count = values.len() as f64;
        let mean = values.iter().sum::<f64>() / count;
        let scatter = values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (count - 1.0);
        let scatter = scatter.sqrt();
        let of = |value: fn(&GoodPartsFile) -> f64| {
            predicted.iter().map(value).sum::<f64>() / predicted.len() as f64
        };
        let (expected, spread) = (of(|p| p.largest_mm), of(|p| p.scatter_mm));
        println!(
            "{kind:12} {count} good parts: {mean:.4} ± {scatter:.4} mm, predicted {expected:.4} ± {spread:.4}, largest {:.4}; \
             {:.1e} beyond, {:.2} % by area weighed, by {:.2} and more, {:.3} % left out",
            values.iter().copied().fold(0.0, f64::max),
            of(|p| p.beyond),
            of(|p| p.weighed) * 100.0,
            of(|p| p.least_weight),
            of(|p| p.left_out) * 100.0
        );
        assert!((mean / expected - 1.0).abs() < mean_within, "{kind}");
        assert!((scatter / spread - 1.0).abs() < scatter_within, "{kind}");
    }
}

/// Places dents at random on both parts: all are found.
fn are_found(dents: usize, scenario: fn(&str, u64) -> Scenario) {
    for kind in ["sheet_metal", "flowerpot"] {
        let mut line = line(&scenario(kind, 3));
        let pot = kind == "flowerpot";
        let mut smallest = f64::INFINITY;
        for place in line.places(pot, dents, 11) {
            line.dent(pot, place);
            let found = line.judge();
            let deviation = found.gauges[0].value.unwrap_or(f64::NAN);
            smallest = smallest.min(deviation.abs());
            let verdict = found.verdict();
            println!("{:?} {:?}", line.predicted, found.gauges[0]);
            assert_eq!(verdict, Verdict::Fail, "{kind} at {place:?}: {deviation}");
        }
        println!("{kind}: {dents} dents found, smallest deviation {smallest:.3} mm");
    }
}

#[test]
fn good_parts_of_two_stock_kinds_keep_the_limits_that_teaching_sets() {
    // The noise of one golden shifts the mean of all its parts, and changes their scatter.
    keep_their_limits(&["sheet_metal", "flowerpot"], 1, 25, small, [0.35, 0.8]);
}

#[test]
#[ignore = "takes minutes: `.ci/run full`"]
fn two_hundred_good_parts_of_every_stock_kind_keep_the_limits_that_teaching_sets() {
    // Measured: the mean is up to 18 % below its prediction (spline), the scatter up to 28 %
    // (cone), so the limits are safe.
    keep_their_limits(&STOCK, 10, 20, scenario, [0.20, 0.35]);
}

#[test]
fn a_dent_is_found_wherever_it_is_under_the_limits_that_teaching_sets() {
    are_found(3, |kind, seed| Scenario {
        sub_rays: 2,
        ..scenario(kind, seed)
    });
}

#[test]
#[ignore = "takes minutes: `.ci/run full`"]
fn fifty_dents_are_found_wherever_they_are_under_the_limits_that_teaching_sets() {
    are_found(50, scenario);
}

#[test]
#[ignore = "takes minutes: `.ci/run full`"]
fn dents_where_pixels_have_weights_are_found_and_would_be_missed_without_these_pixels() {
    const PLACES: usize = 60;
    let mut scenario = scenario("flowerpot", 3);
    scenario.sub_rays = 2;
    let (bed, recipe, predicted) = taught(&scenario);
    // 1 is full weight, a larger number is a part of it (docs/formats.md).
    let valid = recipe.arrays.valid.iter().enumerate();
    let weighed: Vec<usize> = valid.filter(|(_, v)| **v > 1).map(|(at, _)| at).collect();
    let mut rest = recipe.clone();
    let valid = std::sync::Arc::make_mut(&mut rest.arrays.valid).iter_mut();
    valid.for_each(|valid| *valid = u8::from(*valid == 1));
    let mut without = Plan::new(rest, &bed.calibration, true).unwrap();
    let mut line = Line::new(bed, recipe, predicted);
    let heights = line.bed.stage.truth().height;
    let mut random = Random::new(17);
    let (mut places, mut found) = (0, [0; 2]);
    while places < PLACES {
        let at = weighed[(random.share() * weighed.len() as f64) as usize];
        let Some(place) = line.point(&heights, at) else {
            continue;
        };
        places += 1;
        line.dent(true, place);
        for found in &mut found {
            *found += usize::from(line.judge().verdict() == Verdict::Fail);
            std::mem::swap(&mut line.plan, &mut without);
        }
    }
    println!("of {PLACES} dents found with weights, without: {found:?}");
    // Measured: 54 and 3. The bounds leave room for the noise.
    assert!(found[0] >= PLACES * 4 / 5 && found[1] <= PLACES / 5);
}

#[test]
fn a_head_that_is_too_noisy_for_the_limit_is_refused_with_one_that_good_parts_keep() {
    let mut scenario = small("plane", 1);
    (scenario.rig.camera.width, scenario.rig.camera.height) = (128, 128);
    scenario.noise.noise_counts = Some(4.3 * Noise::PAPER);
    let refused = taught_with_limit(&scenario, TOLERANCE_MM).err().unwrap();
    assert!(
        refused.contains("noise alone would exceed the limit of the deviation, ±0.15 mm"),
        "{refused}"
    );
    let (_, proposed) = refused.split_once("choose the limit: ±").unwrap();
    let limit_mm: f64 = proposed.split_once(' ').unwrap().0.parse().unwrap();
    assert!(limit_mm > TOLERANCE_MM);
    let (bed, recipe, predicted) = taught_with_limit(&scenario, limit_mm).unwrap();
    assert!(predicted.limit_mm == limit_mm && predicted.largest_mm < limit_mm);
    let mut line = Line::new(bed, recipe, predicted);
    line.good("noisy", 25);
}
