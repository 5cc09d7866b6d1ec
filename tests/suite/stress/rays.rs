//! Geometry in which the phase does not depend on the height: no panic, no NaN, and no wrong
//! height.

use super::random::between;
use super::rig::{self, PROJECTOR, looking_down};
use super::twins::{FRAME, FRINGES, Twins, UNIT};
use algo::geometry::{HeightRange, Pinhole, PinholeModel, RigError};
use algo::units::Height;
use tests::random::Random;

const SEED: u64 = 20_260_609;
const RANGE: HeightRange = HeightRange {
    low: -60.0,
    high: 60.0,
};

/// Pixels at a place and around it, at distances down to the rounding error.
fn about((u, v): (f64, f64)) -> impl Iterator<Item = (f64, f64)> {
    let steps = [0.0, 1e-12, 1e-9, 1e-6, 1e-3, 0.1, 1.0, 5.0, 20.0];
    steps.into_iter().flat_map(move |step| {
        let around = [(step, 0.0), (-step, 0.0), (0.0, step), (step, -step)];
        around.map(|(du, dv)| (u + du, v + dv))
    })
}

fn down(centre: [f64; 3]) -> PinholeModel {
    looking_down(centre, 0.0, FRAME, 0.2)
}

fn lamp(centre: [f64; 3]) -> PinholeModel {
    looking_down(centre, 0.0, PROJECTOR, 0.4)
}

#[test]
fn a_pixel_on_the_baseline_has_no_height_and_its_neighbours_have_the_right_one() {
    let mut random = Random::new(SEED);
    // The projector above and behind the camera, and within its view, on its axis and beside it.
    for (eye, light) in [
        ([0.0, 0.0, 600.0], [0.0, 0.0, 900.0]),
        ([0.0, 0.0, 600.0], [20.0, 0.0, 900.0]),
        ([0.0, 0.0, 900.0], [0.0, 0.0, 500.0]),
        ([0.0, 0.0, 900.0], [25.0, 10.0, 400.0]),
        ([3.0, -7.0, 500.0], [3.1, -7.0, 500.5]),
    ] {
        let twins = Twins::new(&down(eye), &lamp(light), RANGE).unwrap();
        // The epipole: where the line through both centres meets the frame.
        let centre = algo::geometry::Vector::new(light[0], light[1], light[2]);
        let eye = twins.solver.camera().centre();
        let toward = if centre.z < eye.z { 1.0 } else { -1.0 };
        let epipole = twins
            .solver
            .camera()
            .project(eye + (centre - eye) * toward)
            .unwrap();
        for z in [-50.0, 0.0, 50.0] {
            let phase = twins.phase(epipole.0, epipole.1, z);
            for off in [0.0, UNIT, -UNIT, 1e-12, 1e-6, -1e-3] {
                assert_eq!(twins.solve(epipole.0, epipole.1, phase + off), None);
            }
        }
        let mut found = 0;
        for place in about(epipole) {
            found += twins.recovered(&mut random, place);
        }
        println!("{eye:?}, {light:?}: {found} heights about the epipole {epipole:?}");
        assert!(found > 20 || light[2] == 500.5, "{found}");
    }
}

#[test]
fn fringes_along_the_baseline_tell_no_height() {
    // Both at the same height, displaced along the fringes: the phase is constant along every ray.
    let twins = Twins::new(&down([0.0, 0.0, 600.0]), &lamp([0.0, 100.0, 600.0]), RANGE).unwrap();
    for u in 0..FRAME.0 {
        for v in (0..FRAME.1).step_by(8) {
            let (u, v) = (u as f64, v as f64);
            for z in [-59.0, -1.0, 0.0, 33.3] {
                let phase = twins.phase(u, v, z);
                for off in [0.0, 1e-15, -1e-15, 1e-13, UNIT, -UNIT] {
                    assert_eq!(twins.solve(u, v, phase + off), None, "({u}, {v})");
                }
            }
        }
    }
}

#[test]
fn a_baseline_of_almost_nothing_gives_no_heights_or_no_rig() {
    let mut random = Random::new(SEED + 1);
    for length in [0.0, 1e-12, 1e-6, 9e-4, 2e-3, 0.01, 0.1, 1.0, 10.0] {
        for side in [[length, 0.0, 0.0], [0.0, length, 0.0], [0.0, 0.0, length]] {
            let eye = [5.0, 6.0, 600.0];
            let light = [eye[0] + side[0], eye[1] + side[1], eye[2] + side[2]];
            let twins = match Twins::new(&down(eye), &lamp(light), RANGE) {
                Ok(twins) => twins,
                Err(error) => {
                    assert!(length < 1e-3 && error.contains("baseline"), "{error}");
                    continue;
                }
            };
            assert!(length > 1e-3);
            let mut found = 0;
            for _ in 0..200 {
                let place = (
                    between(&mut random, 0.0, 64.0),
                    between(&mut random, 0.0, 64.0),
                );
                found += twins.recovered(&mut random, place);
            }
            println!("a baseline of {side:?}: {found} of 3200 heights");
            if length < 0.05 {
                assert_eq!(found, 0, "{side:?}");
            }
        }
    }
}

#[test]
fn rays_along_the_plane_or_upwards_have_no_height_and_no_reference() {
    let mut random = Random::new(SEED + 2);
    let tilted = looking_down([0.0, 0.0, 300.0], 80.0, FRAME, 0.5);
    let twins = Twins::new(&tilted, &lamp([100.0, 0.0, 700.0]), RANGE).unwrap();
    let camera = twins.solver.camera();
    // Where the frame meets the horizon.
    let falls = |u: f64| camera.ray(u, 32.0).unwrap().z < 0.0;
    let (mut one, mut other) = (0.0, 64.0);
    assert!(falls(one) != falls(other), "the horizon is in the frame");
    for _ in 0..200 {
        let middle = (one + other) / 2.0;
        if falls(middle) == falls(one) {
            one = middle;
        } else {
            other = middle;
        }
    }
    let (mut found, mut without) = (0, 0);
    for (u, v) in about((one, 32.0)).chain((0..65).map(|u| (f64::from(u), 40.0))) {
        let ray = camera.ray(u, v).unwrap();
        if let Some(phase) = twins.solver.reference_phase(u, v) {
            assert!(phase.is_finite() && ray.z < 0.0, "({u}, {v}): {phase}");
        }
        if ray.z < 0.0 {
            found += twins.recovered(&mut random, (u, v));
        } else {
            assert_eq!(twins.solver.reference_phase(u, v), None);
            for phase in [0.0, 1.0, 30.0, -1e3] {
                assert_eq!(twins.solve(u, v, phase), None);
            }
            without += 1;
        }
    }
    println!("{found} heights, {without} rays that do not fall");
    assert!(found > 100 && without > 5);
    for (pixel, phase) in twins.solver.reference_map().iter().enumerate() {
        let (u, v) = (pixel % FRAME.0, pixel / FRAME.0);
        let falls = camera.ray(u as f64, v as f64).unwrap().z < 0.0;
        assert!(falls || !phase.is_known());
        let point = twins.solver.point(u, v, Height::from_mm(1.0));
        assert!(point.is_none_or(|point| point.length().is_finite() && falls));
    }
}

#[test]
fn rays_that_meet_no_light_of_their_phase_have_no_height() {
    let mut random = Random::new(SEED + 3);
    // Both look in the same direction: a ray's phase approaches that of the parallel ray and never
    // reaches it.
    let twins = Twins::new(&down([0.0, 0.0, 600.0]), &lamp([150.0, 0.0, 600.0]), RANGE).unwrap();
    for _ in 0..2000 {
        let (u, v) = (
            between(&mut random, 0.0, 64.0),
            between(&mut random, 0.0, 64.0),
        );
        let parallel = twins.phase(u, v, -1e15);
        for off in [0.0, UNIT, -UNIT, 1e-9, 0.01] {
            assert_eq!(twins.solve(u, v, parallel + off), None, "({u}, {v})");
        }
        let absurd = [
            f64::NAN,
            f64::INFINITY,
            f64::NEG_INFINITY,
            1e300,
            -1e300,
            32_768.0,
        ];
        for phase in absurd {
            assert_eq!(twins.solve(u, v, phase), None, "{phase}");
            assert_eq!(twins.solver.expand(u, v, phase, f64::NAN), None, "{phase}");
            for z in absurd {
                assert_eq!(twins.solver.solve_near(u, v, phase, z), None);
            }
        }
        assert!(twins.recovered(&mut random, (u, v)) > 0);
    }
    let absurd = [
        f64::NAN,
        f64::INFINITY,
        f64::NEG_INFINITY,
        1e308,
        -1e100,
        1e7,
    ];
    for u in absurd {
        for v in absurd {
            for phase in [0.0, 30.0, -1e3] {
                twins.solve(u, v, phase);
                if let Some(phase) = twins.solver.reference_phase(u, v) {
                    assert!(phase.is_finite(), "({u}, {v}): {phase}");
                }
            }
        }
    }
}

#[test]
fn a_guess_of_any_height_leads_to_the_right_one() {
    let mut random = Random::new(SEED + 4);
    let twins = Twins::new(&down([0.0, 0.0, 600.0]), &lamp([150.0, 0.0, 650.0]), RANGE).unwrap();
    let guesses = [
        f64::NAN,
        f64::INFINITY,
        f64::NEG_INFINITY,
        1e300,
        -1e300,
        599.999,
        600.0,
        650.0,
        650.01,
        1e4,
        -1e4,
        61.0,
        0.0,
    ];
    for _ in 0..500 {
        let (u, v) = (
            between(&mut random, 0.0, 64.0),
            between(&mut random, 0.0, 64.0),
        );
        let z = between(&mut random, RANGE.low, RANGE.high);
        let phase = twins.phase(u, v, z);
        for guess in guesses.into_iter().chain([z, z + 1e-3, z - 0.5]) {
            let solution = twins.solver.solve_near(u, v, phase, guess);
            let solution = solution.unwrap_or_else(|| panic!("none from {guess}"));
            // A last secant step of 1e-4 mm means an error below 1e-6.
            assert!(
                (solution.point.z - z).abs() <= 1e-6,
                "{guess}: {solution:?}"
            );
        }
    }
}

#[test]
fn random_rigs_never_give_a_wrong_height() {
    let mut random = Random::new(SEED + 5);
    let (mut rigs, mut refused, mut found, mut asked) = (0, 0, 0, 0);
    for _ in 0..1500 {
        let mut place = |low: f64| {
            [
                between(&mut random, -500.0, 500.0),
                between(&mut random, -500.0, 500.0),
                between(&mut random, low, 1200.0),
            ]
        };
        let (eye, light) = (place(20.0), place(20.0));
        let mut turn = || between(&mut random, -89.0, 89.0);
        let (tilt, lean) = (turn(), turn());
        let camera = looking_down(eye, tilt, FRAME, between(&mut random, 0.01, 1.5));
        let projector = looking_down(light, lean, PROJECTOR, between(&mut random, 0.05, 1.5));
        let low = between(&mut random, -300.0, 50.0);
        let range = HeightRange {
            low,
            high: low + between(&mut random, 0.01, 400.0),
        };
        let Ok(twins) = Twins::new(&camera, &projector, range) else {
            refused += 1;
            continue;
        };
        rigs += 1;
        for _ in 0..10 {
            let at = (
                between(&mut random, 0.0, 64.0),
                between(&mut random, 0.0, 64.0),
            );
            if twins.solver.camera().ray(at.0, at.1).unwrap().z < 0.0 {
                found += twins.recovered(&mut random, at);
                asked += 16;
            }
        }
    }
    println!("{rigs} rigs, {refused} refused, {found} of {asked} heights");
    assert!(found > 20_000 && refused > 50, "{found} {refused}");
}

#[test]
fn ranges_that_are_none_are_refused_and_heights_stay_where_they_can_be_stored() {
    let join = |range| {
        let camera = Pinhole::new(down([0.0, 0.0, 5000.0]), FRAME.0, FRAME.1).unwrap();
        let (columns, rows) = PROJECTOR;
        let projector = Pinhole::new(lamp([900.0, 0.0, 4000.0]), columns, rows).unwrap();
        rig::join(camera, projector, FRINGES, range)
    };
    let nan = f64::NAN;
    for (low, high) in [
        (nan, 1.0),
        (-1.0, nan),
        (nan, nan),
        (f64::NEG_INFINITY, 1.0),
        (-1.0, f64::INFINITY),
        (1.0, 1.0),
        (1.0, -1.0),
        (-1.0, 4000.0),
        (3000.0, 3500.0),
    ] {
        let error = join(Some(HeightRange { low, high })).unwrap_err();
        assert!(
            matches!(error, RigError::Range(_)),
            "{low} to {high}: {error}"
        );
        assert!(error.to_string().contains(&low.to_string()), "{error}");
    }
    // A height beyond ± 2.147 m cannot be stored, so there is no solution.
    for range in [
        Some(HeightRange {
            low: -9000.0,
            high: 3900.0,
        }),
        None,
    ] {
        let range = join(range).unwrap().range();
        for z in [range.low, range.high] {
            assert!(Height::from_mm(z).is_known(), "{z} mm");
        }
    }
}
