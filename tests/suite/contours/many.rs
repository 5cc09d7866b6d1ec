//! Many placements, fine pixels, rounded rims and floors at every depth: what the quick tests see a
//! few of.

use super::line::{Judged, Line};
use super::plates::{Setting, Z_MM, plate};
use super::{
    all_together, bright, closed_holes_are_absent, defects_fail, judge, lamp,
    rims_that_nobody_states_are_within_the_uncertainty, sizes_are_true, thick,
};
use crate::placement::{bed, taught_within};
use crate::surroundings::everywhere;
use algo::geometry::Vector;
use appliance::station::Verdict;
use sim::parts::{Floor, Plate};
use sim::{Part, Unsteady};
use std::time::Instant;
use tests::random::Random;

/// The camera of the reference hardware.
const FINE: (u32, u32) = (1456, 1088);

/// A plate whose smallest hole has a radius of 2 mm, before that camera.
fn fine(setting: Setting) -> Setting {
    let mut plate = setting.plate;
    plate.holes[0].radius = 2.0;
    Setting {
        plate,
        size: FINE,
        ..setting
    }
}

#[test]
#[ignore = "takes minutes: `.ci/run full`"]
fn fine_pixels_show_holes_slots_and_edges_to_10_um() {
    let plain = Setting::default();
    let tilted = Setting {
        tilt_deg: 12.0,
        thickness_mm: Some(1.0),
        plate: thick(plate()),
        ..plain.clone()
    };
    let lit = Setting {
        plate: bright(tilted.plate.clone()),
        ..tilted.clone()
    };
    judge(vec![
        ("plain", fine(plain), 10.0),
        ("all together", fine(all_together()), 15.0),
        ("tilted", fine(tilted), 15.0),
        ("tilted, bright floor", fine(lit), 15.0),
    ]);
}

#[test]
#[ignore = "takes minutes: `.ci/run full`"]
fn what_is_measured_at_rounded_rims_is_within_its_uncertainty() {
    let (mut errors, mut within) = (0.0, 0.0);
    for rim_mm in [0.1, 0.2] {
        let plate = Plate {
            rim_mm,
            ..thick(plate())
        };
        let setting = Setting {
            thickness_mm: Some(plate.thickness_mm),
            plate,
            ..Setting::default()
        };
        let mut judged = Judged::default();
        Line::new(&setting).judge(&format!("rim of {rim_mm} mm"), 12, &mut judged);
        judged.figures();
        assert_eq!(judged.missing, 0);
        errors += judged.errors;
        within += judged.within;
    }
    assert!(within / errors >= 0.95, "{}", within / errors);
}

#[test]
#[ignore = "takes minutes: `.ci/run full`"]
fn rims_that_nobody_states_are_within_the_uncertainty_in_fifty_placements() {
    let unstated = [0.0, 0.1, 0.2, 0.3].map(|rim_mm| (rim_mm, false));
    let rims = [&[(0.0, true)][..], &unstated].concat();
    rims_that_nobody_states_are_within_the_uncertainty(50, &rims);
}

/// How far below the plate a floor lies on which the finest fringes are `count` fringes on, mm.
fn depth_of(line: &Line, count: f64) -> f64 {
    let triangulator = line.plan.production().triangulator();
    let eye = triangulator.camera().centre();
    // On the line of sight through the plate's middle.
    let phase = |below: f64| {
        let along = below / (eye.z - Z_MM);
        let at = Vector::new(-along * eye.x, -along * eye.y, Z_MM - below);
        let (column, row) = triangulator.projector().project(at).unwrap();
        triangulator.function().at(column, row)
    };
    let (mut low, mut high) = (0.0, 100.0);
    for _ in 0..40 {
        let middle = (low + high) / 2.0;
        match (phase(middle) - phase(0.0)).abs() < count {
            true => low = middle,
            false => high = middle,
        }
    }
    low
}

#[test]
#[ignore = "takes minutes: `.ci/run full`"]
fn a_floor_a_whole_number_of_fringes_lower_is_never_taken_for_the_sheet() {
    let dark = Line::new(&Setting::default());
    let mut wrong = Vec::new();
    for count in 1..=8 {
        let depth = depth_of(&dark, f64::from(count));
        let plate = Plate {
            floor: Floor { depth, albedo: 1.0 },
            ..plate()
        };
        let setting = Setting {
            plate,
            some: true,
            ..Setting::default()
        };
        let mut judged = Judged::default();
        let name = format!("{count} fringes, {depth:.1} mm");
        Line::new(&setting).judge(&name, 4, &mut judged);
        let [_, within, _] = judged.figures();
        if within < 0.93 && judged.errors > 0.0 {
            wrong.push((name, within));
        }
    }
    assert!(wrong.is_empty(), "{wrong:?}");
}

#[test]
#[ignore = "takes minutes: `.ci/run full`"]
fn sizes_in_changing_light_are_as_true_in_fifty_placements() {
    let noisy = Unsteady {
        projector_noise: 0.03,
        ..Unsteady::default()
    };
    for (name, unsteady) in [
        ("steady", Unsteady::default()),
        ("100 Hz", lamp(100.0)),
        ("120 Hz", lamp(120.0)),
        ("13.7 Hz", lamp(13.7)),
        ("projector 3 %", noisy),
    ] {
        sizes_are_true(name, unsteady, 50);
    }
}

#[test]
#[ignore = "takes minutes: `.ci/run full`"]
fn closed_holes_are_absent_in_fifty_placements() {
    closed_holes_are_absent(50);
}

#[test]
#[ignore = "takes minutes: `.ci/run full`"]
fn displaced_holes_and_larger_ones_fail_in_fifty_placements() {
    defects_fail(50);
}

#[test]
#[ignore = "takes half an hour: `.ci/run full`"]
fn five_hundred_good_plates_pass_by_limits_as_taught() {
    let setting = Setting::default();
    let mut bed = bed(&setting.scenario());
    let part = Part::Plate(setting.plate.clone());
    bed.stage.place(&part, &setting.placement(None)).unwrap();
    let taught = taught_within(&mut bed, 5.0).unwrap();
    let plan = crate::gauges::plan(&bed, &taught.manifest, &taught.recipe.arrays);
    bed.head
        .load(plan.rasters(&bed.calibration).unwrap())
        .unwrap();
    let mut random = Random::new(12);
    let mut wrong = Vec::new();
    for at in 0..500 {
        let lies = setting.placement(Some(&mut random));
        bed.stage.place(&part, &lies).unwrap();
        let frames = crate::gauges::frames(&mut bed, &plan, 0);
        let found = plan.inspect(0, &frames, Instant::now());
        if found.verdict() != Verdict::Pass {
            wrong.push((at, lies, found.reason));
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

/// The least share of errors within U.
const WITHIN: f64 = 0.95;

#[test]
#[ignore = "takes minutes: `.ci/run full`"]
fn slots_and_circles_are_within_their_uncertainty_in_all_surroundings() {
    let mut wrong = Vec::new();
    // On a floor that it touches contours of a sheet have no value: the face beside their rims seems to lie 0.05 to
    // 0.1 mm off the plane.
    let worlds = everywhere()
        .into_iter()
        .filter(|(name, _)| *name != "touched");
    for (name, world) in worlds {
        let setting = Setting {
            plate: thick(plate()),
            thickness_mm: Some(1.0),
            world,
            some: true,
            ..Setting::default()
        };
        // Edges are of another promise.
        let mut judged = Judged {
            without: Some("edge"),
            ..Judged::default()
        };
        Line::new(&setting).judge(name, 6, &mut judged);
        let [_, within, _] = judged.figures();
        println!("{name}: {:?} by more than 2 U", judged.far);
        if within < WITHIN || !judged.far.is_empty() || judged.missing > 0 {
            wrong.push((name, within, judged.far, judged.missing));
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}
