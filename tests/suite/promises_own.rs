//! What a measurement promises, tested on rendered recordings with exact truth.

use crate::cases;
use crate::measured::Measured;
use tests::render::{Scene, levels};
use tests::score::{rms, score};

/// Error over predicted σ_z is 1 if the prediction is right; over some 7,000 pixels its RMS
/// scatters by 1/√(2·7000) = 0.8 %. 10 % below and 20 % above leave room for the noise being
/// uniform and rounded, and for B itself being measured.
const NORMAL: std::ops::RangeInclusive<f64> = 0.9..=1.2;

fn frames() -> Vec<(f64, f64)> {
    levels(&[0.0116, 0.108, 1.0], 4)
}

#[test]
fn the_error_is_what_sigma_predicts_in_every_form_that_gives_heights() {
    for (name, recording) in cases::all() {
        let measured = Measured::new(recording);
        let Ok(surface) = &measured.result.heights else {
            continue;
        };
        let truth = measured.recording.truth_height.as_deref().unwrap();
        let class = measured.recording.truth_class.as_deref().unwrap();
        let errors: Vec<f64> = measured
            .heights()
            .iter()
            .enumerate()
            .filter(|(pixel, z)| class[*pixel] == 2 && !z.is_nan())
            .map(|(pixel, z)| f64::from(z - truth[pixel]) / f64::from(surface.map.sigma[pixel]))
            // A recording without redundancy has no σ.
            .filter(|error| !error.is_nan())
            .collect();
        if measured.result.report.noise_counts.is_none() {
            assert!(errors.is_empty() && measured.result.report.no_sigma.is_some());
            continue;
        }
        let normal = rms(&errors);
        println!("{name}: error / sigma {normal:.3} over {} px", errors.len());
        assert!(NORMAL.contains(&normal), "{name}: {normal}");
    }
}

#[test]
fn the_noise_of_a_sample_is_found_from_the_frames_alone() {
    let measured = Measured::new(Scene::new(81.0, frames()).record());
    let noise = measured.result.report.noise_counts.unwrap();
    // Uniform ± 2.5 % of 255, and its rounding to whole counts.
    let truth = ((2.0 * 0.025 * 255.0_f64).powi(2) / 12.0 + 1.0 / 12.0).sqrt();
    // 7,700 px × 3 levels of one degree of freedom: the estimate scatters by 0.5 %.
    assert!((noise / truth - 1.0).abs() < 0.02, "{noise} for {truth}");
}

#[test]
fn the_report_scores_as_the_definition_says() {
    let measured = Measured::new(Scene::new(81.0, frames()).record());
    let truth = measured.recording.truth_height.as_deref().unwrap();
    let class = measured.recording.truth_class.as_deref().unwrap();
    let ours = score(&measured.heights(), truth, class);
    let theirs = measured.result.report.score.as_ref().unwrap();
    assert_eq!((ours.scored, ours.gross), (theirs.scored, theirs.gross));
    for (ours, theirs) in [
        (ours.rms_mm, theirs.rms_mm),
        (ours.bias_mm, theirs.bias_mm),
        (ours.median_mm, theirs.median_mm),
        (ours.p99_mm, theirs.p99_mm),
    ] {
        // Heights of ± 20 mm as f32 are exact to 1e-6 mm.
        assert!((ours - theirs).abs() < 2e-6, "{ours} {theirs}");
    }
    assert_eq!(ours.gross, 0);
    // Every class-2 pixel is well lit, so all are resolved.
    let whole = class.iter().filter(|class| **class == 2).count();
    assert_eq!(ours.scored, whole);
}

#[test]
fn without_noise_the_height_is_the_truth() {
    let scene = Scene {
        noise: 0.0,
        bit_depth: 16,
        patches: false,
        ..Scene::new(81.0, frames())
    };
    let measured = Measured::new(scene.record());
    let truth = measured.recording.truth_height.as_deref().unwrap();
    let heights = measured.heights();
    let errors: Vec<f64> = (0..heights.len())
        .map(|pixel| f64::from(heights[pixel] - truth[pixel]))
        .collect();
    // The 16-bit angle: 4.4e-6 turn RMS at 0.09 turn/mm and less is 5e-5 mm.
    assert!(rms(&errors) < 1e-4, "{}", rms(&errors));
}

#[test]
fn every_spoilt_patch_is_rejected_for_its_own_reason() {
    let measured = Measured::new(Scene::new(81.0, frames()).record());
    let trust = &measured.result.phases[0].trust;
    let at = |u: usize, v: usize| trust[v * 96 + u].word();
    assert_eq!(at(10, 10), "dark");
    assert_eq!(at(10, 82), "low_modulation");
    let bright = (5..18)
        .flat_map(|v| (78..90).map(move |u| (u, v)))
        .filter(|&(u, v)| at(u, v) == "saturated")
        .count();
    // A sine that leaves the range at its top is caught where two of a level's four samples do.
    assert!(bright > 40, "{bright}");
    assert_eq!(at(48, 48), "resolved");
}
