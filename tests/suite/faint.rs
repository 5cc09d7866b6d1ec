//! A dark part in front of a quiet camera: how much modulation is trusted follows from the camera's
//! noise and is a property of the recipe.

use super::gauges::{frames, plan};
use super::placement::{Bed, TIMEOUT, bed, scenario, taught_exposed};
use algo::phase::Trust;
use algo::units::AbsolutePhase;
use appliance::head::calibrated::{CalibratedHead, MeasuredPart};
use appliance::head::scan::Scan;
use appliance::recipe::RecipeFile;
use appliance::recipe::teach::TaughtRecipe;
use appliance::station::{Inspection, Verdict};
use hal::frame::Frame;
use sim::Part;
use sim::parts::SheetMetal;
use std::time::Instant;

/// Half-width of uniform noise, counts: with rounding, σ is 1.2 counts.
const HALF_WIDTH: f64 = 2.0;
/// Light of the dark part, relative to a bright one: its modulation is 6 to 10 counts.
const DARK: f64 = 0.12;
/// Errors above this are wrong fringe orders, mm: a fringe is some mm of height.
const GROSS_MM: f64 = 1.0;
/// Errors over their predicted σ. The noise of a sample is uniform and rounded, not normal.
const SIGMA: std::ops::Range<f64> = 0.9..1.1;

/// The part of a press shop, as dark as rubber, and its recipe.
fn dark() -> (Bed, TaughtRecipe) {
    let mut scenario = scenario(Part::SheetMetal(SheetMetal::default()));
    scenario.noise.noise_counts = Some(HALF_WIDTH);
    scenario.optics.gain *= DARK;
    let mut bed = bed(&scenario);
    let taught = taught_exposed(&mut bed, 1.0, 1).unwrap();
    (bed, taught)
}

fn full(taught: &TaughtRecipe) -> &[algo::pattern::Shot] {
    &taught.manifest.sequences.last().unwrap().frames
}

/// Measures the part with the recipe's full sequence about its golden map.
fn measured(bed: &mut Bed, taught: &TaughtRecipe) -> (MeasuredPart, Vec<AbsolutePhase>) {
    let golden = taught.recipe.arrays.golden_phase.iter();
    let golden: Vec<_> = golden
        .map(|&turns| AbsolutePhase::from_turns(turns))
        .collect();
    let mut head = CalibratedHead::new(&mut bed.head, &bed.calibration, TIMEOUT);
    let function = &taught.recipe.function;
    let measured = head.measure(function, full(taught), Some(&golden), &|_| ());
    (measured.unwrap(), golden)
}

#[test]
fn a_dark_part_is_measured_by_a_quiet_camera_within_its_stated_noise() {
    let (mut bed, taught) = dark();
    let least = taught.manifest.least_modulation;
    assert!((4.9..5.6).contains(&least), "{least}");
    let (measured, golden) = measured(&mut bed, &taught);
    let truth = bed.stage.truth();
    let (mut lit, mut squares, mut gross) = (0, Vec::new(), 0);
    let mut modulations = Vec::new();
    for at in (0..truth.height.len()).filter(|&at| truth.class[at] == 2) {
        lit += 1;
        if measured.phases.trust[at] != Trust::Resolved {
            continue;
        }
        modulations.push(measured.phases.modulation[at].counts(255));
        let error = measured.heights.height[at].mm() - f64::from(truth.height[at]);
        if error.abs() > GROSS_MM {
            gross += 1;
        }
        squares.push((error / f64::from(measured.heights.sigma[at])).powi(2));
    }
    // Creases between surfaces have errors of the lens, which are no noise: the median has none of
    // them. That of the square of a normal number is 0.455.
    squares.sort_by(f64::total_cmp);
    modulations.sort_by(f64::total_cmp);
    let ratio = (squares[squares.len() / 2] / 0.455).sqrt();
    let [tenth, middle, most] = [1, 5, 9].map(|tenth| modulations[tenth * modulations.len() / 10]);
    println!(
        "least {least:.2}, modulation {tenth:.1}, {middle:.1}, {most:.1}; {} of {lit} resolved, {gross} gross, error {ratio:.3} of σ",
        squares.len()
    );
    assert!((6.0..10.0).contains(&middle), "{middle}");
    // Silhouettes and the steep flange are missing.
    assert!(squares.len() * 100 > 90 * lit, "{} of {lit}", squares.len());
    assert!(SIGMA.contains(&ratio), "{ratio}");
    assert_eq!(gross, 0);
    // What an unknown noise allows is nothing of it.
    let scan = Scan::new(
        taught.recipe.function.range(),
        full(&taught),
        &measured.frames,
    )
    .unwrap();
    let refused = scan.phases(Some(&golden)).unwrap();
    let resolved = refused.count(Trust::Resolved);
    assert!(resolved * 100 < lit, "{resolved} of {lit}");
}

/// What is judged, without how long it took.
fn judged(bed: &Bed, taught: &TaughtRecipe, file: &RecipeFile, frames: &[Frame]) -> Inspection {
    let plan = plan(bed, file, &taught.recipe.arrays);
    let mut found = plan.inspect(0, frames, Instant::now());
    (found.stages, found.cpu_us) = Default::default();
    found
}

#[test]
fn a_recipe_that_states_sixteen_counts_goes_by_them_and_a_taught_one_by_its_noise() {
    let (mut bed, taught) = dark();
    let loaded = plan(&bed, &taught.manifest, &taught.recipe.arrays);
    let rasters = loaded.rasters(&bed.calibration).unwrap();
    bed.head.load(rasters).unwrap();
    let frames = frames(&mut bed, &loaded, 0);
    let new = judged(&bed, &taught, &taught.manifest, &frames);
    assert_eq!(new.verdict(), Verdict::Pass, "{new:?}");
    let sixteen = RecipeFile {
        least_modulation: 16.0,
        ..taught.manifest.clone()
    };
    let sixteen = judged(&bed, &taught, &sixteen, &frames);
    assert_eq!(sixteen.verdict(), Verdict::Invalid, "{sixteen:?}");
    assert!(sixteen.valid_points * 100 < new.valid_points);
}

#[test]
fn a_least_modulation_out_of_its_bounds_is_refused() {
    let (_, taught) = dark();
    for counts in [3.9, 128.0] {
        let file = RecipeFile {
            least_modulation: counts,
            ..taught.manifest.clone()
        };
        let error = file.check_bounds().unwrap_err();
        assert!(error.words.contains("least_modulation"), "{error}");
    }
}
