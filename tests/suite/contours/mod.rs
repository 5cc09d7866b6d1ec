//! Holes, slots and edges of plates of the simulated head, against the truth, over many placements.

mod closed;
mod commands;
mod hidden;
mod line;
mod many;
pub(crate) mod plates;

use crate::gauges::frames;
use appliance::station::Verdict;
use line::{Judged, Line};
use plates::{Setting, plate};
use sim::parts::{Defect, Floor, Plate};
use sim::{Part, Unsteady};
use std::time::Instant;
use tests::random::Random;

/// Placements of a plate, in the long form and in the quick one.
const PLACEMENTS: usize = 12;
const FEW_PLACEMENTS: usize = 3;

fn bright(plate: Plate) -> Plate {
    let floor = Floor {
        albedo: 1.0,
        ..Floor::default()
    };
    Plate { floor, ..plate }
}

fn thick(plate: Plate) -> Plate {
    let thickness_mm = 1.0;
    Plate {
        thickness_mm,
        ..plate
    }
}

/// A lit floor, walls, lenses and ambient light at once.
fn all_together() -> Setting {
    Setting {
        plate: bright(thick(plate())),
        blur: [0.5, 1.0],
        ambient: 0.2,
        thickness_mm: Some(1.0),
        ..Setting::default()
    }
}

/// The settings that a row of the promise names, with the largest bias in µm.
fn settings() -> Vec<(&'static str, Setting, f64)> {
    let plain = Setting::default();
    let of = |plate: Plate| Setting {
        plate,
        ..plain.clone()
    };
    vec![
        ("plain", plain.clone(), 8.0),
        (
            "1 mm thick",
            Setting {
                thickness_mm: Some(1.0),
                ..of(thick(plate()))
            },
            20.0,
        ),
        (
            "real optics",
            Setting {
                blur: [0.5, 1.0],
                ..plain.clone()
            },
            20.0,
        ),
        ("bright floor", of(bright(plate())), 35.0),
        (
            "ambient light",
            Setting {
                ambient: 0.2,
                ..plain.clone()
            },
            20.0,
        ),
        ("all together", all_together(), 35.0),
        (
            "tilted",
            Setting {
                tilt_deg: 12.0,
                thickness_mm: Some(1.0),
                ..of(thick(plate()))
            },
            30.0,
        ),
        (
            "tilted, bright floor",
            Setting {
                tilt_deg: 12.0,
                thickness_mm: Some(1.0),
                ..of(bright(thick(plate())))
            },
            35.0,
        ),
        (
            "tilted, thickness not told",
            Setting {
                tilt_deg: -12.0,
                thickness_mm: None,
                ..of(thick(plate()))
            },
            60.0,
        ),
        (
            "quiet",
            Setting {
                noise: None,
                ..plain
            },
            8.0,
        ),
    ]
}

#[test]
fn holes_slots_and_edges_are_true_and_as_uncertain_as_they_say() {
    let mut judged = Judged::default();
    Line::new(&Setting::default()).judge("plain", FEW_PLACEMENTS, &mut judged);
    let [scatter, within, _] = judged.figures();
    assert_eq!(judged.missing, 0);
    assert!(judged.bias <= 8.0, "{}", judged.bias);
    assert!((0.8..1.2).contains(&scatter), "{scatter}");
    assert!(within >= 0.93, "{within}");
}

#[test]
#[ignore = "minutes"]
fn contours_are_true_with_thick_sheets_bright_floors_real_optics_and_tilts() {
    judge(settings());
}

#[test]
fn sizes_in_light_that_changes_slowly_are_as_true() {
    sizes_are_true("13.7 Hz", lamp(13.7), FEW_PLACEMENTS);
}

/// Other light of 40 ± 15 counts where exposures are short against its period.
fn lamp(lamp_hz: f64) -> Unsteady {
    Unsteady {
        lamp_hz,
        lamp_depth: 15.0 / 40.0,
        ..Unsteady::default()
    }
}

/// Of a plate that was taught in steady light.
fn sizes_are_true(name: &str, unsteady: Unsteady, placements: usize) {
    let mut line = Line::new(&Setting {
        ambient: 40.0 / 255.0,
        ..Setting::default()
    });
    line.bed.stage.unsettle(unsteady).unwrap();
    let mut judged = Judged::default();
    line.judge(name, placements, &mut judged);
    let [scatter, within, _] = judged.figures();
    assert_eq!(judged.missing, 0, "{name}");
    assert!(judged.bias <= 3.0, "{name}: {}", judged.bias);
    assert!((0.8..1.25).contains(&scatter), "{name}: {scatter}");
    assert!(within >= 0.95, "{name}: {within}");
}

#[test]
fn rims_that_nobody_states_are_within_the_uncertainty_in_a_few_placements() {
    rims_that_nobody_states_are_within_the_uncertainty(
        FEW_PLACEMENTS,
        &[(0.0, true), (0.2, false)],
    );
}

/// U of a diameter, mm: of sharp rims, and of those that nobody states.
const SHARP_U_MM: f64 = 0.012;
const UNKNOWN_U_MM: f64 = 0.2;

/// Plates with sharp and with rolled edges; limits that their true diameters do not keep.
fn rims_that_nobody_states_are_within_the_uncertainty(placements: usize, rims: &[(f64, bool)]) {
    for &(rim_mm, rims_stated) in rims {
        let setting = Setting {
            plate: Plate { rim_mm, ..plate() },
            rims_stated,
            ..Setting::default()
        };
        let is_diameter = |name: &str| name.starts_with("diameter");
        let mut line = Line::with_limits(&setting, |gauge, truth| {
            if is_diameter(&gauge.name) {
                (gauge.low, gauge.high) = (Some(truth + 0.005), Some(truth + 2.0));
            }
        });
        let mut judged = Judged::default();
        line.judge(&format!("rims of {rim_mm} mm"), placements, &mut judged);
        let [_, within, _] = judged.figures();
        assert_eq!(judged.missing, 0);
        assert!(within >= 0.95, "{rim_mm}: {within}");
        assert!(
            rims_stated || judged.far.is_empty(),
            "{rim_mm}: {:?}",
            judged.far
        );
        let (mut random, mut largest) = (Random::new(9), 0.0_f64);
        for _ in 0..placements {
            let lies = setting.placement(Some(&mut random));
            let inspected = line.inspect(setting.plate.clone(), &lies);
            for gauge in inspected.gauges.iter().filter(|of| is_diameter(&of.name)) {
                let u = gauge.uncertainty.unwrap();
                largest = largest.max(u);
                assert!(
                    u <= if rims_stated {
                        SHARP_U_MM
                    } else {
                        UNKNOWN_U_MM
                    },
                    "{u}"
                );
                assert!(!gauge.decision.pass, "{rim_mm}: {gauge:?}");
            }
        }
        println!("U of diameters up to {largest:.4} mm");
    }
}

/// Fails if plates in one of these settings are measured with a larger bias than it names, in µm, or
/// with other scatter or errors than they state.
fn judge(settings: Vec<(&'static str, Setting, f64)>) {
    let mut wrong = Vec::new();
    for (name, setting, most) in settings {
        let mut judged = Judged::default();
        Line::new(&setting).judge(name, PLACEMENTS, &mut judged);
        let [scatter, within, _] = judged.figures();
        let good = judged.bias <= most && (0.7..1.3).contains(&scatter) && within >= 0.93;
        if !good || judged.missing > 0 {
            wrong.push((name, judged.bias, scatter, within, judged.missing));
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn a_closed_hole_is_absent_and_changes_nothing_else() {
    closed_holes_are_absent(2);
}

/// Closes one hole, or two, in so many placements.
fn closed_holes_are_absent(placements: usize) {
    let mut line = Line::new(&Setting::default());
    let mut random = Random::new(9);
    for at in 0..placements {
        let lies = line.setting.placement((at > 0).then_some(&mut random));
        let closed: &[usize] = if at % 2 == 0 { &[1] } else { &[0, 2] };
        let mut plate = line.setting.plate.clone();
        line.bed.stage.reseed(7);
        let open = line.inspect(plate.clone(), &lies);
        plate.defects = closed
            .iter()
            .map(|&index| Defect::MissingHole { index })
            .collect();
        line.bed.stage.reseed(7);
        let found = line.inspect(plate, &lies);
        assert_eq!(found.verdict(), Verdict::Fail, "{:?}", found.reason);
        let names: Vec<String> = closed.iter().map(|at| format!("hole {}", at + 1)).collect();
        for (((gauge, _), found), open) in line.gauges.iter().zip(&found.gauges).zip(&open.gauges) {
            let datum = ["sheet", "hole 1", "hole 2"].map(String::from);
            let datum = datum.iter().filter(|_| gauge.datum.is_some());
            let is_of_closed = gauge.of.iter().chain(datum).any(|of| names.contains(of));
            assert_eq!(
                found.decision.absent, is_of_closed,
                "{} {found:?}",
                gauge.name
            );
            if let (Some(value), Some(open), Some(sigma)) = (found.value, open.value, open.sigma) {
                let change = (value - open).abs();
                assert!(
                    change <= 2.0 * sigma,
                    "{}: {change} of σ {sigma}",
                    gauge.name
                );
            }
        }
    }
}

#[test]
fn a_displaced_hole_and_a_larger_one_fail_and_good_plates_pass() {
    defects_fail(1);
}

/// Measures good plates, larger holes and displaced ones in so many placements.
fn defects_fail(placements: usize) {
    let mut line = Line::with_limits(&Setting::default(), |gauge, truth| {
        (gauge.low, gauge.high) = (Some(truth - 0.06), Some(truth + 0.06));
        if gauge.datum.is_some() && gauge.name == "position" {
            (gauge.low, gauge.high) = (None, Some(0.3));
        }
    });
    let mut random = Random::new(11);
    for at in 0..placements {
        let lies = line.setting.placement((at > 0).then_some(&mut random));
        let good = line.setting.plate.clone();
        let verdict = |line: &mut Line, defects: Vec<Defect>| {
            let plate = Plate {
                defects,
                ..good.clone()
            };
            let found = line.inspect(plate, &lies);
            (found.verdict(), found.reason.clone())
        };
        assert_eq!(verdict(&mut line, vec![]), (Verdict::Pass, None));
        let (index, radius) = (2, good.holes[2].radius + 0.05);
        let larger = verdict(&mut line, vec![Defect::HoleRadius { index, radius }]);
        assert_eq!(larger.0, Verdict::Fail, "{larger:?}");
        let (dx, dy) = (0.1, 0.0);
        let displaced = verdict(&mut line, vec![Defect::DisplacedHole { index: 3, dx, dy }]);
        assert_eq!(displaced.0, Verdict::Fail, "{displaced:?}");
    }
}

#[test]
fn any_number_of_threads_finds_the_same_bits() {
    let mut line = Line::new(&Setting::default());
    let lies = line.setting.placement(Some(&mut Random::new(3)));
    let part = Part::Plate(line.setting.plate.clone());
    line.bed.stage.place(&part, &lies).unwrap();
    let frames = frames(&mut line.bed, &line.plan, 0);
    let found = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        let inspect = || line.plan.inspect(0, &frames, Instant::now());
        let found = pool.build().unwrap().install(inspect);
        (found.gauges.clone(), found.features)
    };
    let alone = found(1);
    assert!(alone.0.iter().all(|gauge| gauge.value.is_some()));
    for threads in [2, 3, 16] {
        assert_eq!(found(threads), alone);
    }
}
