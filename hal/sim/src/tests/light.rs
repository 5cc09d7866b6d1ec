//! Light and noise: brightness, darkness, gain, response, blur, and the statistics of the noise.

use super::{PATIENT, counts, frames, small};
use crate::optics::normalised;
use crate::parts::{Plane, SheetMetal};
use crate::scenario::Noise;
use crate::{Part, Placement, Scenario, Unsteady, head};
use hal::frame::Frame;
use hal::head::{Head, Showing};
use hal::projector::Raster;
use std::f64::consts::TAU;

#[test]
fn a_lit_plane_is_as_bright_as_its_angle_to_the_projector_says() {
    let mut scenario = small(Part::Plane(Plane::default()));
    scenario.noise.noise_counts = Some(0.0);
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
    scenario.noise.noise_counts = Some(0.0);
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
    scenario.noise.noise_counts = Some(0.0);
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
    scenario.noise.noise_counts = Some(0.0);
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
        scenario.noise.noise_counts = Some(0.0);
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
            // Without the ends of the row, where a blur repeats the last pixel.
            let row = &counts[4 * 512 + 16..5 * 512 - 16];
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
fn a_sensors_noise_grows_with_the_light_as_its_electrons_say_and_its_pixels_differ_as_stated() {
    const FRAMES: usize = 40;
    let mut scenario = small(Part::Plane(Plane::default()));
    (scenario.bit_depth, scenario.noise.prnu) = (12, 0.01);
    for gain in [1.0, 2.0] {
        scenario.optics.gain = gain;
        let (mut head, _) = head(&scenario).unwrap();
        let per_electron = gain * 4095.0 / scenario.noise.full_well_e;
        for grey in [0, 60, 110] {
            let shown = frames(&mut head, &[grey; FRAMES]);
            let shown: Vec<_> = shown.iter().map(counts).collect();
            let (mut variances, mut spread, mut sum) = (0.0, 0.0, 0.0);
            let pixels = shown[0].len();
            for pixel in 0..pixels {
                let mean = mean_of(&shown, pixel);
                let squares = shown.iter().map(|frame| (frame[pixel] - mean).powi(2));
                variances += squares.sum::<f64>() / (FRAMES - 1) as f64 / pixels as f64;
                sum += mean / pixels as f64;
                // Against its neighbour, as the plane is not equally bright everywhere.
                spread += (mean / mean_of(&shown, pixel ^ 1) - 1.0).powi(2) / pixels as f64;
            }
            let electrons = sum / per_electron;
            let expected = per_electron.powi(2) * (4.81_f64.powi(2) + electrons) + 1.0 / 12.0;
            // 3072 pixels · 39 degrees of freedom know a variance to 0.4 %.
            assert!(
                (variances / expected - 1.0).abs() < 0.02,
                "{grey}, gain {gain}: {variances} instead of {expected}"
            );
            let noise = expected / FRAMES as f64 / sum.powi(2);
            let responses = (spread / 2.0 - noise).max(0.0).sqrt();
            assert!((responses - 0.01).abs() < 0.001, "{grey}: {responses}");
        }
    }
}

/// The mean of a pixel over the frames.
fn mean_of(shown: &[Vec<f64>], pixel: usize) -> f64 {
    shown.iter().map(|frame| frame[pixel]).sum::<f64>() / shown.len() as f64
}

#[test]
fn the_papers_noise_is_uniform_independent_between_frames_and_the_same_again_from_the_same_seed() {
    let mut scenario = small(Part::Plane(Plane::default()));
    scenario.noise.noise_counts = Some(Noise::PAPER);
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
    scenario.noise.noise_counts = Some(0.0);
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

/// RMS of the periodic error of the phase, turns: fringes of 6 projector pixels in four shifts on a
/// plane, in a camera of small pixels without noise, against the phase at the point of the
/// projector plane that each pixel's ray meets.
fn periodic_error(projector_blur_px: f64) -> f64 {
    const PITCH: f64 = 6.0;
    let mut scenario = small(Part::Plane(Plane::default()));
    (
        scenario.bit_depth,
        scenario.sub_rays,
        scenario.light.diffuse,
    ) = (12, 1, 0.95);
    scenario.rig.camera.fov_deg = [1.7, 1.275];
    scenario.rig.camera.distortion = [0.0; 5];
    scenario.noise.noise_counts = Some(0.0);
    scenario.optics.projector_blur_px = projector_blur_px;
    let (camera, projector) = (scenario.rig.camera.lens(), scenario.rig.projector.lens());
    let (mut head, _) = head(&scenario).unwrap();
    let (width, height) = head.projector_size();
    let rasters = (0..4).map(|shift| {
        let grey = |at: u32| {
            let turns = f64::from(at % width) / PITCH + f64::from(shift) / 4.0;
            (127.5 * (1.0 + (TAU * turns).sin())).round() as u8
        };
        Raster::new(width, height, (0..width * height).map(grey).collect()).unwrap()
    });
    head.load(rasters.collect()).unwrap();
    let mut shifts = Vec::new();
    head.acquire(&[0, 1, 2, 3], PATIENT, &mut |_, frame| {
        shifts.push(counts(&frame));
    })
    .unwrap();
    let (columns, rows) = (scenario.rig.camera.width, scenario.rig.camera.height);
    let squares = (0..columns * rows).map(|at| {
        let ray = camera.ray(f64::from(at % columns), f64::from(at / columns));
        let (eye, pixel) = (camera.centre(), at as usize);
        let hit = [0, 1].map(|axis| eye[axis] - ray[axis] * eye[2] / ray[2]);
        let [xi, _] = projector.project([hit[0], hit[1], 0.0]).unwrap();
        let sine = shifts[0][pixel] - shifts[2][pixel];
        let cosine = shifts[1][pixel] - shifts[3][pixel];
        let off = sine.atan2(cosine) / TAU - xi / PITCH;
        (off - off.round()).powi(2)
    });
    (squares.sum::<f64>() / f64::from(columns * rows)).sqrt()
}

#[test]
fn fringes_through_a_lens_keep_no_replica_of_the_projectors_pixels() {
    // σ = 1 px leaves 2e-6 of the replicas, and the error is that of a raster of 8 bits: 2.8e-4 by
    // direct summation in f64. Samples between which light is interpolated linearly would make it
    // 1.8e-3.
    let found = [0.5, 1.0, 1.6].map(periodic_error);
    assert!((found[1] - 2.8e-4).abs() < 5e-5, "{found:?}");
    assert!(found[2] < 3.5e-4, "{found:?}");
    // A sharp lens lets replicas of 0.0077 through. Their error with that of the raster is 9.2e-4
    // by direct summation.
    assert!((found[0] - 9.2e-4).abs() < 1e-4, "{found:?}");
}

#[test]
fn a_part_that_shakes_is_seen_in_all_places_that_it_goes_through_in_an_exposure() {
    let mut scenario = small(Part::SheetMetal(SheetMetal::default()));
    scenario.noise.noise_counts = Some(0.0);
    scenario.bit_depth = 12;
    for (amplitude, shake_hz) in [([0.05, 0.0, 0.0], 17.0), ([0.0, 0.1, 0.2], 40.0)] {
        let (mut head, stage) = head(&scenario).unwrap();
        let (width, height) = head.projector_size();
        let stripes = (0..width * height).map(|at| if at % width % 20 < 10 { 230 } else { 30 });
        let stripes = Raster::new(width, height, stripes.collect()).unwrap();
        head.load(vec![stripes]).unwrap();
        let mut take = || {
            let mut taken = None;
            let mut keep = |_, frame: Frame| taken = Some((counts(&frame), frame.timestamp()));
            head.acquire(&[0], PATIENT, &mut keep).unwrap();
            taken.unwrap()
        };
        stage
            .unsettle(Unsteady {
                shake_mm: amplitude,
                shake_hz,
                ..Unsteady::default()
            })
            .unwrap();
        stage.place(&scenario.part, &Placement::default()).unwrap();
        let (shaken, start) = take();
        stage.unsettle(Unsteady::default()).unwrap();
        let length = stage.exposing().0.as_secs_f64();
        let mut sums = vec![0.0; shaken.len()];
        const MOMENTS: u32 = 32;
        for moment in 0..MOMENTS {
            let share = (f64::from(moment) + 0.5) / f64::from(MOMENTS);
            let time = start.0 as f64 * 1e-9 + length * share;
            let way = (TAU * shake_hz * time).sin();
            let lies = Placement {
                shift_mm: amplitude.map(|mm| mm * way),
                ..Placement::default()
            };
            stage.place(&scenario.part, &lies).unwrap();
            let (rests, _) = take();
            let all = sums.iter_mut().zip(rests);
            all.for_each(|(sum, sample)| *sum += sample / f64::from(MOMENTS));
        }
        stage.place(&scenario.part, &Placement::default()).unwrap();
        let (rests, _) = take();
        let off = |a: &[f64], b: &[f64]| {
            let squares = a.iter().zip(b).map(|(a, b)| (a - b).powi(2));
            (squares.sum::<f64>() / a.len() as f64).sqrt()
        };
        let (left, moved) = (off(&shaken, &sums), off(&rests, &sums));
        // Of 4095 counts: between the places that are drawn, light is taken to change evenly.
        assert!(left < 0.3 * moved && left < 8.0, "{left} of {moved}");
    }
}
