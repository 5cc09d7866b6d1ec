//! Parts that are displaced from where they were taught, and scenes that cannot be taught.

use algo::pattern::Shot;
use algo::phase::Trust;
use algo::units::{AbsolutePhase, Height};
use appliance::head::calibrated::CalibratedHead;
use appliance::head::calibration::Calibration;
use appliance::recipe::file::archive::{Arrays, pack};
use appliance::recipe::plan::Plan;
use appliance::recipe::teach::{Naming, TaughtRecipe, UnsealedRecipe, teach};
use appliance::recipe::{AlignmentKind, FeatureFile, GaugeFile, Recipe, RecipeFile, safe};
use appliance::system::headway::Headway;
use hal::head::Head;
use sim::parts::{Cone, Face, Handset, Plane, Sawtooth, SheetMetal, Sphere, Spline};
use sim::scenario::{Noise, RigDevice};
use sim::{Part, Placement, Scenario, Stage};
use std::time::{Duration, Instant};
use tests::once::Once;

pub(crate) const TIMEOUT: Duration = Duration::from_secs(5);
const TOLERANCE_MM: f64 = 1.0;

pub(crate) struct Bed {
    pub head: Head,
    pub stage: Stage,
    pub calibration: Calibration,
}

/// Gives a camera so many square pixels, and keeps how wide it sees.
pub(crate) fn square_pixels(camera: &mut RigDevice, (width, height): (u32, u32)) {
    (camera.width, camera.height) = (width, height);
    let share = f64::from(height) / f64::from(width);
    let across = (camera.fov_deg[0] / 2.0).to_radians().tan();
    camera.fov_deg[1] = 2.0 * (share * across).atan().to_degrees();
}

pub(crate) fn bed(scenario: &Scenario) -> Bed {
    let (head, stage) = sim::head(scenario).unwrap();
    Bed {
        head,
        calibration: Calibration::of_scenario(stage.scenario()).unwrap(),
        stage,
    }
}

pub(crate) fn scenario(part: Part) -> Scenario {
    let mut scenario = Scenario {
        part,
        ..Scenario::default()
    };
    // Half the study's resolution and a quarter of its rays, with the same geometry and noise.
    scenario.noise.noise_counts = Some(Noise::PAPER);
    scenario.rig.camera.width = 256;
    scenario.rig.camera.height = 256;
    scenario.sub_rays = 2;
    scenario
}

pub(crate) fn taught(bed: &mut Bed) -> Result<TaughtRecipe, String> {
    taught_within(bed, TOLERANCE_MM)
}

/// Teaches the part with this placement tolerance.
pub(crate) fn taught_within(
    bed: &mut Bed,
    placement_tolerance_mm: f64,
) -> Result<TaughtRecipe, String> {
    taught_asking(bed, &naming(placement_tolerance_mm))
}

/// As [`taught_within`], with frames that are exposed so many times as long as the head is set to.
pub(crate) fn taught_exposed(
    bed: &mut Bed,
    placement_tolerance_mm: f64,
    exposures: u32,
) -> Result<TaughtRecipe, String> {
    let naming = Naming {
        exposures: Some(exposures),
        ..naming(placement_tolerance_mm)
    };
    taught_asking(bed, &naming)
}

/// Teaches the part as is asked for. Each scene is taught once for all tests.
pub(crate) fn taught_asking(bed: &mut Bed, naming: &Naming) -> Result<TaughtRecipe, String> {
    static TAUGHT: Once<String, Result<TaughtRecipe, String>> = Once::new();
    let (scenario, placed) = (bed.stage.scenario().clone(), bed.stage.placed());
    let scene = format!("{scenario:?} {placed:?} {naming:?}");
    let taught = TAUGHT.get(scene, || teach_now(bed, naming));
    // The noise of what is measured is the same whoever has taught, and not that of golden.
    bed.stage.reseed(!scenario.noise.seed);
    let taught = taught.as_ref().as_ref().map_err(String::clone)?;
    Ok(TaughtRecipe {
        bytes: taught.bytes.clone(),
        manifest: taught.manifest.clone(),
        recipe: taught.recipe.clone(),
        choice: taught.choice.clone(),
    })
}

/// Teaches the part as one click on the page does.
pub(crate) fn one_click(bed: &mut Bed) -> Result<TaughtRecipe, String> {
    let (head, calibration) = (&mut bed.head, &bed.calibration);
    let naming = naming(TOLERANCE_MM);
    let taught = teach(head, calibration, &naming, TIMEOUT, Headway::silent());
    let taught = taught.map_err(|error| error.to_string())?;
    Ok(taught.with_rims(Headway::silent())?.seal()?)
}

/// The names of a part, with this placement tolerance and else what the program takes.
pub(crate) fn naming(placement_tolerance_mm: f64) -> Naming {
    Naming {
        number: 1,
        part_number: "P".into(),
        name: "part".into(),
        taught_by: String::new(),
        taught_at_unix_s: 0,
        placement_tolerance_mm,
        exposures: None,
        everything: false,
        marking: Default::default(),
        empty: None,
        limit_mm: Some(0.15),
    }
}

fn teach_now(bed: &mut Bed, naming: &Naming) -> Result<TaughtRecipe, String> {
    let (head, calibration) = (&mut bed.head, &bed.calibration);
    let taught = teach(head, calibration, naming, TIMEOUT, Headway::silent());
    Ok(taught.map_err(|error| error.to_string())?.seal()?)
}

/// The same recipe, whose cycles begin with two frames.
pub(crate) fn with_two_frames(taught: TaughtRecipe) -> TaughtRecipe {
    let unsealed = UnsealedRecipe {
        manifest: taught.manifest,
        arrays: taught.recipe.arrays,
        choice: taught.choice,
    };
    unsealed.with_two_frames().seal().unwrap()
}

/// Pixels whose phase is more than half a turn off the true one, and all that were compared, for a
/// sequence about the golden map inside its safe mask.
fn wrong_orders(
    bed: &mut Bed,
    taught: &TaughtRecipe,
    shots: &[Shot],
    reach: f32,
) -> (usize, usize) {
    let arrays = &taught.recipe.arrays;
    let golden = arrays.golden_phase.iter();
    let golden: Vec<_> = golden
        .map(|&turns| AbsolutePhase::from_turns(turns))
        .collect();
    let map = safe(&golden, &arrays.phase_reach, reach);
    let mut head = CalibratedHead::new(&mut bed.head, &bed.calibration, TIMEOUT);
    let function = &taught.recipe.function;
    let measured = head.measure(function, shots, Some(&map), &|_| ()).unwrap();
    let truth = bed.stage.truth();
    let width = measured.phases.width;
    let (mut wrong, mut compared) = (0, 0);
    for at in 0..truth.height.len() {
        if measured.phases.trust[at] != Trust::Resolved || truth.class[at] != 2 {
            continue;
        }
        let height = f64::from(truth.height[at]);
        let triangulator = &measured.triangulator;
        let point = triangulator.point(at % width, at / width, Height::from_mm(height));
        let light = point.and_then(|point| triangulator.projector_point(point));
        let true_phase = light.map_or(AbsolutePhase::UNKNOWN, |(xi, eta)| {
            AbsolutePhase::from_turns(function.at(xi, eta))
        });
        compared += 1;
        if (measured.phases.phase[at] - true_phase).turns().abs() > 0.5 {
            wrong += 1;
        }
    }
    (wrong, compared)
}

#[test]
fn moved_parts_have_no_wrong_fringe_order_inside_the_safe_masks() {
    have_no_wrong_order(&["cone", "sheet metal"]);
}

#[test]
#[ignore = "takes a minute: `.ci/run full`"]
fn moved_parts_of_every_kind_have_no_wrong_fringe_order_inside_the_safe_masks() {
    have_no_wrong_order(&[]);
}

/// Moves parts of these kinds, or of all kinds if none is named.
fn have_no_wrong_order(kinds: &[&str]) {
    let parts = [
        ("cone", Part::Cone(Cone::default())),
        ("sawtooth", Part::Sawtooth(Sawtooth::default())),
        ("sphere", Part::Sphere(Sphere::default())),
        ("spline", Part::Spline(Box::<Spline>::default())),
        ("face", Part::Face(Face::default())),
        ("handset", Part::Handset(Handset::default())),
        ("sheet metal", Part::SheetMetal(SheetMetal::default())),
    ];
    // Two at the limit of the tolerance and one inside, all of length ≤ 1 mm.
    let moves = [[0.57, -0.57, 0.57], [-0.99, 0.1, 0.0], [0.3, 0.4, -0.5]];
    let chosen = |name: &str| kinds.is_empty() || kinds.contains(&name);
    for (name, part) in parts.into_iter().filter(|(name, _)| chosen(name)) {
        let mut bed = bed(&scenario(part.clone()));
        let taught = taught(&mut bed).unwrap();
        for sequence in &taught.manifest.sequences {
            let Some(reach) = sequence.kind.reach() else {
                continue;
            };
            let mut all = 0;
            for (seed, shift_mm) in (7..).zip(moves) {
                let placement = Placement {
                    shift_mm,
                    ..Placement::default()
                };
                bed.stage.place(&part, &placement).unwrap();
                bed.stage.reseed(seed);
                let (wrong, compared) = wrong_orders(&mut bed, &taught, &sequence.frames, reach);
                assert_eq!(
                    wrong,
                    0,
                    "{name}, {} frames, moved {shift_mm:?}",
                    sequence.frames.len()
                );
                all += compared;
            }
            println!(
                "{name}: {} frames safe on {:.1} % of the part, {all} pixels compared",
                sequence.frames.len(),
                sequence.safe_share * 100.0
            );
            // With an empty mask the test would always pass.
            assert!(sequence.safe_share > 0.5, "{name}: {}", sequence.safe_share);
        }
    }
}

#[test]
fn a_scene_that_cannot_be_taught_says_which() {
    let empty = scenario(Part::Empty {});
    let mut saturated = scenario(Part::Plane(Plane::default()));
    saturated.optics.gain = 3.0;
    let mut away = scenario(Part::Plane(Plane::default()));
    away.placement.shift_mm = [0.0, 0.0, 150.0];
    let mut off = scenario(Part::Plane(Plane::default()));
    off.light.diffuse = 0.0;
    for (scene, word) in [(empty, "dark"), (away, "working range"), (off, "dark")] {
        let error = taught(&mut bed(&scene)).err().unwrap();
        assert!(error.contains(word), "{word}: {error}");
    }
    // What is at full scale is taught with less light.
    let dimmed = taught(&mut bed(&saturated)).unwrap();
    let least = dimmed.recipe.arrays.amplitude.iter().min();
    assert!(
        least.is_some_and(|least| (62..128).contains(least)),
        "{least:?}"
    );
}

/// Heights of one cycle, and the value of the first gauge.
fn cycle(bed: &mut Bed, file: &RecipeFile, arrays: &Arrays) -> (Vec<f32>, f64) {
    let (bytes, _) = pack(file, arrays).unwrap();
    let recipe = Recipe::from_bytes(&bytes).unwrap();
    let plan = Plan::new(recipe, &bed.calibration, true).unwrap();
    let rasters = plan.rasters(&bed.calibration).unwrap();
    let indices = plan.indices(0).to_vec();
    bed.head.load(rasters).unwrap();
    bed.stage.reseed(5);
    let mut frames = Vec::new();
    let mut keep = |_, frame| frames.push(frame);
    bed.head.acquire(&indices, TIMEOUT, &mut keep).unwrap();
    let inspection = plan.inspect(0, &frames, Instant::now());
    let heights = plan.layers(0, &frames).unwrap().height_mm;
    (heights, inspection.gauges[0].value.unwrap())
}

#[test]
fn pixels_that_no_gauge_looks_at_are_not_computed_and_the_others_are_the_same() {
    let mut bed = bed(&scenario(Part::Sphere(Sphere::default())));
    let taught = taught(&mut bed).unwrap();
    let (file, arrays) = (taught.manifest, taught.recipe.arrays);
    let middle = vec![
        [100.0, 110.0],
        [150.0, 110.0],
        [150.0, 140.0],
        [100.0, 140.0],
    ];
    let gauge = GaugeFile {
        of: vec!["middle".into()],
        ..file.gauges[0].clone()
    };
    let small = RecipeFile {
        features: vec![FeatureFile::surface("middle", middle)],
        gauges: vec![gauge.clone()],
        // Alignment uses the whole part.
        alignment: AlignmentKind::None,
        ..file.clone()
    };
    let mut whole = small.clone();
    whole.features.extend(file.features.clone());
    whole.gauges.push(GaugeFile {
        slot: 2,
        name: "whole".into(),
        ..file.gauges[0].clone()
    });
    let (seen, value) = cycle(&mut bed, &small, &arrays);
    let (all, expected) = cycle(&mut bed, &whole, &arrays);
    assert_eq!(value.to_bits(), expected.to_bits());
    let (mut inside, mut outside) = (0, 0);
    for (at, (seen, all)) in seen.iter().zip(&all).enumerate() {
        let (u, v) = (at % 256, at / 256);
        // Smoothing over nine pixels affects four pixels on each side.
        if (96..154).contains(&u) && (106..144).contains(&v) {
            assert_eq!(seen.to_bits(), all.to_bits(), "at {u}, {v}");
            inside += 1;
        } else {
            assert!(seen.is_nan(), "at {u}, {v}");
            outside += usize::from(!all.is_nan());
        }
    }
    assert!(inside > 2000 && outside > 20_000, "{inside} {outside}");
}
