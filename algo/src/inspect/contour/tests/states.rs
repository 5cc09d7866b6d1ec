//! Found, absent and unseen.

use super::placed::{LEVELS, NOTHING, sheet};
use super::scene::{Chance, Noise, Rendered, Scene};
use crate::inspect::contour::shape::circle::Circle;
use crate::inspect::contour::shape::line::Line;
use crate::inspect::contour::shape::{Parameters, padded};
use crate::inspect::contour::{Contour, Outcome, Setup, State, find, inputs};

const SINGLE: &[f64] = &[1.0];
/// Placements of each case.
const PLACEMENTS: u64 = 5;

/// What is found where a hole of this radius is expected near the middle, and its true parameters.
fn look(scene: &Scene<'_>, r: f64, seed: u64, is_open: bool) -> (Contour, [f64; 3], [f64; 3]) {
    look_with(scene, r, seed, is_open, |_| {})
}

fn look_with(
    scene: &Scene<'_>,
    r: f64,
    seed: u64,
    is_open: bool,
    change: impl Fn(&mut Setup),
) -> (Contour, [f64; 3], [f64; 3]) {
    let mut chance = Chance::new(seed);
    let (x, y) = (chance.within(1.0), chance.within(1.0));
    let hole = move |px: f64, py: f64| libm::hypot(px - x, py - y) - r;
    let mut scene = scene.clone();
    scene.opening = if is_open { &hole } else { NOTHING };
    scene.tilt.0 += chance.within(1.0);
    scene.tilt.1 += chance.within(1.0);
    let reach = if is_open { 3.6 } else { f64::MAX };
    let rendered = Rendered::new(scene, reach, seed);
    let mut setup = rendered.setup();
    change(&mut setup);
    let expected = padded(&[x + chance.within(0.25), y + chance.within(0.25), r]);
    let contour = find(&Circle, &expected, &rendered.capture(seed), &setup);
    let inputs = inputs(&Circle, &contour, &setup, 0.0);
    let u = [0, 1, 2].map(|i| {
        let systematic = inputs.iter().map(|input| input.off[i] * input.off[i]);
        2.0 * (contour.covariance[i][i] + systematic.sum::<f64>()).sqrt()
    });
    (contour, [x, y, r], u)
}

/// Fails where a parameter is off by more than its uncertainty and a half: one in 20 may be off by
/// more than U, and one in 350 by more than this.
fn check(contour: &Contour, is: [f64; 3], u: [f64; 3]) {
    for (i, (p, is)) in contour.parameters.iter().zip(is).enumerate() {
        let off = libm::fabs(p - is);
        assert!(off <= 1.5 * u[i], "{i}: off {off} mm, U {u:?}, {contour:?}");
    }
}

fn quiet(mm_per_px: f64, ratios: &'static [f64]) -> Scene<'static> {
    let mut scene = sheet(mm_per_px);
    (scene.noise, scene.ratios, scene.size) = (Noise::Quiet, ratios, 64);
    scene
}

#[test]
fn a_closed_hole_is_absent() {
    for ratios in [LEVELS, SINGLE] {
        for noise in [Noise::Uniform, Noise::Quiet] {
            for seed in 0..PLACEMENTS {
                let mut scene = quiet(0.41, ratios);
                scene.noise = noise;
                let (contour, ..) = look(&scene, 3.0, seed, false);
                assert_eq!(contour.state, State::Absent, "{contour:?}");
            }
        }
    }
}

#[test]
fn a_closed_hole_of_a_thick_sheet_is_absent() {
    for thickness in [0.5, 1.0, 1.5, 3.0] {
        for tilt in [-10.0, 0.0, 5.0, 10.0] {
            for radius in [3.0, 5.0] {
                for seed in 0..PLACEMENTS {
                    let mut scene = quiet(0.41, LEVELS);
                    (scene.thickness, scene.tilt) = (thickness, (tilt, 0.0));
                    let (contour, ..) = look(&scene, radius, seed, false);
                    assert_eq!(
                        contour.state,
                        State::Absent,
                        "{thickness} {tilt} {contour:?}"
                    );
                }
            }
        }
    }
}

#[test]
fn a_hole_that_something_covers_is_unseen_and_never_absent() {
    for seed in 0..PLACEMENTS {
        let mut scene = quiet(0.41, LEVELS);
        scene.hidden = Some(|_, _| true);
        let (contour, ..) = look(&scene, 4.0, seed, true);
        assert_eq!(contour.state, State::Unseen, "{contour:?}");
        scene.hidden = Some(|x, _| x > -2.0);
        let (contour, ..) = look(&scene, 4.0, seed, true);
        assert_eq!(contour.state, State::Unseen, "{contour:?}");
    }
}

#[test]
fn of_half_a_hole_what_is_found_is_within_its_uncertainty() {
    let mut found = 0;
    for seed in 0..2 * PLACEMENTS {
        let mut scene = quiet(0.41, LEVELS);
        scene.hidden = Some(|x, y| x + 0.3 * y > 0.0);
        let (contour, is, u) = look(&scene, 5.0, seed, true);
        assert_ne!(contour.state, State::Absent);
        if contour.state == State::Found {
            check(&contour, is, u);
            found += 1;
        }
    }
    std::println!("half a hole: found {found} of {}", 2 * PLACEMENTS);
}

#[test]
fn a_hole_outside_of_the_frame_is_unseen() {
    let scene = quiet(0.41, LEVELS);
    let rendered = Rendered::new(scene, 40.0, 1);
    let setup = rendered.setup();
    for (x, y) in [(40.0, 0.0), (0.0, -40.0), (14.0, 0.0)] {
        let contour = find(&Circle, &padded(&[x, y, 3.0]), &rendered.capture(1), &setup);
        assert_eq!(contour.state, State::Unseen, "{contour:?}");
    }
}

#[test]
fn a_lit_floor_a_whole_number_of_fringes_lower_is_never_taken_for_material() {
    let mut found = 0;
    let setup = Rendered::new(quiet(0.41, SINGLE), 0.0, 1).setup();
    let fringe = libm::fabs(1.0 / setup.turns_per_mm);
    for n in 1_u64..=8 {
        for ratios in [LEVELS, SINGLE] {
            let mut scene = quiet(0.41, ratios);
            scene.floor = Some((n as f64 * fringe, 1.0));
            let (contour, is, u) = look(&scene, 5.0, n, true);
            assert_ne!(contour.state, State::Absent, "{n} {contour:?}");
            if contour.state == State::Found {
                check(&contour, is, u);
                found += 1;
            }
        }
    }
    std::println!("whole fringes: found {found} of 16");
    assert!(found >= 8);
}

#[test]
fn a_shift_of_every_edge_cancels_in_the_centre_and_counts_twice_in_the_diameter() {
    let (contour, ..) = look(&quiet(0.41, LEVELS), 5.0, 3, true);
    let [x, y, r, ..] = contour.response(&Circle, |_| 0.01);
    assert!(x.abs() < 5e-4 && y.abs() < 5e-4 && (r - 0.01).abs() < 1e-4);
    assert!(contour.outcomes.iter().all(|of| *of != Outcome::Continues));
}

/// Floors near below the sheet, whose shadow beside the rim is narrower than some pixels.
const DEPTHS: [f64; 6] = [0.2, 0.5, 1.0, 1.7, 3.0, 5.0];

#[test]
fn a_narrow_shadow_on_a_floor_of_known_depth_moves_no_edge() {
    for depth in DEPTHS {
        for noise in [Noise::Uniform, Noise::Quiet] {
            let mut scene = quiet(0.41, LEVELS);
            (scene.floor, scene.noise) = (Some((depth, 1.0)), noise);
            let (contour, is, u) = look(&scene, 5.0, 4, true);
            let off = [0, 1, 2].map(|i| (contour.parameters[i] - is[i]) * 1e3);
            let found = contour.found;
            std::println!("floor {depth} {noise:?}: {off:.1?} µm, U {u:.3?} mm, rim {found:.2}");
            assert_eq!(contour.state, State::Found, "{contour:?}");
            assert!(off.iter().all(|off| off.abs() < 12.0), "{off:?}");
        }
    }
}

#[test]
fn beside_a_floor_of_unknown_depth_edges_with_a_shadow_are_left_out() {
    let mut found = 0;
    for depth in DEPTHS {
        for noise in [Noise::Uniform, Noise::Quiet] {
            let mut scene = quiet(0.41, LEVELS);
            (scene.floor, scene.noise) = (Some((depth, 1.0)), noise);
            let unknown = |setup: &mut Setup| setup.floor = None;
            let (contour, is, u) = look_with(&scene, 5.0, 4, true, unknown);
            let off = [0, 1, 2].map(|i| (contour.parameters[i] - is[i]) * 1e3);
            let share = contour.found;
            std::println!("unknown {depth} {noise:?}: {off:.1?} µm, U {u:.3?} mm, rim {share:.2}");
            assert_ne!(contour.state, State::Absent, "{contour:?}");
            if contour.state == State::Found {
                check(&contour, is, u);
                found += 1;
            }
        }
    }
    std::println!("unknown floor: found {found} of 12");
}

/// A straight edge that is expected through the middle, with the part on its left.
fn edge() -> Line {
    Line::between((-8.0, 0.0), (8.0, 0.0)).unwrap()
}

#[test]
fn where_the_material_goes_on_as_far_as_an_edge_may_lie_it_is_absent() {
    for floor in [None, Some((18.0, 1.0))] {
        for seed in 0..2 {
            let mut chance = Chance::new(seed);
            // None at all, and one that lies farther off than it may.
            let below = -6.0 - chance.within(1.0);
            for opening in [NOTHING, &move |_: f64, y: f64| y - below] {
                let mut scene = quiet(0.41, LEVELS);
                (scene.opening, scene.floor) = (opening, floor);
                let rendered = Rendered::new(scene, f64::MAX, seed);
                let mut setup = rendered.setup();
                setup.reach = 1.5;
                let capture = rendered.capture(seed);
                let contour = find(&edge(), &Parameters::default(), &capture, &setup);
                assert_eq!(contour.state, State::Absent, "{contour:?}");
            }
        }
    }
}

#[test]
fn contours_are_found_as_far_off_as_they_may_lie() {
    for floor in [None, Some((18.0, 1.0))] {
        for reach in [0.5, 1.5, 2.5] {
            for seed in 0..2 {
                let mut chance = Chance::new(seed);
                let off = reach * if seed % 2 == 0 { 0.95 } else { -0.95 };
                let (x, y) = (chance.within(1.0), chance.within(1.0));
                let hole = move |px: f64, py: f64| libm::hypot(px - x - off, py - y) - 3.0;
                let line = move |_: f64, y: f64| y - off;
                let mut scene = quiet(0.41, LEVELS);
                (scene.opening, scene.floor) = (&hole, floor);
                let rendered = Rendered::new(scene.clone(), f64::MAX, seed);
                let mut setup = rendered.setup();
                setup.reach = reach;
                let (expected, capture) = (padded(&[x, y, 3.0]), rendered.capture(seed));
                let contour = find(&Circle, &expected, &capture, &setup);
                assert_eq!(contour.state, State::Found, "{off} {contour:?}");
                assert!((contour.parameters[0] - x - off).abs() < 0.012);
                scene.opening = &line;
                let rendered = Rendered::new(scene, f64::MAX, seed);
                let capture = rendered.capture(seed);
                let contour = find(&edge(), &Parameters::default(), &capture, &setup);
                assert_eq!(contour.state, State::Found, "{off} {contour:?}");
                assert!((contour.parameters[0] - off).abs() < 0.012);
            }
        }
    }
}
