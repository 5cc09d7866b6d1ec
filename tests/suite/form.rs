//! Flatness, straightness and roundness of perfect and of bent plates, against the truth.

use super::contours::plates::{Setting, around, polygon};
use super::gauges::{frames, plan};
use super::placement::{bed, taught_within};
use algo::inspect::kinds::{Flatness, Roundness, Straightness};
use algo::inspect::{FeatureKind, Measure};
use appliance::recipe::{FeatureFile, GaugeFile};
use sim::Part;
use sim::parts::{Defect, Plate};
use std::f64::consts::FRAC_PI_2;
use std::time::Instant;
use tests::random::Random;

/// U of the flatness of a perfect plate, mm.
const FLAT_U_MM: f64 = 0.01;
/// Least share of errors within U.
const WITHIN: f64 = 0.95;

/// Least share of values that there are: the rim of a bent face may lie too far off its plane.
const SEEN: f64 = 0.9;

/// Half the sides of the face, mm, and the default smoothing.
const FACE_MM: [f64; 2] = [22.0, 18.0];
const SMOOTHING_PX: usize = 9;

/// Flatness of the face about a point of a plate with a dent there, mm: of points 1 mm apart.
fn flatness(dent: &Option<Defect>) -> f64 {
    let [a, b] = FACE_MM;
    let lowered = |[x, y]: [f64; 2]| match dent {
        Some(Defect::Dent {
            depth_mm,
            diameter_mm,
            ..
        }) => {
            let share = (x.hypot(y) / (diameter_mm / 2.0)).min(1.0);
            -depth_mm * (FRAC_PI_2 * share).cos().powi(2)
        }
        _ => 0.0,
    };
    // The dent is in the middle: the least-squares plane is level.
    let rows = (-b as i32..=b as i32).map(f64::from);
    let places = rows.flat_map(|y| (-a as i32..=a as i32).map(move |x| [f64::from(x), y]));
    let heights = places.map(lowered);
    let low = heights.clone().fold(f64::INFINITY, f64::min);
    heights.fold(f64::NEG_INFINITY, f64::max) - low
}

#[test]
fn form_gauges_contain_the_truth_of_perfect_and_of_bent_plates_in_a_few_placements() {
    form_gauges_contain_the_truth(2);
}

#[test]
#[ignore = "takes minutes: `.ci/run full`"]
fn form_gauges_contain_the_truth_of_perfect_and_of_bent_plates_in_fifty_placements() {
    form_gauges_contain_the_truth(50);
}

fn form_gauges_contain_the_truth(placements: usize) {
    let setting = Setting::default();
    let mut bed = bed(&setting.scenario());
    bed.stage
        .place(
            &Part::Plate(setting.plate.clone()),
            &setting.placement(None),
        )
        .unwrap();
    let taught = taught_within(&mut bed, setting.tolerance_mm()).unwrap();
    let lies = setting.placement(None);
    let camera = bed.calibration.camera.clone();
    let view = (&camera, &lies);
    let [a, b] = FACE_MM;
    // Beside the large hole, below the slot.
    let middle = [-22.0, -10.0];
    let face = [[-a, -b], [a, -b], [a, b], [-a, b]].map(|[x, y]| [middle[0] + x, middle[1] + y]);
    let left = -setting.plate.width / 2.0;
    let edge = [
        [left - 3.0, -30.0],
        [left - 3.0, 30.0],
        [left + 3.0, 30.0],
        [left + 3.0, -30.0],
    ];
    let hole = setting.plate.holes[2];
    let mut file = taught.manifest.clone();
    file.features.extend([
        FeatureFile::surface("face", polygon(view, &face)),
        FeatureFile::new("plane", FeatureKind::Plane, polygon(view, &face)),
        FeatureFile::new("edge", FeatureKind::Line, polygon(view, &edge)),
        FeatureFile::new(
            "hole",
            FeatureKind::Circle,
            around(view, [hole.x, hole.y], [hole.radius + 2.5; 2]),
        ),
    ]);
    let smoothing_px = SMOOTHING_PX;
    let gauges: [(&str, &str, Measure); 5] = [
        ("flatness", "face", Flatness { smoothing_px }.into()),
        ("fine flatness", "face", Flatness { smoothing_px: 5 }.into()),
        (
            "flatness of the plane",
            "plane",
            Flatness { smoothing_px }.into(),
        ),
        ("straightness", "edge", Straightness {}.into()),
        ("roundness", "hole", Roundness {}.into()),
    ];
    file.gauges = (1..)
        .zip(&gauges)
        .map(|(slot, (name, of, measures))| GaugeFile::new(slot, name, measures.clone(), &[of]))
        .collect();
    let plan = plan(&bed, &file, &taught.recipe.arrays);
    bed.head
        .load(plan.rasters(&bed.calibration).unwrap())
        .unwrap();
    // A bowl, and a wide and a narrow dent.
    let dent = |depth_mm, diameter_mm| Defect::Dent {
        x: middle[0],
        y: middle[1],
        depth_mm,
        diameter_mm,
    };
    let bent = [
        None,
        Some(dent(0.1, 200.0)),
        Some(dent(-0.08, 60.0)),
        Some(dent(0.2, 25.0)),
    ];
    let (mut worst, mut all) = (0.0_f64, [0.0; 2]);
    for defect in bent {
        let (mut random, mut sums) = (Random::new(3), [[0.0; 4]; 5]);
        let flat = flatness(&defect);
        let truths = [flat, flat, flat, 0.0, 0.0];
        for at in 0..placements {
            let lies = setting.placement((at > 0).then_some(&mut random));
            let plate = Plate {
                defects: defect.iter().cloned().collect(),
                ..setting.plate.clone()
            };
            bed.stage.place(&Part::Plate(plate.clone()), &lies).unwrap();
            let found = plan.inspect(0, &frames(&mut bed, &plan, 0), Instant::now());
            for ((gauge, truth), sum) in found.gauges.iter().zip(truths).zip(&mut sums) {
                let Some((value, u)) = gauge.value.zip(gauge.uncertainty) else {
                    println!("{defect:?}, {}: {:?}", gauge.name, gauge.reason);
                    continue;
                };
                *sum = [
                    sum[0] + 1.0,
                    sum[1] + f64::from(u8::from((value - truth).abs() <= u)),
                    sum[2] + value - truth,
                    sum[3] + u,
                ];
                let perfect = defect.is_none() && &*gauge.name == "flatness";
                worst = worst.max(if perfect { u } else { 0.0 });
            }
        }
        for ([count, within, off, u], (name, ..)) in sums.iter().zip(&gauges) {
            let means = [off / count, u / count];
            println!(
                "{defect:?}, {name}: {within} of {count} within U; off, U: {means:.4?} mm on average"
            );
            all = [all[0] + count, all[1] + within];
        }
    }
    println!("U of a flat face up to {worst:.4} mm");
    assert!(worst <= FLAT_U_MM, "{worst}");
    assert!(all[0] >= SEEN * 20.0 * placements as f64, "{all:?}");
    assert!(all[1] >= WITHIN * all[0], "{all:?}");
}
