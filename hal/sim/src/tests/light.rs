//! Light and noise: brightness, darkness, gain, response, blur, and the statistics of the noise.

use super::{PATIENT, counts, frames, small};
use crate::optics::normalised;
use crate::parts::Plane;
use crate::{Part, Scenario, head};
use hal::head::{Head, Showing};
use hal::projector::Raster;

#[test]
fn a_lit_plane_is_as_bright_as_its_angle_to_the_projector_says() {
    let mut scenario = small(Part::Plane(Plane::default()));
    scenario.noise.noise_counts = 0.0;
    let (mut head, stage) = head(&scenario).unwrap();
    let frames = frames(&mut head, &[0, 128, 255]);
    assert!(stage.truth().class.iter().all(|class| *class == 2));
    let middle = 24 * 64 + 32;
    let towards = normalised([
        600.0 * (-7.0_f64).to_radians().sin(),
        0.0,
        600.0 * 7.0_f64.to_radians().cos(),
    ]);
    for (frame, grey) in frames.iter().zip([0.0, 128.0, 255.0]) {
        let expected = 255.0 * (0.04 + 0.86 * towards[2] * grey / 255.0);
        let found = counts(frame)[middle];
        assert!(
            (found - expected).abs() <= 1.0,
            "{found} instead of {expected}"
        );
    }
}

#[test]
fn a_long_pulse_makes_a_frame_brighter_and_is_told() {
    let mut scenario = small(Part::Plane(Plane::default()));
    scenario.noise.noise_counts = 0.0;
    (scenario.faults.long_pulse, scenario.faults.long_pulse_us) = (0.5, 20_000);
    let (mut head, _) = head(&scenario).unwrap();
    let (width, height) = head.projector_size();
    head.load(vec![Raster::uniform(width, height, 100).unwrap()])
        .unwrap();
    let showing = Showing {
        index: 0,
        refreshes: 100,
        settle: 0,
    };
    let middle = 24 * 64 + 32;
    let seen = head
        .watch(&[showing], PATIENT, &mut |frame| counts(frame)[middle])
        .unwrap();
    let (mut good, mut spoiled) = (0, 0);
    let planned = 255.0 * (0.04 + 0.86 * 7.0_f64.to_radians().cos() * 100.0 / 255.0);
    for frame in &seen.frames {
        let pulse = seen.spoiled.iter().find(|pulse| pulse.fired == frame.start);
        let longer = pulse.map_or(0.0, |pulse| {
            pulse.longer.as_secs_f64() / pulse.width.as_secs_f64()
        });
        let expected = planned * (1.0 + longer);
        // Rounding, and pulses that are off by too little to be reported.
        assert!(
            (frame.measured - expected).abs() <= 1.0 + 0.005 * planned,
            "{} instead of {expected}",
            frame.measured
        );
        (good, spoiled) = match pulse {
            Some(_) => (good, spoiled + 1),
            None => (good + 1, spoiled),
        };
    }
    assert!(good > 5 && spoiled > 5, "{good} and {spoiled} spoiled");
}

#[test]
fn an_empty_stage_is_dark_and_its_truth_is_unseen() {
    let mut scenario = small(Part::Empty {});
    scenario.noise.noise_counts = 0.0;
    let (mut head, stage) = head(&scenario).unwrap();
    assert!(
        frames(&mut head, &[255])
            .iter()
            .flat_map(counts)
            .all(|count| count == 0.0)
    );
    let truth = stage.truth();
    assert!(truth.class.iter().all(|c| *c == 0) && truth.height.iter().all(|z| z.is_nan()));
}

#[test]
fn gain_response_and_blur_do_what_they_say() {
    let mut scenario = small(Part::Plane(Plane::default()));
    scenario.noise.noise_counts = 0.0;
    scenario.optics.gain = 2.0;
    let middle = 24 * 64 + 32;
    assert_eq!(
        counts(&frames(&mut head(&scenario).unwrap().0, &[255])[0])[middle],
        255.0
    );
    scenario.optics.gain = 1.0;
    scenario.optics.gamma = 2.0;
    let two = frames(&mut head(&scenario).unwrap().0, &[128, 0]);
    let share = (counts(&two[0])[middle] - counts(&two[1])[middle])
        / (255.0 * 0.86 * 7.0_f64.to_radians().cos());
    assert!(
        (share - (128.0_f64 / 255.0).powi(2)).abs() < 0.006,
        "{share}"
    );

    // Stripes of 4 + 4 projector pixels lose contrast with blur on either side.
    let contrast = |projector_blur_px: f64, camera_blur_px: f64| {
        let mut scenario = Scenario {
            part: Part::Plane(Plane::default()),
            ..small(Part::default())
        };
        (scenario.rig.camera.width, scenario.rig.camera.height) = (512, 8);
        scenario.rig.camera.fov_deg = [20.0, 0.3125_f64.max(1.0)];
        scenario.noise.noise_counts = 0.0;
        scenario.optics.projector_blur_px = projector_blur_px;
        scenario.optics.camera_blur_px = camera_blur_px;
        let (mut head, _) = head(&scenario).unwrap();
        let (width, height) = head.projector_size();
        let stripes = (0..width * height).map(|i| {
            if (i % width / 4).is_multiple_of(2) {
                255
            } else {
                0
            }
        });
        head.load(vec![Raster::new(width, height, stripes.collect()).unwrap()])
            .unwrap();
        let mut spread = 0.0;
        head.acquire(&[0], PATIENT, &mut |_, frame| {
            let counts = counts(&frame);
            let row = &counts[4 * 512..5 * 512];
            spread =
                row.iter().copied().fold(0.0, f64::max) - row.iter().copied().fold(255.0, f64::min);
        })
        .unwrap();
        spread
    };
    let sharp = contrast(0.0, 0.0);
    assert!(contrast(1.6, 0.0) < 0.8 * sharp);
    assert!(contrast(0.0, 1.6) < 0.8 * sharp);
}

#[test]
fn noise_is_uniform_independent_between_frames_and_the_same_again_from_the_same_seed() {
    let scenario = small(Part::Plane(Plane::default()));
    let (mut head, stage) = head(&scenario).unwrap();
    let first: Vec<_> = frames(&mut head, &[128; 40]).iter().map(counts).collect();
    let pixels = first[0].len();
    let (mut squares, mut products) = (0.0, 0.0);
    for pixel in 0..pixels {
        let values: Vec<f64> = first.iter().map(|frame| frame[pixel]).collect();
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        assert!(values.iter().all(|v| (v - mean).abs() < 2.0 * 6.375 + 1.0));
        squares += values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / 39.0;
        products += values
            .windows(2)
            .map(|w| (w[0] - mean) * (w[1] - mean))
            .sum::<f64>()
            / 39.0;
    }
    let sigma = (squares / pixels as f64).sqrt();
    assert!(
        (sigma - scenario.noise_sigma_counts()).abs() < 0.02,
        "{sigma}"
    );
    let correlation = products / squares;
    assert!((correlation + 1.0 / 40.0).abs() < 0.02, "{correlation}");

    stage.reseed(scenario.noise.seed);
    let again: Vec<_> = frames(&mut head, &[128; 40]).iter().map(counts).collect();
    assert!(first == again);
    stage.reseed(2);
    let other: Vec<_> = frames(&mut head, &[128; 40]).iter().map(counts).collect();
    assert!(first != other);
}

#[test]
fn gain_and_exposure_make_frames_brighter_until_they_are_set_again() {
    let mut scenario = small(Part::Plane(Plane::default()));
    scenario.noise.noise_counts = 0.0;
    scenario.light.ambient = 0.0;
    let (mut head, stage) = head(&scenario).unwrap();
    let middle = 24 * 64 + 32;
    let light = |head: &mut Head| counts(&frames(head, &[40])[0])[middle];
    let plain = light(&mut head);
    let (exposure, gain) = stage.exposing();
    assert_eq!((exposure, gain), (scenario.refresh() * 2, 1.0));
    stage.expose(exposure, 3.0).unwrap();
    assert!((light(&mut head) - 3.0 * plain).abs() <= 2.0);
    stage.expose(exposure * 2, 1.0).unwrap();
    assert_eq!(head.camera_timing().exposure, exposure * 2);
    assert!((light(&mut head) - 2.0 * plain).abs() <= 2.0);
    assert!(stage.expose(exposure, 101.0).is_err());
    stage.expose(exposure, 1.0).unwrap();
    assert!((light(&mut head) - plain).abs() <= 1.0);
}
