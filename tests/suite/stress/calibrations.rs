//! Invalid calibrations are refused, and the error names what is wrong; every accepted calibration
//! is a valid camera.

use super::random::between;
use super::rig;
use algo::geometry::{ModelError, Pinhole, PinholeModel, fit_map};
use appliance::head::seam;
use appliance::measure::measure;
use hal::model::DeviceModel;
use std::path::Path;
use tests::random::Random;
use tests::render::{Scene, levels};

const SEED: u64 = 20_260_610;
const SIZE: usize = 48;
/// Largest error in pixels: Newton's method stops at 1e-12 of the focal length.
const ROUND_TRIP: f64 = 1e-8;

fn good() -> PinholeModel {
    seam::pinhole_model(&tests::rig::camera(SIZE as u32))
}

fn refusal(model: PinholeModel) -> Option<ModelError> {
    Pinhole::new(model, SIZE, SIZE).err()
}

/// Every number of a model, with its name.
fn numbers(model: &mut PinholeModel) -> Vec<(&'static str, &mut f64)> {
    let PinholeModel {
        fx,
        fy,
        cx,
        cy,
        distortion,
        rotation,
        translation,
    } = model;
    let mut all = vec![
        ("the focal length", fx),
        ("the focal length", fy),
        ("the principal point", cx),
        ("the principal point", cy),
    ];
    all.extend(distortion.iter_mut().map(|x| ("the distortion", x)));
    all.extend(rotation.iter_mut().map(|x| ("the rotation", x)));
    all.extend(translation.iter_mut().map(|x| ("the translation", x)));
    all
}

#[test]
fn a_number_that_is_none_is_refused_by_name_wherever_it_stands() {
    assert_eq!(refusal(good()), None);
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        for at in 0..numbers(&mut good()).len() {
            let mut model = good();
            let (name, number) = numbers(&mut model).swap_remove(at);
            *number = bad;
            assert_eq!(refusal(model), Some(ModelError::NotFinite(name)), "{at}");
        }
    }
}

#[test]
fn numbers_of_absurd_size_are_refused_by_name_wherever_they_stand() {
    for bad in [1e12, -1e12, 1e100, -1e100, 1e300, f64::MAX, f64::MIN] {
        for at in 0..numbers(&mut good()).len() {
            let mut model = good();
            let (name, number) = numbers(&mut model).swap_remove(at);
            *number = bad;
            let Some(error) = refusal(model) else {
                // A large even radial distortion is one-to-one, so it is a valid camera.
                assert!(
                    name == "the distortion" && is_camera(model),
                    "{name} = {bad}"
                );
                continue;
            };
            let word = name.rsplit(' ').next().unwrap();
            let named = match error {
                ModelError::Focal { .. } => "length",
                ModelError::PrincipalPoint { .. } => "point",
                ModelError::Rotation { .. } => "rotation",
                ModelError::Distortion { .. } => "distortion",
                ModelError::Translation { .. } => "translation",
                ref other => panic!("{other}"),
            };
            assert_eq!(named, word, "{at}: {error}");
            assert!(
                error.to_string().contains(word) || word == "length",
                "{error}"
            );
        }
    }
}

#[test]
fn focal_lengths_that_no_lens_has_are_refused() {
    for bad in [0.0, -0.0, -1.0, -1e-300, 5e-324, 1e-300, 1e-6, 0.4, 1.1e6] {
        for (fx, fy) in [(bad, 100.0), (100.0, bad), (bad, bad)] {
            let error = refusal(PinholeModel { fx, fy, ..good() });
            assert_eq!(error, Some(ModelError::Focal { fx, fy }));
            assert!(error.unwrap().to_string().contains("focal"));
        }
    }
}

#[test]
fn matrices_that_are_no_rotations_are_refused() {
    let r = good().rotation;
    let scaled = |factor: f64| r.map(|x| x * factor);
    let mut sheared = r;
    sheared[0] += 0.01 * r[3];
    sheared[1] += 0.01 * r[4];
    sheared[2] += 0.01 * r[5];
    let mut repeated = r;
    repeated.copy_within(0..3, 3);
    for (what, rotation) in [
        ("nothing", [0.0; 9]),
        ("mirrored", scaled(-1.0)),
        ("larger", scaled(1.001)),
        ("smaller", scaled(0.999)),
        ("enormous", scaled(1e200)),
        ("tiny", scaled(1e-200)),
        ("sheared", sheared),
        ("of rank 2", repeated),
        ("all ones", [1.0; 9]),
    ] {
        let error = refusal(PinholeModel { rotation, ..good() });
        assert!(
            matches!(error, Some(ModelError::Rotation { .. })),
            "{what}: {error:?}"
        );
        assert!(error.unwrap().to_string().contains("rotation"));
    }
    // Rounded to five digits it is still a rotation.
    let rounded = r.map(|x| (x * 1e5).round() / 1e5);
    let model = PinholeModel {
        rotation: rounded,
        ..good()
    };
    assert_eq!(refusal(model), None);
}

/// Whether every pixel has one ray, and the ray projects to this pixel.
fn is_camera(model: PinholeModel) -> bool {
    let pinhole = Pinhole::new(model, SIZE, SIZE).expect("accepted");
    (0..=SIZE * SIZE).all(|i| {
        // Includes borders and corners.
        let (u, v) = ((i % SIZE) as f64 - 0.5, (i / SIZE) as f64 - 0.5);
        let Some(ray) = pinhole.ray(u, v) else {
            return false;
        };
        let (a, b) = pinhole.project(pinhole.centre() + ray * 500.0).unwrap();
        (a - u).abs() + (b - v).abs() < ROUND_TRIP
    })
}

#[test]
fn distortions_of_any_size_are_refused_or_are_cameras() {
    let mut random = Random::new(SEED);
    let (mut accepted, mut refused) = (0, 0);
    for _ in 0..4000 {
        let mut model = good();
        for number in &mut model.distortion {
            let size = 10.0_f64.powf(between(&mut random, -4.0, 5.0));
            *number = match random.below(3) {
                0 => 0.0,
                1 => size,
                _ => -size,
            };
        }
        match refusal(model) {
            None => {
                assert!(is_camera(model), "{:?}", model.distortion);
                accepted += 1;
            }
            Some(error) => {
                assert!(matches!(error, ModelError::Distortion { .. }), "{error}");
                refused += 1;
            }
        }
    }
    println!("{accepted} distortions accepted, {refused} refused");
    assert!(accepted > 100 && refused > 100);
}

#[test]
fn frames_of_no_size_have_no_camera_that_panics() {
    for (width, height) in [(0, 0), (0, 48), (48, 0), (1, 1), (1 << 40, 1)] {
        // Any result is fine, if there is no panic.
        let _ = Pinhole::new(good(), width, height);
    }
}

#[test]
fn a_measured_map_of_numbers_that_are_none_is_refused() {
    let samples = |bad: f64| {
        (0..SIZE * SIZE).map(move |i| {
            let (u, v) = ((i % SIZE) as f64, (i / SIZE) as f64);
            (u, v, if i == 1000 { bad } else { u + v })
        })
    };
    assert!(fit_map(SIZE, SIZE, samples(1.0)).is_ok());
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, f64::MAX] {
        assert!(fit_map(SIZE, SIZE, samples(bad)).is_err(), "{bad}");
    }
    let nowhere = (0..500).map(|i| (f64::NAN, f64::from(i), 1.0));
    assert!(fit_map(SIZE, SIZE, nowhere).is_err());
}

#[test]
fn a_recording_with_a_calibration_that_is_none_is_refused_by_device_and_number() {
    let scene = Scene {
        size: 16,
        projector: (rig::PROJECTOR.0 as u32, rig::PROJECTOR.1 as u32),
        patches: false,
        ..Scene::new(40.0, levels(&[0.02, 0.14, 1.0], 3))
    };
    let whole = scene.record();
    type Damage = (fn(&mut DeviceModel), &'static str);
    let damages: [Damage; 7] = [
        (|m| m.fx = f64::NAN, "focal length"),
        (|m| m.fy = 0.0, "focal lengths"),
        (|m| m.cy = f64::INFINITY, "principal point"),
        (|m| m.distortion[4] = f64::NAN, "distortion"),
        (|m| m.distortion[0] = -1e9, "distortion"),
        (|m| m.rotation = [1.0; 9], "rotation"),
        (|m| m.translation_mm[2] = 1e300, "translation"),
    ];
    for (damage, word) in damages {
        for camera in [true, false] {
            let mut recording = whole.clone();
            let (model, device) = match camera {
                true => (&mut recording.camera_model, "camera"),
                false => (&mut recording.projector.model, "projector"),
            };
            damage(model.as_mut().unwrap());
            let Err(error) = measure(&recording, Path::new("in memory")) else {
                panic!("{device} with another {word} was measured");
            };
            let text = error.to_string();
            assert!(
                text.contains(word) && text.contains(device),
                "{word}: {text}"
            );
        }
    }
}
