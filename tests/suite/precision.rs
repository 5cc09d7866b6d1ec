//! Repeatability of a coverage compared with its own prediction, and detection of defects among
//! good parts at random placements.

use super::gauges::{frames, gauge, plan};
use super::placement::{Bed, bed, taught_within};
use algo::inspect::kinds::{Coverage, Deviation};
use appliance::recipe::plan::Plan;
use appliance::recipe::teach::TaughtRecipe;
use appliance::recipe::{RecipeFile, SequenceKind};
use appliance::station::{Inspection, Verdict};
use sim::parts::{Defect, SheetMetal};
use sim::scenario::Noise;
use sim::{Part, Placement, Scenario};
use std::time::Instant;
use tests::random::Random;

/// Largest relative difference between repeatability and prediction of a coverage; with 200 values
/// the repeatability is known to 5 %.
const COVERAGE: f64 = 0.30;
const REPEATS: usize = 200;
/// Largest displacement of parts in each direction, and largest tilt about x and y.
const SHIFT_MM: f64 = 1.0;
const TILT_DEG: f64 = 0.5;
/// Then the shift moves the farthest corner by √3 mm, and the tilts move it by 0.9 mm, as it is 70
/// mm from the middle.
const TOLERANCE_MM: f64 = 3.0;
/// Deviations are averaged over 7 pixels of 0.66 mm, 4.6 mm: a dent of 0.3 mm and 8 mm is 0.16 mm
/// deep on that mean.
const SIDE: usize = 7;
const LIMIT_MM: f64 = 0.1;
const DEPTH_MM: f64 = 0.3;
const DIAMETER_MM: f64 = 8.0;

/// 320 × 240 pixels with the study's field of view: ten placements take a second.
fn small() -> (Bed, TaughtRecipe) {
    let mut scenario = Scenario::default();
    let camera = &mut scenario.rig.camera;
    (camera.width, camera.height, camera.fov_deg) = (320, 240, [20.0, 15.0]);
    scenario.sub_rays = 2;
    scenario.noise.noise_counts = Some(Noise::PAPER);
    let mut bed = bed(&scenario);
    let taught = taught_within(&mut bed, TOLERANCE_MM).unwrap();
    (bed, taught)
}

fn part(defects: Vec<Defect>) -> Part {
    Part::SheetMetal(SheetMetal {
        defects,
        ..Default::default()
    })
}

fn inspect(bed: &mut Bed, plan: &Plan) -> Inspection {
    let frames = frames(bed, plan, 0);
    plan.inspect(0, &frames, Instant::now())
}

/// The scatter of a gauge's values, as a multiple of their predicted σ.
fn repeats(name: &str, found: &[Inspection], gauge: usize) -> f64 {
    let count = found.len() as f64;
    let values = || found.iter().map(|f| f.gauges[gauge].value.unwrap());
    let mean = values().sum::<f64>() / count;
    let squares: f64 = values().map(|x| (x - mean) * (x - mean)).sum();
    let scatter = (squares / (count - 1.0)).sqrt();
    let predicted = found.iter().map(|f| f.gauges[gauge].sigma.unwrap());
    let predicted = predicted.sum::<f64>() / count;
    let ratio = scatter / predicted;
    println!("{name:10} {mean:+9.4} ± {scatter:.6}, predicted {predicted:.6}: {ratio:.3}");
    ratio
}

/// Light relative to that while teaching: in many places the modulation is then about 16 counts,
/// the smallest that is trusted.
const FAINT: [f64; 2] = [0.25, 0.3];

/// The repeatability of a coverage as a multiple of its prediction, for several lights and
/// sequences.
fn coverage_in_faint_light() -> Vec<f64> {
    let mut ratios = Vec::new();
    let (bed, taught) = small();
    let mut file = taught.manifest.clone();
    file.gauges = vec![gauge("coverage", "frame", Coverage {})];
    for share in FAINT {
        let mut scenario = bed.stage.scenario().clone();
        scenario.optics.gain *= share;
        let mut faint = super::placement::bed(&scenario);
        for kind in [SequenceKind::TwoLevels, SequenceKind::Full] {
            let known = file.sequences.iter();
            file.production = known.clone().position(|of| of.kind == kind).unwrap();
            let plan = plan(&faint, &file, &taught.recipe.arrays);
            let rasters = plan.rasters(&faint.calibration).unwrap();
            faint.head.load(rasters).unwrap();
            let found: Vec<_> = (0..REPEATS).map(|_| inspect(&mut faint, &plan)).collect();
            ratios.push(repeats("coverage", &found, 0));
        }
    }
    ratios
}

#[test]
fn a_coverage_in_faint_light_repeats_as_well_as_it_says() {
    let ratios = coverage_in_faint_light();
    let near = |ratio: &f64| (ratio - 1.0).abs() < COVERAGE;
    assert!(ratios.iter().all(near), "{ratios:?}");
}

#[test]
fn a_value_in_the_guard_band_is_invalid_and_says_why_and_passes_without_a_guard_band() {
    let (mut bed, taught) = small();
    let mut file = taught.manifest;
    assert!((file.guard_k - 2.0).abs() < 1e-9);
    // Of the deviation alone.
    file.gauges.truncate(1);
    let dent = Defect::Dent {
        x: -20.0,
        y: 4.0,
        depth_mm: DEPTH_MM,
        diameter_mm: DIAMETER_MM,
    };
    let part = part(vec![dent]);
    bed.stage.place(&part, &Placement::default()).unwrap();
    let mut judged = |file: &RecipeFile| {
        let plan = plan(&bed, file, &taught.recipe.arrays);
        let rasters = plan.rasters(&bed.calibration).unwrap();
        bed.head.load(rasters).unwrap();
        inspect(&mut bed, &plan)
    };
    let gauge = &judged(&file).gauges[0];
    let (value, u) = (gauge.value.unwrap().abs(), gauge.uncertainty.unwrap() / 2.0);
    // The next values differ by some σ: the limit is 5 u away, and the band is twice as wide.
    let limit = value + 5.0 * u;
    (file.gauges[0].low, file.gauges[0].high) = (Some(-limit), Some(limit));
    file.guard_k = 10.0;
    let close = judged(&file);
    assert_eq!(close.verdict(), Verdict::Invalid);
    assert_eq!(close.gauges[0].decision.bits(), 0b10010);
    let reason = close.reason.unwrap();
    assert!(
        reason.contains("too near a limit to prove PASS or FAIL: deviation is"),
        "{reason}"
    );
    assert_eq!(
        close.step_up.is_some(),
        file.production + 1 < file.sequences.len()
    );
    file.guard_k = 0.0;
    let without = judged(&file);
    assert_eq!((without.verdict(), without.reason), (Verdict::Pass, None));
}

/// Measures good parts, and parts with a dent; prints how many are rejected or missed and where the
/// worst lay, and checks that there are none.
fn rejects(good: usize, dented: usize) {
    let (mut bed, taught) = small();
    let mut file = taught.manifest.clone();
    let deviation = &mut file.gauges[0];
    deviation.measures = Deviation { smoothing_px: SIDE }.into();
    (deviation.low, deviation.high) = (Some(-LIMIT_MM), Some(LIMIT_MM));
    let plan = plan(&bed, &file, &taught.recipe.arrays);
    bed.head
        .load(plan.rasters(&bed.calibration).unwrap())
        .unwrap();
    let mut random = Random::new(1);
    let (mut rejected, mut missed) = (Vec::new(), Vec::new());
    let (mut largest, mut smallest) = (0.0_f64, f64::INFINITY);
    for at in 0..good + dented {
        let mut between = |reach: f64| reach * (2.0 * random.share() - 1.0);
        let placement = Placement {
            shift_mm: [(); 3].map(|()| between(SHIFT_MM)),
            tilt_deg: [(); 2].map(|()| between(TILT_DEG)),
            rotation_deg: 0.0,
        };
        // On the plate between bead, slot and the large hole.
        let dent = Defect::Dent {
            x: -20.0 + between(22.0),
            y: 4.0 + between(20.0),
            depth_mm: DEPTH_MM,
            diameter_mm: DIAMETER_MM,
        };
        let defects = if at < good { Vec::new() } else { vec![dent] };
        bed.stage.place(&part(defects), &placement).unwrap();
        let found = inspect(&mut bed, &plan);
        let deviation = found.gauges[0].value.unwrap_or(f64::NAN).abs();
        let (verdict, say) = (found.verdict(), || {
            format!("{placement:?} {dent:?}: {deviation} {:?}", found.reason)
        });
        if at < good {
            largest = largest.max(deviation);
            rejected.extend((verdict != Verdict::Pass).then(say));
        } else {
            smallest = smallest.min(deviation);
            missed.extend((verdict != Verdict::Fail).then(say));
        }
    }
    println!(
        "{good} good parts: largest deviation {largest:.4} mm, {} rejected",
        rejected.len()
    );
    println!(
        "{dented} dented parts: smallest {smallest:.4} mm, {} missed",
        missed.len()
    );
    assert!(
        rejected.is_empty() && missed.is_empty(),
        "rejected {rejected:#?}, missed {missed:#?}"
    );
}

#[test]
fn a_dent_is_found_and_good_parts_pass_wherever_they_lie() {
    rejects(12, 4);
}

#[test]
#[ignore = "takes minutes: `.ci/run full`"]
fn a_dent_is_found_and_five_hundred_good_parts_pass_wherever_they_lie() {
    rejects(500, 50);
}
