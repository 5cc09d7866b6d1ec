//! Gauges and alignment on parts of the simulated head.

use super::placement::{Bed, TIMEOUT, bed, scenario, taught};
use super::station_plc::{Daemon, Place, Plc, READY, SMALL_HEAD, long};
use algo::inspect::kinds::{
    self, Angle, Axis, Component, Coverage, Deviation, Distance, Flatness, MeanHeight,
    OutOfTolerance, PeakToValley, RmsDeviation, Step, Tilt, Volume, Z,
};
use algo::inspect::{FeatureKind, Findings, Measure, Production};
use algo::simd::Backend;
use appliance::head::seam;
use appliance::recipe::file::archive::{Arrays, pack};
use appliance::recipe::plan::{Plan, PlanError};
use appliance::recipe::{AlignmentKind, FeatureFile, GaugeFile, Recipe, RecipeFile};
use appliance::station::{Inspection, Unit, Verdict};
use hal::frame::Frame;
use sim::parts::{Plane, SheetMetal};
use sim::{Part, Placement, Scenario};
use std::fs;
use std::time::Instant;

/// Largest error of mean heights: 8-bit rounding without other noise is below 0.01 mm per pixel, in
/// the part and in golden.
const EXACT_MM: f64 = 0.01;
/// Largest error of mean heights after a motion was taken back; includes the error of the motion.
const ALIGNED_MM: f64 = 0.015;

/// A region on the plate and one on the bead, in pixels of 256 × 256.
const PLATE: [[f64; 2]; 4] = [[82.0, 95.0], [130.0, 95.0], [130.0, 145.0], [82.0, 145.0]];
const BEAD: [[f64; 2]; 4] = [[90.0, 160.0], [150.0, 160.0], [150.0, 168.0], [90.0, 168.0]];

/// A gauge of one feature; [`plan`] gives it its slot.
pub(crate) fn gauge(name: &str, feature: &str, measures: impl Into<Measure>) -> GaugeFile {
    GaugeFile::new(1, name, measures, &[feature])
}

/// A gauge of the whole part.
fn of_part(name: &str, component: Component) -> GaugeFile {
    GaugeFile::new(1, name, kinds::Placement { component }, &[])
}

/// A gauge of every kind except coverage, on the regions `plate` and `bead`.
pub(crate) fn all_kinds(side: usize, tolerance_mm: f64) -> Vec<GaugeFile> {
    let smoothing_px = side;
    vec![
        gauge(
            "deviation",
            "plate",
            Deviation {
                smoothing_px: side | 1,
            },
        ),
        gauge("mean", "plate", MeanHeight {}),
        GaugeFile::new(1, "step", Step {}, &["bead", "plate"]),
        gauge("tilt x", "plate", Tilt { about: Axis::X }),
        gauge("tilt y", "plate", Tilt { about: Axis::Y }),
        gauge("volume", "bead", Volume { above_mm: 8.0 }),
        of_part("z", Component::Z),
        of_part("x", Component::X),
        of_part("y", Component::Y),
        of_part("about x", Component::AboutX),
        of_part("about y", Component::AboutY),
        gauge("flatness", "plate", Flatness { smoothing_px }),
        gauge("range", "bead", PeakToValley { smoothing_px }),
        gauge("rms", "plate", RmsDeviation { smoothing_px }),
        gauge(
            "share",
            "plate",
            OutOfTolerance {
                smoothing_px,
                tolerance_mm,
            },
        ),
    ]
}

pub(crate) fn features(plate: [[f64; 2]; 4], bead: [[f64; 2]; 4]) -> Vec<FeatureFile> {
    [("plate", plate), ("bead", bead)]
        .map(|(name, region)| FeatureFile::surface(name, region.to_vec()))
        .to_vec()
}

pub(crate) fn plan(bed: &Bed, file: &RecipeFile, arrays: &Arrays) -> Plan {
    planned(bed, file, arrays).unwrap()
}

pub(crate) fn planned(bed: &Bed, file: &RecipeFile, arrays: &Arrays) -> Result<Plan, PlanError> {
    let limited = |gauge: &GaugeFile| gauge.low.is_some() || gauge.high.is_some();
    let mut file = RecipeFile {
        judges_nothing: !file.gauges.iter().any(limited),
        ..file.clone()
    };
    for (slot, gauge) in (1..).zip(&mut file.gauges) {
        gauge.slot = slot;
    }
    let (bytes, _) = pack(&file, arrays).unwrap();
    Plan::new(Recipe::from_bytes(&bytes).unwrap(), &bed.calibration, true)
}

/// Frames of a sequence of a plan whose patterns are loaded.
pub(crate) fn frames(bed: &mut Bed, plan: &Plan, sequence: usize) -> Vec<Frame> {
    let mut frames = Vec::new();
    let mut keep = |_, frame| frames.push(frame);
    bed.head
        .acquire(plan.indices(sequence), TIMEOUT, &mut keep)
        .unwrap();
    frames
}

pub(crate) fn inspect(bed: &mut Bed, plan: &Plan, sequence: usize) -> Inspection {
    bed.head
        .load(plan.rasters(&bed.calibration).unwrap())
        .unwrap();
    let frames = frames(bed, plan, sequence);
    plan.inspect(sequence, &frames, Instant::now())
}

fn value(inspection: &Inspection, name: &str) -> f64 {
    let gauge = inspection.gauges.iter().find(|gauge| &*gauge.name == name);
    gauge
        .unwrap()
        .value
        .unwrap_or_else(|| panic!("{name} has no value: {:?}", inspection.reason))
}

/// Mean of the true heights inside a rectangle of pixels.
fn true_mean(bed: &Bed, corners: [[f64; 2]; 4]) -> f64 {
    let truth = bed.stage.truth();
    let (mut sum, mut count) = (0.0, 0.0);
    for v in corners[0][1] as usize..corners[2][1] as usize {
        for u in corners[0][0] as usize..corners[2][0] as usize {
            let z = f64::from(truth.height[v * 256 + u]);
            if z.is_finite() {
                sum += z;
                count += 1.0;
            }
        }
    }
    sum / count
}

#[test]
fn gauges_give_what_is_true_of_the_part_wherever_it_lies_within_its_tolerance() {
    let part = Part::SheetMetal(SheetMetal::default());
    let mut scene = scenario(part.clone());
    scene.noise.noise_counts = Some(0.0);
    let mut bed = bed(&scene);
    let taught = taught(&mut bed).unwrap();
    let (mean, bead) = (true_mean(&bed, PLATE), true_mean(&bed, BEAD));
    let file = RecipeFile {
        features: features(PLATE, BEAD),
        gauges: all_kinds(5, 0.1),
        placement_tolerance_mm: 3.0,
        ..taught.manifest.clone()
    };
    let plan = plan(&bed, &file, &taught.recipe.arrays);
    let places = [
        (Placement::default(), EXACT_MM),
        (
            Placement {
                shift_mm: [0.8, -0.7, 0.6],
                tilt_deg: [0.4, -0.3],
                rotation_deg: 0.2,
            },
            ALIGNED_MM,
        ),
    ];
    let mut volumes = Vec::new();
    for (place, exact) in places {
        bed.stage.place(&part, &place).unwrap();
        let found = inspect(&mut bed, &plan, 0);
        assert_eq!(found.verdict(), Verdict::Pass, "{:?}", found.reason);
        let off = |name: &str, expected: f64, tolerance: f64| {
            let value = value(&found, name);
            assert!(
                (value - expected).abs() <= tolerance,
                "{name}: {value}, true {expected}, {place:?}"
            );
        };
        off("mean", mean, exact);
        off("step", bead - mean, exact);
        // An error of 1 mm over the region of 40 mm would be 1.4 degrees.
        off("tilt x", 0.0, exact * 1.4);
        off("tilt y", 0.0, exact * 1.4);
        off("deviation", 0.0, 4.0 * exact);
        off("rms", 0.0, exact);
        off("share", 0.0, 0.0);
        off("flatness", 0.0, 4.0 * exact);
        off("about x", place.tilt_deg[0], 0.02);
        off("about y", place.tilt_deg[1], 0.02);
        // The part turns about the origin, and the motion is about the middle of its surface.
        off("x", place.shift_mm[0], 0.1);
        off("y", place.shift_mm[1], 0.1);
        off("z", place.shift_mm[2], 0.1);
        // The bead's region is 8 pixels of 0.83 mm wide. Its top is 2.2 mm above the plate, with
        // slopes to both sides.
        let range = value(&found, "range");
        assert!((0.1..2.2).contains(&range), "{range}");
        volumes.push(value(&found, "volume"));
        let units: Vec<Unit> = found.gauges.iter().map(|gauge| gauge.unit).collect();
        assert_eq!(
            units[1..6],
            [
                Unit::Length,
                Unit::Length,
                Unit::Angle,
                Unit::Angle,
                Unit::Volume
            ]
        );
        let undetermined = found.placement.unwrap().undetermined();
        assert!(undetermined.is_empty(), "{undetermined:?}");
    }
    // 60 × 8 pixels of 0.83 mm, foreshortened along u by cos 20°, with a mean height below 1.9 mm.
    let expected = (bead - 8.0) * 60.0 * 8.0 * 0.83 * 0.83 / 20_f64.to_radians().cos();
    assert!(
        (volumes[0] / expected - 1.0).abs() < 0.05,
        "{volumes:?} {expected}"
    );
    assert!((volumes[1] / volumes[0] - 1.0).abs() < 0.02, "{volumes:?}");
}

#[test]
fn findings_of_a_moved_part_depend_neither_on_strips_nor_on_threads_nor_on_the_back_end() {
    let part = Part::SheetMetal(SheetMetal::default());
    let mut bed = bed(&scenario(part.clone()));
    let taught = taught(&mut bed).unwrap();
    let mut gauges = all_kinds(5, 0.02);
    gauges.push(gauge("coverage", "plate", Coverage {}));
    let both = ["plane of plate", "plane of bead"];
    gauges.push(gauge("height", both[0], Z {}));
    gauges.push(GaugeFile::new(1, "distance", Distance {}, &both));
    gauges.push(GaugeFile::new(1, "angle", Angle {}, &both));
    let mut features = features(PLATE, BEAD);
    for mut feature in features.clone() {
        feature.name = format!("plane of {}", feature.name);
        feature.kind = FeatureKind::Plane;
        features.push(feature);
    }
    let file = RecipeFile {
        features,
        gauges,
        ..taught.manifest.clone()
    };
    let plan = plan(&bed, &file, &taught.recipe.arrays);
    let place = Placement {
        shift_mm: [-0.6, 0.5, 0.7],
        tilt_deg: [-0.2, 0.3],
        rotation_deg: 0.1,
    };
    bed.stage.place(&part, &place).unwrap();
    bed.head
        .load(plan.rasters(&bed.calibration).unwrap())
        .unwrap();
    let frames = frames(&mut bed, &plan, 0);
    let views: Vec<_> = frames
        .iter()
        .map(|frame| seam::view(frame).unwrap())
        .collect();
    let mut production = plan.into_production();
    let find = |production: &Production, threads: usize, rows: usize| -> Findings {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        let mut strips = production.strips(rows);
        let mut found = || production.inspect(&views, &mut strips, None).unwrap();
        let first = pool.install(&mut found);
        // Used buffers give the same result.
        assert_eq!(pool.install(&mut found), first);
        first
    };
    let expected = find(&production, 1, 256);
    assert!(
        expected.readings.iter().all(Option::is_some),
        "{:?}",
        expected.readings
    );
    assert!(expected.placed.as_ref().unwrap().reach > 0.8);
    for backend in Backend::available() {
        production = production.with_backend(backend);
        for (threads, rows) in [(1, 1), (2, 7), (2, 64)] {
            let found = find(&production, threads, rows);
            assert_eq!(
                found,
                expected,
                "{threads} threads, {rows} rows, {}",
                backend.name()
            );
        }
    }
}

#[test]
fn a_part_outside_its_tolerance_is_invalid_and_says_how_far() {
    let part = Part::SheetMetal(SheetMetal::default());
    let mut bed = bed(&scenario(part.clone()));
    let taught = taught(&mut bed).unwrap();
    let plan = plan(&bed, &taught.manifest, &taught.recipe.arrays);
    for (x, verdict) in [(0.8, Verdict::Pass), (1.6, Verdict::Invalid)] {
        let place = Placement {
            shift_mm: [x, 0.0, 0.0],
            ..Placement::default()
        };
        bed.stage.place(&part, &place).unwrap();
        let found = inspect(&mut bed, &plan, 0);
        assert_eq!(
            found.verdict(),
            verdict,
            "{x}: {:?} {:?}",
            found.reason,
            found.gauges
        );
        let reach = found.placement.unwrap().reach_mm;
        assert!((reach - x).abs() < 0.1, "{x}: {reach}");
        if verdict == Verdict::Invalid {
            let reason = found.reason.unwrap();
            assert!(
                reason.contains("off its place") && reason.contains("1.00 mm"),
                "{reason}"
            );
        }
    }
}

#[test]
fn a_component_that_the_shape_does_not_determine_is_invalid_and_is_named() {
    let mut bed = bed(&scenario(Part::Plane(Plane::default())));
    let taught = taught(&mut bed).unwrap();
    let file = RecipeFile {
        gauges: vec![of_part("z", Component::Z), of_part("x", Component::X)],
        ..taught.manifest.clone()
    };
    let plan = plan(&bed, &file, &taught.recipe.arrays);
    let found = inspect(&mut bed, &plan, 0);
    assert_eq!(
        found.placement.unwrap().undetermined(),
        ["x", "y", "about z"]
    );
    assert!(found.gauges[0].value.is_some() && found.gauges[1].value.is_none());
    assert_eq!(found.verdict(), Verdict::Invalid);
    let reason = found.reason.unwrap();
    assert!(
        reason.contains("x, y, about z: leave the gauge out"),
        "{reason}"
    );
}

#[test]
fn a_recipe_without_alignment_is_not_aligned() {
    let mut bed = bed(&scenario(Part::SheetMetal(SheetMetal::default())));
    let taught = taught(&mut bed).unwrap();
    assert_eq!(taught.manifest.alignment, AlignmentKind::Rigid);
    let file = RecipeFile {
        alignment: AlignmentKind::None,
        ..taught.manifest.clone()
    };
    let plan = plan(&bed, &file, &taught.recipe.arrays);
    let found = inspect(&mut bed, &plan, 0);
    assert_eq!(found.verdict(), Verdict::Pass);
    assert!(found.placement.is_none());
}

#[test]
fn a_part_that_the_short_sequence_cannot_vouch_for_is_measured_again_within_the_same_cycle() {
    let scene = format!("{SMALL_HEAD}\n[part]\nkind = \"cone\"\n");
    let scenario = Scenario::from_toml(&scene, "scene").unwrap();
    let taught = taught(&mut bed(&scenario)).unwrap();
    let file = RecipeFile {
        production: 2,
        ..taught.manifest.clone()
    };
    let place = Place::new();
    fs::create_dir_all(place.recipe().parent().unwrap()).unwrap();
    let (bytes, _) = pack(&file, &taught.recipe.arrays).unwrap();
    fs::write(place.recipe(), bytes).unwrap();
    // Twice the recipe's tolerance.
    let away = format!("{scene}\n[placement]\nshift_mm = [0.0, 0.0, 2.0]\n");
    fs::write(place.path("small.toml"), away).unwrap();
    let daemon = Daemon::start(&place);
    let mut plc = Plc::connect(&daemon);
    plc.wait("READY", |status| status.has(READY));
    let words = plc.measure(7);
    let status = plc.status();
    assert_eq!(
        (status.seq(), status.triggers()),
        (1, 1),
        "one trigger, one result"
    );
    // The full sequence after a shorter one, on a simulated head; the part is found outside its
    // tolerance.
    assert_eq!(words[31] & 0b11_1110, 0b11_1000, "{:b}", words[31]);
    assert_eq!(words[8], Verdict::Invalid.number());
    // Judging before the longer sequence counts as processing too, although EXPOSURE_DONE comes
    // after it.
    let processing = long(&plc.read(610, 2).unwrap(), 0);
    let after_exposure = long(&words, 20) - long(&words, 18);
    assert!(processing > after_exposure, "{processing} {after_exposure}");
}
