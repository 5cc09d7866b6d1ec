//! What only the user knows of pictures: the camera's noise, the working range, fringes that differ
//! by direction, and a recipe to judge them by.

use super::scene::{HEIGHT, PROJECTOR, Scene, WIDTH, check_phase, import, lit_by, notes};
use crate::written::{Written, geometric, program};
use appliance::head::seam;
use hal::replay::Recording;
use std::f64::consts::TAU;
use std::fs;
use std::path::Path;
use tests::random::Random;
use tests::{files, shared};

#[test]
fn dim_pictures_of_a_quiet_camera_are_measured_once_its_noise_is_stated() {
    let scene = Scene::new();
    let mut random = Random::new(3);
    let mut at = 0;
    for fringes in [1.0, 6.0, 36.0] {
        for k in 0..4 {
            let samples = (0..WIDTH * HEIGHT).map(|pixel| {
                let (xi, _) = lit_by(pixel % WIDTH, pixel / WIDTH);
                let turns = fringes * xi / f64::from(PROJECTOR.0) + f64::from(k) / 4.0;
                let noise = 0.8 * (random.share() - 0.5);
                (20.0 + 12.0 * (TAU * turns).cos() + noise).round() as u8
            });
            let samples: Vec<u8> = samples.collect();
            let path = scene.path(&format!("pictures/pat{at}.png"));
            super::save(&path, png::ColorType::Grayscale, &samples);
            at += 1;
        }
    }
    let options = ["--fringes", "1,6,36", "--convention", "cos", "--json"];
    let wrong = notes(&scene.import(&options).succeeded());
    assert!(
        wrong.iter().any(|note| note.contains("--noise")),
        "{wrong:?}"
    );
    let out = scene.measure();
    let report = files::report(&out);
    assert_eq!(report["resolved"], 0);
    let advice = report["advice"].as_str().unwrap();
    assert!(advice.contains("camera.noise_counts"), "{advice}");
    fs::remove_dir_all(scene.path("recording")).unwrap();
    let options = [&options[..], &["--noise", "0.5"]].concat();
    assert_eq!(notes(&scene.import(&options).succeeded()), [""; 0]);
    let out = scene.measure();
    // Rounding leaves 0.29 counts RMS, with the noise 0.37: 0.0035 turn, 0.04 projector pixels.
    let place = |u, v| lit_by(u, v).0;
    let count = check_phase(&out.join("phase.npy"), 400.0 / 36.0, place, 0.3);
    assert!(count > WIDTH * HEIGHT * 99 / 100, "{count}");
    assert_eq!(files::report(&out)["advice"], serde_json::Value::Null);
}

/// Options that name the models of a recording, written beside it.
fn models(written: &Written, recording: &Recording) -> Vec<String> {
    let folder = written.recording().parent().unwrap().to_path_buf();
    let mut options: Vec<String> = ["--unit", "mm"].map(String::from).to_vec();
    for (option, model) in [
        ("--camera-model", &recording.camera_model),
        ("--projector-model", &recording.projector.model),
    ] {
        let file = folder.join(format!("{}.yml", &option[2..]));
        fs::write(&file, files::opencv(model.as_ref().unwrap(), 1.0)).unwrap();
        options.extend([option.to_owned(), file.to_str().unwrap().to_owned()]);
    }
    options
}

fn imported(written: &Written, to: &Path, options: &[String]) -> tests::program::Run {
    let fringes = [0.0192, 0.138, 1.0].map(|ratio: f64| (49.0 * ratio).to_string());
    let fringes = fringes.join(",");
    let mut all = vec!["--fringes", &fringes, "--json"];
    all.extend(options.iter().map(String::as_str));
    import(&written.recording().join("frames"), to, "256x192", &all)
}

#[test]
fn a_part_beyond_the_working_range_is_said_to_be_with_the_option_that_moves_it() {
    let mut scene = geometric();
    scene.patches = false;
    let recording = scene.record();
    let written = Written::new(&recording);
    let mut options = models(&written, &recording);
    let folder = written.recording().parent().unwrap().to_path_buf();
    let narrow = folder.join("narrow");
    options.extend(["--range", "-90,-70"].map(String::from));
    let wrong = notes(&imported(&written, &narrow, &options).succeeded());
    let said =
        |words: &str| words.contains("working range of -90 to -70 mm") && words.contains("--range");
    assert!(wrong.iter().any(|note| said(note)), "{wrong:?}");
    let out = folder.join("narrow out");
    let run = program().measure(&narrow, &out, &[]).succeeded();
    assert!(said(&run.stdout), "{}", run.stdout);
    assert!(said(files::report(&out)["advice"].as_str().unwrap()));
    let wide = folder.join("wide");
    *options.last_mut().unwrap() = "-60,60".into();
    assert_eq!(
        notes(&imported(&written, &wide, &options).succeeded()),
        [""; 0]
    );
    let manifest = fs::read_to_string(wide.join("recording.json")).unwrap();
    let manifest: serde_json::Value = serde_json::from_str(&manifest).unwrap();
    assert_eq!(manifest["range_mm"], serde_json::json!([-60.0, 60.0]));
    for range in ["60,-60", "5", "1,1"] {
        *options.last_mut().unwrap() = range.into();
        let run = imported(&written, &folder.join("none"), &options);
        assert_eq!(run.code, 64, "{range}: {}", run.stderr);
        assert!(run.stderr.contains("--range"), "{}", run.stderr);
    }
}

#[test]
fn fringes_steps_and_pitches_may_differ_by_direction() {
    let mut scene = Scene::new();
    for (vertical, fringes, steps) in [
        (true, &[1.0, 6.0, 36.0][..], 4),
        (false, &[1.0, 8.0][..], 3),
    ] {
        for fringes in fringes {
            for k in 0..steps {
                scene.show(|xi, eta| {
                    let (at, length) = if vertical { (xi, 400.0) } else { (eta, 240.0) };
                    let shift = f64::from(k) / f64::from(steps);
                    0.5 + 0.5 * (TAU * (fringes * at / length + shift)).cos()
                });
            }
        }
    }
    let both = ["--convention", "cos", "--direction", "both", "--json"];
    for levels in [
        ["--fringes", "1,6,36/1,8", "--steps", "4/3"],
        [
            "--pitch",
            "400,66.66666666666667,11.11111111111111/240,30",
            "--steps",
            "4,4,4/3,3",
        ],
    ] {
        let run = scene.import(&[&both[..], &levels].concat()).succeeded();
        assert_eq!(notes(&run), [""; 0]);
        let out = scene.measure();
        for (file, pitch, along) in [("phase-0.npy", 400.0 / 36.0, 0), ("phase-1.npy", 30.0, 1)] {
            let place = |u, v| [lit_by(u, v).0, lit_by(u, v).1][along];
            let resolved = check_phase(&out.join(file), pitch, place, 0.6);
            assert!(resolved > WIDTH * HEIGHT * 99 / 100, "{file}: {resolved}");
        }
        fs::remove_dir_all(scene.path("recording")).unwrap();
    }
    let run = scene.import(&["--fringes", "1,6/1,8/1,9", "--direction", "both"]);
    assert_eq!(run.code, 64, "{}", run.stderr);
    assert!(run.stderr.contains("--fringes"), "{}", run.stderr);
}

#[test]
fn imported_frames_are_judged_by_a_recipe_that_is_named() {
    let mut scene = geometric();
    scene.patches = false;
    let recording = scene.record();
    let written = Written::new(&recording);
    let folder = written.recording().parent().unwrap().to_path_buf();
    let path = |name: &str| folder.join(name);
    let mut options = models(&written, &recording);
    options.extend(["--noise", "3.7"].map(String::from));
    imported(&written, &path("part"), &options).succeeded();
    let arguments = |words: &[&str]| {
        words
            .iter()
            .map(|&word| word.to_owned())
            .collect::<Vec<_>>()
    };
    let text = |name: &str| path(name).to_str().unwrap().to_owned();
    let recipe = text("5.recipe");
    let mut teach = arguments(&["teach", "--number", "5", "--golden"]);
    teach.extend([text("part"), "--out".into(), recipe.clone()]);
    // The limit is not widened for pictures that are as noisy as these: whoever wants it has to say so.
    let refused = program().run(&teach);
    assert_eq!(refused.code, 65, "{}", refused.stderr);
    assert!(
        refused.stderr.contains("±0.19 mm would be kept"),
        "{}",
        refused.stderr
    );
    teach.extend(arguments(&["--limit", "0.19"]));
    program().run(&teach).succeeded();
    let state = text("state");
    let replay = |more: &[&str]| {
        let mut replay = arguments(&["replay", "--json", "--state", &state]);
        replay.push(text("part"));
        replay.extend(arguments(more));
        program().run(&replay)
    };
    let run = replay(&["--recipe", &recipe]).succeeded();
    let judged: serde_json::Value = serde_json::from_str(&run.stdout).unwrap();
    assert_eq!(judged["replayed"]["verdict"], "PASS", "{judged}");
    assert_eq!(judged["recipe"]["number"], 5);
    // Without a recipe there is none to judge it by.
    let run = replay(&[]);
    assert_eq!(run.code, 65, "{}", run.stderr);
    assert!(run.stderr.contains("--recipe"), "{}", run.stderr);
}

/// Share of the values within a bound of those that are expected.
fn within(found: &[f32], expected: &[f32], bound: f32) -> f64 {
    assert_eq!(found.len(), expected.len());
    let pairs = found.iter().zip(expected);
    let near = pairs.filter(|(found, expected)| (**found - **expected).abs() < bound);
    near.count() as f64 / found.len() as f64
}

/// Whether the surface of these heights is lit by a pixel of the projector's raster in each camera
/// pixel, by the recording's models.
fn lit_by_raster(recording: &Path, heights: &[f32]) -> Vec<bool> {
    let recording = Recording::open(recording).unwrap();
    let size = (recording.width, recording.height);
    let camera = recording.camera_model.as_ref().unwrap();
    let camera = seam::pinhole("camera", camera, size).unwrap();
    let raster = &recording.projector;
    let size = (raster.width, raster.height);
    let projector = seam::pinhole("projector", raster.model.as_ref().unwrap(), size).unwrap();
    let lit = |(at, height): (usize, &f32)| {
        let (u, v) = (at as u32 % recording.width, at as u32 / recording.width);
        let (centre, ray) = (
            camera.centre(),
            camera.ray(f64::from(u), f64::from(v)).unwrap(),
        );
        let point = centre + ray * ((f64::from(*height) - centre.z) / ray.z);
        let (xi, _) = projector.project(point).unwrap();
        (-0.5..f64::from(raster.width) - 0.5).contains(&xi)
    };
    heights.iter().enumerate().map(lit).collect()
}

#[test]
fn shared_pictures_with_noise_range_and_fringes_per_direction_are_right() {
    let place = tempfile::tempdir().unwrap();
    let measured = |case: &Path, projector: &str, options: &[&str]| {
        let (recording, out) = (place.path().join("recording"), place.path().join("out"));
        let _ = fs::remove_dir_all(&recording);
        import(&case.join("frames"), &recording, projector, options).succeeded();
        program().measure(&recording, &out, &[]).succeeded();
        out
    };
    let values = |path: &Path| files::array(path).elements;
    if let Some(case) = shared::case("54-dim-pictures") {
        let options = ["--fringes", "1,8,64", "--noise", "0.5"];
        let out = measured(&case, "640x400", &options);
        let expected = values(&case.join("expected_phase.npy"));
        assert!(within(&values(&out.join("phase.npy")), &expected, 0.05) > 0.99);
    }
    if let Some(case) = shared::case("56-tall-part") {
        let [camera, projector] = ["camera.yml", "projector.yml"].map(|name| case.join(name));
        let options = [
            "--fringes",
            "1,8,64",
            "--range",
            "-20,150",
            "--unit",
            "mm",
            "--camera-model",
            camera.to_str().unwrap(),
            "--projector-model",
            projector.to_str().unwrap(),
        ];
        let out = measured(&case, "640x400", &options);
        let expected = values(&case.join("expected_height.npy"));
        // The pictures show fringes beyond the raster's left edge, too, whose phase is that of its
        // right edge: those pixels have no height.
        let lit = lit_by_raster(&place.path().join("recording"), &expected);
        let found = values(&out.join("height.npy"));
        let of_raster = |values: &[f32]| {
            let values = values.iter().zip(&lit).filter(|(_, lit)| **lit);
            values.map(|(value, _)| *value).collect::<Vec<_>>()
        };
        let (found, expected) = (of_raster(&found), of_raster(&expected));
        assert!(found.len() > 18_500, "{}", found.len());
        assert!(within(&found, &expected, 0.2) > 0.99);
    }
    if let Some(case) = shared::case("57-fringes-differ-by-direction") {
        let options = [
            "--fringes",
            "1,8,32/1,8,16",
            "--steps",
            "3",
            "--direction",
            "both",
        ];
        let out = measured(&case, "640x400", &options);
        for at in 0..2 {
            let expected = values(&case.join(format!("expected_phase_{at}.npy")));
            let found = values(&out.join(format!("phase-{at}.npy")));
            assert!(within(&found, &expected, 0.05) > 0.99, "{at}");
        }
    }
}
