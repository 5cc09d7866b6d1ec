//! Golden is the mean of captures by every sequence: what an uncorrected response leaves in
//! deviations from it, and in their uncertainty.

use super::gauges::{frames, plan};
use super::placement::{Bed, bed, scenario, taught};
use appliance::recipe::file::archive::Arrays;
use appliance::recipe::plan::Plan;
use appliance::recipe::teach::TaughtRecipe;
use sim::parts::Plane;
use sim::{Part, Placement};
use std::time::Instant;
use tests::random::Random;

/// Exponent of the light, of which the calibration knows nothing: the doctor lets it pass.
const GAMMA: f64 = 1.08;
/// Largest periodic error of a part that lies as taught, RMS, and the least that golden by other
/// shifts would leave.
const AS_TAUGHT_MM: f64 = 0.001;
const BY_OTHER_SHIFTS_MM: f64 = 0.005;
/// Bins of a fringe. An error of 3 shifts has three periods in it.
const BINS: usize = 48;
const CAPTURES: usize = 4;
/// Placements of the part, and how many of them at least are covered by U, which holds for 95 %.
const PLACES: usize = 12;
const COVERED: usize = 11;

/// A taught plane in front of a head with a response.
fn line(gamma: f64) -> (Bed, TaughtRecipe) {
    let mut scenario = scenario(Part::Plane(Plane::default()));
    scenario.optics.gamma = gamma;
    scenario.noise.noise_counts = None;
    let mut bed = bed(&scenario);
    let taught = taught(&mut bed).unwrap();
    let first = &taught.manifest.sequences[taught.manifest.production];
    assert_eq!(first.frames.len(), 3);
    (bed, taught)
}

fn load(bed: &mut Bed, plan: &Plan) {
    let rasters = plan.rasters(&bed.calibration).unwrap();
    bed.head.load(rasters).unwrap();
}

/// The error that depends on the place in a fringe, RMS, mm, of the part by a sequence.
fn periodic(bed: &mut Bed, taught: &TaughtRecipe, arrays: &Arrays, sequence: usize) -> f64 {
    let plan = plan(bed, &taught.manifest, arrays);
    load(bed, &plan);
    let mut bins = [(0.0, 0.0); BINS];
    for _ in 0..CAPTURES {
        let frames = frames(bed, &plan, sequence);
        let heights = plan.layers(sequence, &frames).unwrap().height_mm;
        let golden = &plan.production().cubics().surface().height;
        for (at, &height) in heights.iter().enumerate() {
            if arrays.valid[at] != 0 && height.is_finite() {
                let deviation = f64::from(height) - golden[at].mm();
                let share = arrays.golden_phase[at].rem_euclid(1.0);
                let (sum, count) = &mut bins[(share * BINS as f64) as usize % BINS];
                (*sum, *count) = (*sum + deviation, *count + 1.0);
            }
        }
    }
    let means = bins.map(|(sum, count)| sum / count);
    let mean = means.iter().sum::<f64>() / BINS as f64;
    let squares = means.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>();
    (squares / BINS as f64).sqrt()
}

#[test]
fn a_part_that_lies_as_taught_has_no_error_of_an_uncorrected_response() {
    let (mut bed, taught) = line(GAMMA);
    let arrays = &taught.recipe.arrays;
    // Also the sequence that follows in the same cycle where the first one is in doubt.
    for sequence in [0, 2] {
        let error = periodic(&mut bed, &taught, arrays, sequence);
        println!("sequence {sequence}: {:.2} µm", error * 1e3);
        assert!(error < AS_TAUGHT_MM, "sequence {sequence}: {error}");
    }
    let full_alone = Arrays {
        sequence_offset: [].into(),
        ..arrays.clone()
    };
    let error = periodic(&mut bed, &taught, &full_alone, 0);
    println!(
        "about golden by the full sequence alone: {:.2} µm",
        error * 1e3
    );
    assert!(error > BY_OTHER_SHIFTS_MM, "{error}");
}
#[test]
fn the_error_of_a_moved_part_is_in_its_uncertainty() {
    let (mut bed, taught) = line(GAMMA);
    let arrays = &taught.recipe.arrays;
    let plan = plan(&bed, &taught.manifest, arrays);
    load(&mut bed, &plan);
    let mut random = Random::new(5);
    let (mut covered, mut without) = (0, 0);
    for _ in 0..PLACES {
        let mut between = |reach: f64| reach * (2.0 * random.share() - 1.0);
        let placement = Placement {
            shift_mm: [(); 3].map(|()| between(0.5)),
            tilt_deg: [(); 2].map(|()| between(0.2)),
            rotation_deg: 0.0,
        };
        let part = Part::Plane(Plane::default());
        bed.stage.place(&part, &placement).unwrap();
        let frames = frames(&mut bed, &plan, 0);
        let found = plan.inspect(0, &frames, Instant::now());
        let deviation = &found.gauges[0];
        let [value, expected, sigma, uncertainty] = [
            deviation.value,
            deviation.expected,
            deviation.sigma,
            deviation.uncertainty,
        ]
        .map(Option::unwrap);
        println!("{value:+.4} mm, expected {expected:.4}, sigma {sigma:.4}, U {uncertainty:.4}");
        covered += usize::from(value.abs() - expected <= uncertainty);
        without += usize::from(value.abs() - expected <= 2.0 * sigma);
    }
    println!("{covered} of {PLACES} are covered by U, {without} by the noise alone");
    assert!(
        covered >= COVERED && without < COVERED,
        "{covered} {without}"
    );
}
