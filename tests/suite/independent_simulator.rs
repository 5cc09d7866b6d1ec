//! The simulator compared with an independent one: the recordings of the study are rendered again.

use hal::frame::Samples;
use hal::projector::Raster;
use hal::replay::Recording;
use hal::replay::recording::{PatternSpec, RecordedFrame};
use sim::parts::{Cone, Sphere};
use sim::{Part, Scenario, head};
use std::time::Duration;
use tests::shared;

/// Largest difference of true heights, RMS mm; it is far below the noise of a measurement.
const HEIGHT_RMS_MM: f64 = 0.01;
/// Smallest share of pixels with the same class 2: the two programs find silhouettes and depth
/// edges differently.
const CLASS_AGREEMENT: f64 = 0.995;
/// Frames without noise differ from the recorded ones by the noise: uniform ±6.375 counts and
/// rounding twice have σ 3.69; the rest is margin for the depth edges.
const FRAME_RMS_COUNTS: std::ops::Range<f64> = 3.5..3.85;
/// The study interpolated its rasters bilinearly. That spreads a pixel's light by a triangle of
/// variance 1/6, as a square (variance 1/12) does through a lens of this σ.
const TRIANGLE_PX: f64 = 0.288_675;

/// grey = 255/2 · (1 + sin 2π(ratio · Φ_P(ξ, η) + shift)), rounded: the format's definition.
fn raster(recording: &Recording, frame: &RecordedFrame) -> Raster {
    let (width, height) = (recording.projector.width, recording.projector.height);
    let mut pixels = Vec::new();
    for eta in 0..height {
        for xi in 0..width {
            let phase = match &recording.patterns[frame.pattern] {
                PatternSpec::Vertical { fringes } => fringes * f64::from(xi) / f64::from(width),
                PatternSpec::Horizontal { fringes } => fringes * f64::from(eta) / f64::from(height),
                PatternSpec::File { columns, turns, .. } => {
                    turns[eta as usize * columns + xi as usize]
                }
            };
            let sine = (std::f64::consts::TAU * (frame.ratio * phase + frame.shift_turns)).sin();
            pixels.push((255.0 / 2.0 * (1.0 + sine)).round() as u8);
        }
    }
    Raster::new(width, height, pixels).unwrap()
}

fn compare(name: &str, part: Part) {
    let Some((_, recording)) = shared::recording(name) else {
        return;
    };
    let mut scenario = Scenario {
        part,
        ..Scenario::default()
    };
    scenario.rig.camera.width = recording.width;
    scenario.rig.camera.height = recording.height;
    scenario.noise.noise_counts = Some(0.0);
    scenario.optics.projector_blur_px = TRIANGLE_PX;
    let (mut head, stage) = head(&scenario).unwrap();

    for (ours, theirs) in [
        (
            stage.scenario().rig.camera.model(),
            recording.camera_model.clone().unwrap(),
        ),
        (
            stage.scenario().rig.projector.model(),
            recording.projector.model.clone().unwrap(),
        ),
    ] {
        assert!((ours.fx - theirs.fx).abs() + (ours.fy - theirs.fy).abs() < 1e-9);
        assert!(
            ours.rotation
                .iter()
                .zip(theirs.rotation)
                .all(|(a, b)| (a - b).abs() < 1e-12)
        );
    }

    let ours = stage.truth();
    let theirs_class = recording.truth_class.as_ref().unwrap();
    let theirs_height = recording.truth_height.as_ref().unwrap();
    let mut table = [[0_usize; 3]; 3];
    let (mut squares, mut both) = (0.0, 0.0);
    for at in 0..ours.class.len() {
        table[usize::from(ours.class[at])][usize::from(theirs_class[at])] += 1;
        if ours.class[at] == 2 && theirs_class[at] == 2 {
            squares += f64::from(ours.height[at] - theirs_height[at]).powi(2);
            both += 1.0;
        }
    }
    let height_rms = (squares / both).sqrt();
    let unlike = table[2][0] + table[2][1] + table[0][2] + table[1][2];
    let agreement = 1.0 - unlike as f64 / ours.class.len() as f64;

    head.load(
        recording
            .frames
            .iter()
            .map(|frame| raster(&recording, frame))
            .collect(),
    )
    .unwrap();
    let indices: Vec<usize> = (0..recording.frames.len()).collect();
    let (mut squares, mut count) = (0.0, 0.0);
    head.acquire(&indices, Duration::from_secs(1), &mut |index, frame| {
        let (Samples::Eight(ours), Samples::Eight(theirs)) =
            (frame.samples(), recording.frames[index].frame.samples())
        else {
            panic!("not 8 bit");
        };
        for (at, (a, b)) in ours.iter().zip(theirs).enumerate() {
            // In dark pixels the noise is clipped.
            if theirs_class[at] == 2 && *a > 8 && *a < 247 {
                squares += (f64::from(*a) - f64::from(*b)).powi(2);
                count += 1.0;
            }
        }
    })
    .unwrap();
    let frame_rms = (squares / count).sqrt();
    println!(
        "{name}: height RMS {height_rms:.5} mm, class 2 agrees {:.3} %, frames differ by {frame_rms:.3}, {table:?}",
        agreement * 100.0
    );
    assert!(
        height_rms < HEIGHT_RMS_MM,
        "{name}: height RMS {height_rms}"
    );
    assert!(
        agreement > CLASS_AGREEMENT,
        "{name}: class 2 agreement {agreement}, {table:?}"
    );
    assert!(
        FRAME_RMS_COUNTS.contains(&frame_rms),
        "{name}: frames differ by {frame_rms}"
    );
}

#[test]
fn the_sphere_is_rendered_as_the_independent_simulator_did() {
    compare("study-sphere-fixed81", Part::Sphere(Sphere::default()));
}

#[test]
fn the_cone_is_rendered_as_the_independent_simulator_did() {
    compare("study-cone-adaptive", Part::Cone(Cone::default()));
}

#[test]
fn the_spline_is_rendered_as_the_independent_simulator_did() {
    compare("study-spline-dense121", Part::Spline(Box::default()));
}
