//! Alignment on a made surface that is moved exactly.

use super::plan::{MOST_LIFT_MM, POINTS};
use super::*;
use crate::geometry::{Pinhole, PinholeModel, Reference, Triangulator, Vector};
use crate::inspect::{Taught, Weight, normal_shares};
use crate::pattern::PhaseFunction;
use crate::pipeline::KnownSurface;
use crate::units::{AbsolutePhase, Height};
use std::vec;
use std::vec::Vec;

const SIDE: usize = 200;
const SIGMA_MM: f64 = 0.03;
/// Bilinear interpolation between pixels 0.8 mm apart misses a curvature of 0.05 / mm by 4 µm.
const EXACT_MM: f64 = 5e-3;

fn device(angle: f64, size: usize) -> Pinhole {
    let (sin, cos) = (libm::sin(angle), libm::cos(angle));
    let focal = size as f64 / 0.27;
    let model = PinholeModel {
        fx: focal,
        fy: focal,
        cx: (size - 1) as f64 / 2.0,
        cy: (size - 1) as f64 / 2.0,
        distortion: [-0.12, 0.15, 2e-4, -3e-4, 0.0],
        rotation: [cos, 0.0, -sin, 0.0, -1.0, 0.0, -sin, 0.0, -cos],
        translation: [0.0, 0.0, 600.0],
    };
    Pinhole::new(model, size, size).unwrap()
}

struct Made {
    triangulator: Triangulator,
    surface: KnownSurface,
    taught: Taught,
}

/// A surface z = f(x, y) as the camera sees it.
fn made(f: impl Fn(f64, f64) -> f64) -> Made {
    let function = PhaseFunction::vertical(1024, 768, 100.0).unwrap();
    let devices = (device(0.35, SIDE), device(-0.12, 768));
    let triangulator =
        Triangulator::new(devices.0, devices.1, Reference::Models, function, None).unwrap();
    let height = (0..SIDE * SIDE).map(|at| {
        let mut z = 0.0;
        for _ in 0..40 {
            let point = triangulator
                .point(at % SIDE, at / SIDE, Height::from_mm(z))
                .unwrap();
            z = f(point.x, point.y);
        }
        Height::from_mm(z)
    });
    let surface = KnownSurface {
        width: SIDE,
        phase: vec![AbsolutePhase::from_bits(0); SIDE * SIDE],
        height: height.collect(),
    };
    let taught = Taught::new((0..SIDE * SIDE).map(|_| (Weight::FULL, 1.0, SIGMA_MM)));
    Made {
        triangulator,
        surface,
        taught,
    }
}

impl Made {
    fn golden(&self) -> GoldenSurface<'_> {
        GoldenSurface {
            triangulator: &self.triangulator,
            surface: &self.surface,
            taught: &self.taught,
        }
    }

    fn alignment(&self) -> Alignment {
        let window = vec![0..SIDE; SIDE];
        Alignment::new(self.golden(), &window).unwrap()
    }

    /// Points of the surface, moved.
    fn moved(&self, motion: &Motion) -> Vec<HeightSample> {
        let places = (20..SIDE - 20).step_by(4);
        let places = places.flat_map(|v| (20..SIDE - 20).step_by(4).map(move |u| (u, v)));
        places
            .map(|(u, v)| {
                let height = self.surface.height[v * SIDE + u];
                let point = self.triangulator.point(u, v, height).unwrap();
                HeightSample {
                    point: motion.apply(point),
                    sigma: SIGMA_MM,
                    over: None,
                }
            })
            .collect()
    }
}

/// Hills whose slopes reach 0.3 in both directions.
fn hills(x: f64, y: f64) -> f64 {
    8.0 + 1.7 * libm::sin(x / 6.0) + 1.7 * libm::cos(y / 7.0) + 0.02 * x
}

fn motion(alignment: &Alignment) -> Motion {
    let turn = Vector::new(0.4, -0.5, 0.3) * 1_f64.to_radians();
    Motion::new(alignment.centre, Vector::new(0.8, -0.6, 0.9), turn)
}

fn assert_found(found: &Placed, expected: &Motion) {
    for (i, (a, b)) in found
        .motion
        .values()
        .iter()
        .zip(expected.values())
        .enumerate()
    {
        // Turns as the way at the radius.
        let way = if i < 3 { 1.0 } else { found.radius };
        assert!((a - b).abs() * way < EXACT_MM, "component {i}: {a} {b}");
    }
}

#[test]
fn a_motion_of_a_shape_that_determines_it_is_found_in_all_six_components() {
    let made = made(hills);
    let alignment = made.alignment();
    assert_eq!(alignment.left_out, [false; 6]);
    let motion = motion(&alignment);
    let found = alignment
        .fitting(made.golden())
        .fit(None, &made.moved(&motion), &mut Equations::default())
        .unwrap();
    assert_found(&found, &motion);
    assert!(found.outliers < 0.01, "{found:?}");
    // A corner 100 mm off goes further than the centre's 1.3 mm.
    assert!(found.reach > 1.3 && found.reach < 3.5, "{}", found.reach);
}

#[test]
fn a_dent_over_a_tenth_of_the_part_does_not_pull_it() {
    let made = made(hills);
    let alignment = made.alignment();
    let motion = motion(&alignment);
    let mut samples = made.moved(&motion);
    let dented = samples.len() / 10;
    for sample in &mut samples[..dented] {
        sample.point.z -= 1.0;
    }
    let found = alignment
        .fitting(made.golden())
        .fit(None, &samples, &mut Equations::default())
        .unwrap();
    assert_found(&found, &motion);
    assert!((found.outliers - 0.1).abs() < 0.02, "{}", found.outliers);
}

#[test]
fn directions_that_a_shape_does_not_determine_are_left_out_and_stay_nought() {
    let plate = made(|_, _| 8.0);
    let alignment = plate.alignment();
    assert_eq!(alignment.left_out, [true, true, false, false, false, true]);
    let found = alignment
        .fitting(plate.golden())
        .fit(
            None,
            &plate.moved(&motion(&alignment)),
            &mut Equations::default(),
        )
        .unwrap();
    let values = found.motion.values();
    assert!(
        values[0].abs() + values[1].abs() + values[5].abs() < 1e-3,
        "{values:?}"
    );
    assert!((values[2] - 0.9).abs() < 0.02, "{values:?}");
    assert!(found.component(0).is_none() && found.component(2).is_some());
    // Straight grooves determine one shift more, and the turn.
    let grooves = made(|x, _| 8.0 + 1.7 * libm::sin(x / 6.0));
    assert_eq!(
        grooves.alignment().left_out,
        [false, true, false, false, false, false]
    );
}

#[test]
fn what_is_not_there_has_no_place() {
    let made = made(hills);
    let alignment = made.alignment();
    assert!(
        alignment
            .fitting(made.golden())
            .fit(None, &[], &mut Equations::default())
            .is_none()
    );
    let away = Motion::new(
        alignment.centre,
        Vector::new(500.0, 0.0, 0.0),
        Vector::default(),
    );
    let samples = made.moved(&away);
    assert!(
        alignment
            .fitting(made.golden())
            .fit(None, &samples, &mut Equations::default())
            .is_none()
    );
}

/// How far an error of the motion lifts the worst spot, mm (1 σ).
fn worst_lift(alignment: &Alignment, golden: GoldenSurface<'_>) -> f64 {
    let placed = alignment.still(golden).unwrap();
    let fitting = alignment.fitting(golden);
    let lift = |spot: &Spot| fitting.lift_variance(&placed, &spot.facet, spot.point);
    libm::sqrt(alignment.spots.iter().map(lift).fold(0.0, f64::max))
}

#[test]
fn a_wall_at_a_grazing_angle_is_not_lifted_by_the_noise_of_the_motion() {
    let window = vec![0..SIDE; SIDE];
    let even = made(hills);
    let (few, _) = Alignment::of_points(POINTS, even.golden(), &window).unwrap();
    assert_eq!(even.alignment(), few);
    // The camera looks along a slope of 2.7.
    let mut steep = made(|x, y| hills(x, y) + 2.4 * (x - 40.0).max(0.0));
    steep.taught = Taught::new((0..SIDE * SIDE).map(|_| (Weight::FULL, 1.0, 4.0 * SIGMA_MM)));
    let golden = steep.golden();
    let (few, _) = Alignment::of_points(POINTS, golden, &window).unwrap();
    let (before, after) = (
        worst_lift(&few, golden),
        worst_lift(&steep.alignment(), golden),
    );
    assert!(before > MOST_LIFT_MM, "{before}");
    assert!(after < before / 1.7, "{before} {after}");
}

#[test]
fn the_share_along_the_normal_of_a_plane_is_that_of_its_tilt_and_of_the_ray() {
    for (along, down) in [(0.0, 0.0), (1.2, 0.0), (-1.5, 0.4), (0.0, 1.0)] {
        let plane = made(|x, y| along * x + down * y);
        let normal = Vector::new(-along, -down, 1.0);
        let normal = normal * (1.0 / normal.length());
        let shares = normal_shares(&plane.triangulator, &plane.surface);
        // Where the plane is in the working range.
        for (u, v) in [(70, 70), (100, 100), (130, 110)] {
            let place = v * SIDE + u;
            let height = plane.surface.height[place];
            let point = plane.triangulator.point(u, v, height).unwrap();
            let ray = point - plane.triangulator.camera().centre();
            let exact = libm::fabs(normal.dot(ray) / ray.z);
            let found = f64::from(shares[place]);
            assert!(
                (found - exact).abs() < 1e-3,
                "{along} {down}: {found} {exact}"
            );
            let seen = plane.triangulator.camera().project(point).unwrap();
            let facet = plane.golden().facet(point, seen).unwrap();
            assert!((facet.normal_share() - exact).abs() < 1e-3);
        }
    }
}

/// How a quiet part lies that was taught, and the picture of it with this modulation.
fn still(f: impl Fn(f64, f64) -> f64, modulation: impl Fn(usize, usize) -> f32) -> Still {
    let mut made = made(f);
    let part = made.surface.height.iter().map(|z| z.mm() > FLOOR_MM);
    made.taught = Taught::new(part.map(|part| (Weight::from(part), 1.0, 1e-4)));
    let alignment = made.alignment();
    let modulation: Vec<f32> = (0..SIDE * SIDE)
        .map(|at| modulation(at % SIDE, at / SIDE))
        .collect();
    let Made {
        triangulator,
        surface,
        ..
    } = &made;
    let picture = Picture::new(triangulator, surface, &modulation, alignment.centre, 4.0);
    let placed = alignment.still(made.golden()).unwrap();
    Still {
        steerable: picture.map_or(0, |picture| picture.steerable(triangulator, &placed).len()),
        placed,
    }
}

struct Still {
    placed: Placed,
    /// How many of the directions that heights leave free the picture's edges determine.
    steerable: usize,
}

/// What lies deeper is no part.
const FLOOR_MM: f64 = -69.0;
/// The rows in which the tube is seen.
const PART: core::ops::Range<usize> = 9..SIDE - 9;

/// A tube along the rows, whose flanks are seen at grazing angles.
fn tube(_: f64, y: f64) -> f64 {
    libm::sqrt(84.0 * 84.0 - (y * y).min(83.0 * 83.0)) - 84.0
}

#[test]
fn the_facets_of_a_quiet_body_of_revolution_do_not_determine_its_turns() {
    let dark = |_, _| 50.0;
    let tube = still(tube, dark).placed;
    // Along and about its axis.
    assert_eq!(tube.free.len(), 2, "{tube:?}");
    let sphere = |x: f64, y: f64| libm::sqrt((28_900.0 - x * x - y * y).max(1e4)) - 170.0;
    assert_eq!(still(sphere, dark).placed.free.len(), 3);
    assert_eq!(still(hills, dark).placed.free.len(), 0);
}

#[test]
fn the_outline_of_a_tube_does_not_show_its_turn_and_a_stripe_does() {
    let outline = |_: usize, v: usize| if PART.contains(&v) { 90.0 } else { 5.0 };
    assert_eq!(still(tube, outline).steerable, 0);
    let stripe = |u, v| {
        if (98..104).contains(&v) {
            5.0
        } else {
            outline(u, v)
        }
    };
    assert_eq!(still(tube, stripe).steerable, 1);
}
