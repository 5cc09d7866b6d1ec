//! Triangulation compared with the textbook in rare cases: beyond the projector's raster, near the
//! ends of the working range, and with patterns that give several heights.

use algo::geometry::{HeightRange, Pinhole, Reference, Triangulator};
use appliance::head::seam;
use hal::replay::Recording;
use hal::replay::recording::PatternSpec;
use std::f64::consts::TAU;
use tests::oracle::{Pattern, Rig};
use tests::random::Random;
use tests::render::{Scene, levels};

const SEED: u64 = 7;
const CASES: usize = 4000;
/// The solver stops within 1e-7 mm; the textbook's bisection goes on to the last bit. The rest is
/// rounding of phases.
const HEIGHT_MM: f64 = 2.5e-7;
/// Turns per mm. Slopes are central differences, over ± 10 µm by the solver and over ± 5 µm by the
/// textbook. Where the second derivative jumps by J, as the spline's does at its knots, each is off
/// by at most J/4 times its half step. Here J is up to 2e-3 turn/mm², and 2e-3 / 4 · 10 µm = 5e-6.
const SLOPE: f64 = 5e-6;
/// Both evaluate the same spline or line in f64; phases are up to 100 turns.
const PHASE_TURNS: f64 = 1e-9;

/// The rig with only the middle 40 % of the projector's columns (102 of 256), so the camera sees
/// beyond them. `turns` is the phase function in turns over (ξ, η) as shares of the narrow raster's
/// width and height.
fn narrow(turns: impl Fn(f64, f64) -> f64) -> Recording {
    let (columns, rows) = (102_usize, 192_usize);
    let scene = Scene {
        size: 32,
        ..Scene::new(10.0, levels(&[0.09, 1.0], 3))
    };
    let mut recording = scene.record();
    recording.projector.width = columns as u32;
    // Columns that are cut off on the left.
    recording.projector.model.as_mut().unwrap().cx -= 77.0;
    let place = |at: usize| ((at % columns) as f64, (at / columns) as f64);
    let samples = (0..rows * columns).map(|at| {
        let (xi, eta) = place(at);
        turns(xi / columns as f64, eta / rows as f64)
    });
    recording.patterns = vec![PatternSpec::File {
        rows,
        columns,
        turns: samples.collect(),
    }];
    recording
}

fn triangulator(recording: &Recording) -> Triangulator {
    let (width, height) = (recording.width as usize, recording.height as usize);
    let projector = &recording.projector;
    let (columns, rows) = (projector.width as usize, projector.height as usize);
    let device = |model: &Option<_>, width, height| {
        Pinhole::new(seam::pinhole_model(model.as_ref().unwrap()), width, height).unwrap()
    };
    Triangulator::new(
        device(&recording.camera_model, width, height),
        device(&projector.model, columns, rows),
        Reference::Models,
        seam::phase_function(&recording.patterns[0], columns, rows).unwrap(),
        recording
            .range_mm
            .map(|[low, high]| HeightRange { low, high }),
    )
    .unwrap()
}

/// Solves random pixels with phases up to `spread` turns off the reference phase both ways; returns
/// how many had a height and how many had none.
fn compare(recording: &Recording, spread: f64) -> (usize, usize) {
    let (solver, rig) = (triangulator(recording), Rig::of(recording).unwrap());
    let pattern = Pattern::of(recording, 0);
    let mut random = Random::new(SEED);
    let (mut with, mut without) = (0, 0);
    for _ in 0..CASES {
        let (u, v) = (32.0 * random.share(), 32.0 * random.share());
        let phase = rig.reference(&pattern, u, v) + spread * (2.0 * random.share() - 1.0);
        match (solver.solve(u, v, phase), rig.height(&pattern, u, v, phase)) {
            (None, None) => without += 1,
            (Some(found), Some((z, slope))) => {
                assert!((found.point.z - z).abs() <= HEIGHT_MM, "({u}, {v}) {phase}");
                let off = (found.slope - slope).abs();
                assert!(off <= SLOPE, "({u}, {v}): {off}");
                with += 1;
            }
            (found, truth) => panic!("({u}, {v}) {phase}: {found:?} and {truth:?}"),
        }
    }
    (with, without)
}

#[test]
fn heights_beyond_the_raster_and_about_the_ends_of_the_range_are_the_textbooks() {
    let recording = narrow(|xi, eta| 20.0 * xi + 3.0 * xi * xi + 0.5 * eta);
    let (with, without) = compare(&recording, 12.0);
    assert!(with > CASES / 4 && without > CASES / 4, "{with} {without}");
}

#[test]
fn a_phase_of_several_heights_has_none() {
    let recording = narrow(|xi, _| 20.0 * xi + 4.0 * (TAU * 3.0 * xi).sin());
    let (with, without) = compare(&recording, 4.0);
    assert!(with > CASES / 4 && without > CASES / 4, "{with} {without}");
}

#[test]
fn the_reference_phase_is_the_textbooks_also_beyond_the_frame() {
    let recording = narrow(|xi, eta| 20.0 * xi + 4.0 * (TAU * xi).sin() + eta * eta);
    let (solver, rig) = (triangulator(&recording), Rig::of(&recording).unwrap());
    let pattern = Pattern::of(&recording, 0);
    let mut random = Random::new(SEED);
    for _ in 0..CASES {
        // Up to a sixth of the frame beyond each side.
        let mut place = || -5.0 + 42.0 * random.share();
        let (u, v) = (place(), place());
        let found = solver.reference_phase(u, v).unwrap();
        let truth = rig.reference(&pattern, u, v);
        assert!((found - truth).abs() < PHASE_TURNS, "({u}, {v})");
    }
    for (pixel, phase) in solver.reference_map().iter().enumerate() {
        let truth = rig.reference(&pattern, (pixel % 32) as f64, (pixel / 32) as f64);
        // Half a unit of Q16.16.
        assert!((phase.turns() - truth).abs() <= 0.51 / 65_536.0, "{pixel}");
    }
}

#[test]
fn the_default_working_range_is_a_fifth_of_the_cameras_distance_to_either_side() {
    let mut recording = narrow(|xi, _| 20.0 * xi);
    recording.range_mm = None;
    let (solver, rig) = (triangulator(&recording), Rig::of(&recording).unwrap());
    assert!((solver.range().low - rig.range.0).abs() < 1e-9);
    assert!((solver.range().high - rig.range.1).abs() < 1e-9);
    assert!((rig.range.1 - 120.0).abs() < 1e-9);
}
