//! Promises of the simulated head: contract, light, noise, determinism, defects, and speed.

use std::time::{Duration, Instant};

use super::optics::{Vector, along, normalised};
use super::parts::{Cone, Defect, Flowerpot, Plane, Sawtooth, SheetMetal, Sphere, Tube};
use super::trace::Traced;
use super::{Part, Placement, Scenario, Stage, head};
use crate::contract::check_head;
use crate::frame::{Frame, Samples};
use crate::head::DynHead;
use crate::projector::Raster;

const PATIENT: Duration = Duration::from_secs(1);

/// The study's rig with fewer pixels, so that tests are quick.
fn small(part: Part) -> Scenario {
    let mut scenario = Scenario {
        part,
        sub_rays: 2,
        ..Scenario::default()
    };
    (scenario.rig.camera.width, scenario.rig.camera.height) = (64, 48);
    scenario
}

fn all_parts() -> Vec<Part> {
    vec![
        Part::Cone(Cone::default()),
        Part::Sawtooth(Sawtooth::default()),
        Part::Sphere(Sphere::default()),
        Part::Tube(Tube::default()),
        Part::Flowerpot(Flowerpot::default()),
        Part::Spline(Box::default()),
        Part::Plane(Plane::default()),
        Part::SheetMetal(SheetMetal::default()),
        Part::SheetMetal(SheetMetal {
            defects: vec![
                Defect::Dent {
                    x: 10.0,
                    y: -5.0,
                    depth_mm: 1.5,
                    diameter_mm: 20.0,
                },
                Defect::MissingHole { index: 1 },
                Defect::BentFlange { degrees: 6.0 },
            ],
        }),
        Part::Empty {},
    ]
}

/// One frame per level, each level shown uniformly.
fn frames(head: &mut DynHead, levels: &[u8]) -> Vec<Frame> {
    let (width, height) = head.projector_size();
    let rasters = levels
        .iter()
        .map(|level| Raster::uniform(width, height, *level).unwrap());
    head.load(rasters.collect()).unwrap();
    let indices: Vec<usize> = (0..levels.len()).collect();
    let mut frames = Vec::new();
    head.acquire(&indices, PATIENT, &mut |_, frame| frames.push(frame))
        .unwrap();
    frames
}

fn counts(frame: &Frame) -> Vec<f64> {
    match frame.samples() {
        Samples::Eight(samples) => samples.iter().map(|s| f64::from(*s)).collect(),
        Samples::Sixteen(samples) => samples.iter().map(|s| f64::from(*s)).collect(),
    }
}

#[test]
fn a_simulated_head_keeps_the_contract() {
    for bit_depth in [8, 10, 12] {
        let scenario = Scenario {
            bit_depth,
            ..small(Part::default())
        };
        check_head(&mut head(&scenario).unwrap().0, 6).unwrap();
    }
}

#[test]
fn no_height_has_a_slope_above_its_bound() {
    for part in all_parts() {
        let Some(surface) = part.surface() else {
            continue;
        };
        let bound = surface.slope_bound();
        let step = 0.01;
        for i in -240..240 {
            for j in -240..240 {
                let (x, y) = (f64::from(i) * 0.503, f64::from(j) * 0.497);
                let here = surface.height(x, y);
                for (dx, dy) in [
                    (step, 0.0),
                    (0.0, step),
                    (0.6 * step, 0.8 * step),
                    (0.8 * step, -0.6 * step),
                ] {
                    let slope = (surface.height(x + dx, y + dy) - here).abs() / step;
                    assert!(
                        slope <= bound + 1e-6,
                        "{part:?} at ({x}, {y}): {slope} > {bound}"
                    );
                }
                let [low, high] = surface.bounds();
                if surface.present(x, y) {
                    let p = [x, y, here];
                    assert!(
                        (0..3).all(|a| p[a] >= low[a] - 1e-9 && p[a] <= high[a] + 1e-9),
                        "{part:?} {p:?}"
                    );
                }
            }
        }
    }
}

/// The first sign change of z − height at material, by small steps.
fn marched(part: &Part, origin: Vector, direction: Vector) -> Option<f64> {
    let surface = part.surface()?;
    let over = |t: f64| {
        let [x, y, z] = along(origin, direction, t);
        (z - surface.height(x, y), surface.present(x, y))
    };
    let step = 0.01;
    let mut t = 400.0;
    let mut last = over(t).0;
    while t < 900.0 {
        t += step;
        let (value, present) = over(t);
        if (value > 0.0) != (last > 0.0) && present {
            return Some(t);
        }
        last = value;
    }
    None
}

#[test]
fn a_ray_meets_every_part_where_small_steps_meet_it() {
    let lens = super::optics::Lens::new(Scenario::default().rig.camera.model());
    for part in all_parts() {
        let surface = part.surface();
        for k in 0..60_u32 {
            let (u, v) = (f64::from(k * 197 % 512), f64::from(k * 331 % 512));
            let ray = lens.ray(u, v);
            let slow = marched(&part, lens.centre(), ray);
            let fast = surface
                .as_deref()
                .and_then(|s| Traced::new(s).first_hit(lens.centre(), ray));
            match (slow, fast) {
                (None, None) => {}
                (Some(t), Some(hit)) => {
                    let [x, y, z] = along(lens.centre(), ray, t);
                    let off = (x - hit.point[0])
                        .hypot(y - hit.point[1])
                        .hypot(z - hit.point[2]);
                    assert!(off < 0.02, "{part:?} at ({u}, {v}): {off} mm apart");
                    let exact = z_at(&part, hit.point);
                    assert!(
                        (hit.point[2] - exact).abs() < 1e-5,
                        "{part:?}: {} off",
                        hit.point[2] - exact
                    );
                }
                (slow, fast) => panic!("{part:?} at ({u}, {v}): {slow:?} against {fast:?}"),
            }
        }
    }
}

fn z_at(part: &Part, point: Vector) -> f64 {
    part.surface().unwrap().height(point[0], point[1])
}

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
fn frames_and_truth_are_the_same_for_any_number_of_threads() {
    let with_threads = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| {
            let mut scenario = small(Part::default());
            scenario.optics.camera_blur_px = 0.7;
            let (mut head, stage) = head(&scenario).unwrap();
            let frames: Vec<_> = frames(&mut head, &[200, 50]).iter().map(counts).collect();
            let bits: Vec<u32> = stage.truth().height.iter().map(|z| z.to_bits()).collect();
            (frames, bits, stage.truth().class)
        })
    };
    assert!(with_threads(1) == with_threads(2));
}

/// Pixels whose truth is not NaN, and the largest difference of truth from the good part.
fn against_good(stage: &Stage, defects: Vec<Defect>) -> (usize, f32) {
    let seen = |z: &[f32]| z.iter().filter(|z| !z.is_nan()).count();
    stage
        .place(&Part::default(), &Placement::default())
        .unwrap();
    let good = stage.truth().height;
    stage
        .place(
            &Part::SheetMetal(SheetMetal { defects }),
            &Placement::default(),
        )
        .unwrap();
    let bad = stage.truth().height;
    let differences = good
        .iter()
        .zip(&bad)
        .map(|(a, b)| (a - b).abs())
        .filter(|d| !d.is_nan());
    (
        seen(&bad).abs_diff(seen(&good)),
        differences.fold(0.0, f32::max),
    )
}

#[test]
fn each_defect_of_the_bracket_shows_in_the_truth() {
    let mut scenario = Scenario {
        sub_rays: 1,
        ..Scenario::default()
    };
    (scenario.rig.camera.width, scenario.rig.camera.height) = (128, 128);
    let (_, stage) = head(&scenario).unwrap();
    let truth = stage.truth();
    let seen = truth.height.iter().filter(|z| !z.is_nan()).count();
    assert!(
        seen > 128 * 128 * 3 / 10,
        "the bracket fills a good part of the picture: {seen}"
    );
    assert!(
        truth
            .height
            .iter()
            .filter(|z| !z.is_nan())
            .all(|z| z.abs() < 40.0)
    );
    let edge = |at: usize| [0, 127].contains(&(at / 128)) || [0, 127].contains(&(at % 128));
    assert!(
        truth
            .height
            .iter()
            .enumerate()
            .all(|(at, z)| z.is_nan() || !edge(at)),
        "it lies inside the picture"
    );

    let dent = Defect::Dent {
        x: 10.0,
        y: -8.0,
        depth_mm: 1.5,
        diameter_mm: 18.0,
    };
    let (_, depth) = against_good(&stage, vec![dent]);
    assert!((depth - 1.5).abs() < 0.1, "{depth}");
    let (more, _) = against_good(&stage, vec![Defect::MissingHole { index: 2 }]);
    assert!(more > 60, "a hole of 11 mm radius is {more} pixels");
    let (_, bend) = against_good(&stage, vec![Defect::BentFlange { degrees: 8.0 }]);
    assert!(bend > 2.0, "{bend}");
    assert_eq!(against_good(&stage, vec![]).1, 0.0);
}

#[test]
fn a_placed_part_is_shifted_and_turned_as_its_placement_says() {
    let (_, stage) = head(&small(Part::Plane(Plane::default()))).unwrap();
    let part = Part::Plane(Plane::default());
    stage
        .place(
            &part,
            &Placement {
                shift_mm: [3.0, 1.0, 7.5],
                ..Placement::default()
            },
        )
        .unwrap();
    assert!(stage.truth().height.iter().all(|z| (z - 7.5).abs() < 1e-4));
    // Tilted about x, +y goes up; +y is up in the picture too, so its first row is higher than its last.
    stage
        .place(
            &part,
            &Placement {
                tilt_deg: [5.0, 0.0],
                ..Placement::default()
            },
        )
        .unwrap();
    let tilted = stage.truth().height;
    assert!(
        tilted[32] > 3.0 && tilted[47 * 64 + 32] < -3.0,
        "{} {}",
        tilted[32],
        tilted[47 * 64 + 32]
    );
    // Tilted about y, +x goes down.
    stage
        .place(
            &part,
            &Placement {
                tilt_deg: [0.0, 5.0],
                ..Placement::default()
            },
        )
        .unwrap();
    let tilted = stage.truth().height;
    assert!(tilted[24 * 64] > 3.0 && tilted[24 * 64 + 63] < -3.0);
    assert!(
        stage
            .place(
                &part,
                &Placement {
                    rotation_deg: f64::NAN,
                    ..Placement::default()
                }
            )
            .is_err()
    );
}

#[test]
fn going_back_to_a_placed_part_costs_nothing() {
    let (_, stage) = head(&small(Part::default())).unwrap();
    let built = std::sync::atomic::AtomicU32::new(0);
    let count = |_: f64| {
        built.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
    };
    for _ in 0..5 {
        for part in all_parts().iter().take(4) {
            stage
                .place_with_progress(part, &Placement::default(), &count)
                .unwrap();
        }
    }
    assert_eq!(
        built.into_inner(),
        4 * 48,
        "each of four parts is traced once, row by row"
    );
}

#[test]
fn a_scenario_is_read_over_its_defaults_and_refuses_what_it_does_not_know() {
    let text = "bit_depth = 10\n[rig.camera]\nwidth = 640\n[part]\nkind = \"sheet_metal\"\n\
        [[part.defects]]\nkind = \"dent\"\nx = 1.0\ny = 2.0\ndepth_mm = 1.0\ndiameter_mm = 9.0\n";
    let scenario = Scenario::from_toml(text, "s.toml").unwrap();
    assert_eq!(
        (
            scenario.bit_depth,
            scenario.rig.camera.width,
            scenario.rig.camera.height
        ),
        (10, 640, 512)
    );
    assert_eq!(scenario.rig.projector, Scenario::default().rig.projector);
    assert_eq!(
        Scenario::from_toml("", "s.toml").unwrap(),
        Scenario::default()
    );
    for (text, expected) in [
        ("bits = 8", "bits"),
        ("bit_depth = 9", "bit_depth is 9"),
        ("[rig.camera]\nfocus = 1", "focus"),
        ("[rig.camera]\nwidth = 0", "rig.camera.width is 0"),
        ("[part]\nkind = \"cube\"", "cube"),
        ("[part]\nkind = \"empty\"\nsize = 1", "size"),
        ("[part]\nkind = \"cone\"\nheight = 1", "height"),
        ("[light]\nambient = nan", "light.ambient is NaN"),
        (
            "[placement]\ntilt_deg = [90.0, 0.0]",
            "placement.tilt_deg is 90",
        ),
        (
            "[part]\nkind = \"sheet_metal\"\ndefects = [{ kind = \"missing_hole\", index = 3 }]",
            "index is 3",
        ),
    ] {
        let message = Scenario::from_toml(text, "s.toml").unwrap_err().to_string();
        assert!(
            message.contains("s.toml") && message.contains(expected),
            "{text}: {message}"
        );
    }
    let written = toml::to_string(&scenario).unwrap();
    assert_eq!(Scenario::from_toml(&written, "s.toml").unwrap(), scenario);
}

/// Prints what the README states. Run with
/// `cargo test --release -p hal --lib -- --ignored --nocapture speed`.
#[test]
#[ignore = "a measurement, not a promise: run it alone and in release"]
fn speed_of_building_a_transport_and_of_one_frame() {
    for part in all_parts() {
        let scenario = Scenario {
            part,
            ..Scenario::default()
        };
        let begun = Instant::now();
        let (mut head, _) = head(&scenario).unwrap();
        let build = begun.elapsed();
        let (width, height) = head.projector_size();
        head.load(vec![Raster::uniform(width, height, 100).unwrap(); 12])
            .unwrap();
        let indices: Vec<usize> = (0..12).cycle().take(48).collect();
        let begun = Instant::now();
        head.acquire(&indices, PATIENT, &mut |_, _| ()).unwrap();
        let name = format!("{:?}", scenario.part);
        println!(
            "{:14} build {:6.2} s, frame {:5.2} ms",
            name.split('(').next().unwrap(),
            build.as_secs_f64(),
            begun.elapsed().as_secs_f64() * 1e3 / 48.0
        );
    }
}
