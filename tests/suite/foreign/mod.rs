//! Other people's frames: imported, projected from our patterns, and taken with a head that is not
//! calibrated.

mod alone;
mod cases;
mod codes;
mod folders;
mod models;
mod own;
mod ranges;
mod response;
mod scene;

use crate::written::{Written, geometric, program};
use scene::{HEIGHT, Scene, WIDTH, check_phase, import, lit_by, notes, png_of, save};
use std::f64::consts::TAU;
use std::fs;
use std::path::Path;
use tests::{files, shared};

/// Gray code of a cell, as OpenCV's `GrayCodePattern` shows it: the most significant bit first,
/// each picture followed by its inverse.
fn gray(scene: &mut Scene, bits: u32, cell: f64, vertical: bool) {
    for bit in (0..bits).rev() {
        for inverse in [false, true] {
            scene.show(|xi, eta| {
                // Pixel centres are at whole numbers.
                let at = ((if vertical { xi } else { eta }).round() / cell).floor() as u32;
                let set = (at ^ at >> 1) >> bit & 1 == 1;
                if set == inverse { 0.0 } else { 1.0 }
            });
        }
    }
}

/// The sequence of github.com/kamino410/phase-shifting (README and `phase_shifting.py gen 400 240
/// 100`): three shifts −1/3, 0, 1/3 of a cosine with periods of a third and a half of `step`, for
/// columns and then rows; Gray codes with cells of half of `step`; white, black.
#[test]
fn fractional_periods_in_both_directions_with_a_gray_code_of_wide_cells_are_imported() {
    let mut scene = Scene::new();
    let step = 100.0;
    for vertical in [true, false] {
        for period in [step / 3.0, step / 2.0] {
            for shift in [-1.0, 0.0, 1.0] {
                scene.show(|xi, eta| {
                    let at = if vertical { xi } else { eta };
                    0.5 + 0.5 * (TAU * (at / period + shift / 3.0)).cos()
                });
            }
        }
    }
    gray(&mut scene, 3, step / 2.0, true);
    gray(&mut scene, 3, step / 2.0, false);
    scene.show(|_, _| 1.0);
    scene.show(|_, _| 0.0);
    let options = [
        "--pitch",
        "33.33333333333333,50",
        "--steps",
        "3",
        "--convention",
        "cos",
        "--first-shift",
        "-0.3333333333333333",
        "--direction",
        "both",
        "--gray",
        "3",
        "--gray-cell",
        "50",
        "--gray-inverse",
        "--order",
        "sine,gray,white,black",
        "--json",
    ];
    let run = scene.import(&options).succeeded();
    assert_eq!(notes(&run), [""; 0]);
    let out = scene.measure();
    let report = files::report(&out);
    assert_eq!(report["kind"], "gray code");
    assert!(report["no_height"].as_str().unwrap().contains("model"));
    // Noise of ± 2 counts on a modulation of 95 and 3 shifts is 0.002 turn, 0.07 px.
    let vertical = check_phase(
        &out.join("phase-0.npy"),
        step / 3.0,
        |u, v| lit_by(u, v).0,
        0.4,
    );
    let horizontal = check_phase(
        &out.join("phase-1.npy"),
        step / 3.0,
        |u, v| lit_by(u, v).1,
        0.4,
    );
    let all = WIDTH * HEIGHT;
    assert!(
        vertical.min(horizontal) > all * 99 / 100,
        "{vertical} {horizontal} of {all}"
    );
    // A code in front of the fringes, without its inverse, white and black: compared with the
    // fringes' mean.
    let mut scene = Scene::new();
    for bit in (0..3).rev() {
        scene.show(|xi, _| {
            let cell = (xi.round() / 50.0).floor() as u32;
            f64::from((cell ^ cell >> 1) >> bit & 1)
        });
    }
    scene.level(8.0, 4, |k| k);
    let options = ["--fringes", "8", "--convention", "cos", "--gray", "3"];
    let options = [&options[..], &["--order", "gray,sine", "--json"]].concat();
    let run = scene.import(&options).succeeded();
    assert_eq!(notes(&run), [""; 0]);
    let out = scene.measure();
    let count = check_phase(&out.join("phase.npy"), 50.0, |u, v| lit_by(u, v).0, 0.6);
    // The cells are as wide as the fringes: what is lost is within noise of their borders.
    assert!(count > all * 97 / 100, "{count} of {all}");
}

#[test]
fn confused_conventions_are_named_with_the_options_that_fit() {
    let mut scene = Scene::new();
    for fringes in [1.0, 6.0, 36.0] {
        scene.level(fringes, 4, |k| -k);
    }
    let levels = ["--fringes", "1,6,36", "--json"];
    let with = |convention: &str, shift: &str, levels: &[&str]| {
        let options = [levels, &["--convention", convention, "--shift", shift]].concat();
        let run = scene.import(&options).succeeded();
        fs::remove_dir_all(scene.path("recording")).unwrap();
        notes(&run)
    };
    assert_eq!(with("cos", "-", &levels), [""; 0]);
    for (convention, shift) in [("sin", "-"), ("sin", "+")] {
        let notes = with(convention, shift, &levels);
        let [note] = &notes[..] else {
            panic!("{convention} {shift}: {notes:?}");
        };
        assert!(note.contains("give --convention cos --shift -"), "{note}");
    }
    // A reversed cosine is a cosine: only the direction of the phase tells.
    let reversed = with("cos", "+", &levels);
    assert!(reversed[0].contains("--shift is reversed"), "{reversed:?}");
    let wrong = with("cos", "-", &["--fringes", "36,6,1", "--json"]);
    assert!(wrong[0].contains("check --fringes"), "{wrong:?}");
    // With ratios of 5 a sine and a cosine agree in all orders; the coarsest level then wraps in
    // the picture.
    let mut fives = Scene::new();
    for fringes in [1.0, 5.0, 25.0] {
        fives.level(fringes, 4, |k| k);
    }
    let run = fives.import(&["--fringes", "1,5,25", "--json"]).succeeded();
    let words = notes(&run);
    assert!(
        words
            .iter()
            .any(|note| note.contains("give --convention cos --shift +")),
        "{words:?}"
    );
}

#[test]
fn a_channel_of_colour_pictures_is_taken_and_what_looks_wrong_is_said() {
    let mut scene = Scene::new();
    scene.level(1.0, 3, |k| k);
    scene.level(12.0, 4, |k| k);
    // Fringes in the green samples only, others in the red.
    for at in 0..7 {
        let path = scene.path(&format!("pictures/pat{at}.png"));
        let grey = files::picture(&path).samples;
        let colour: Vec<u8> = grey
            .iter()
            .flat_map(|&g| [255 - g as u8, g as u8, 90])
            .collect();
        save(&path, png::ColorType::Rgb, &colour);
    }
    let options = [
        "--fringes",
        "1,12",
        "--steps",
        "3,4",
        "--convention",
        "cos",
        "--json",
    ];
    let run = scene.import(&options).succeeded();
    assert!(notes(&run)[0].contains("--channel"), "{:?}", notes(&run));
    fs::remove_dir_all(scene.path("recording")).unwrap();
    let options = [&options[..], &["--channel", "green"]].concat();
    let run = scene.import(&options).succeeded();
    assert_eq!(notes(&run), [""; 0]);
    let out = scene.measure();
    let count = check_phase(
        &out.join("phase.npy"),
        400.0 / 12.0,
        |u, v| lit_by(u, v).0,
        0.4,
    );
    assert!(count > WIDTH * HEIGHT * 99 / 100, "{count}");
    // A picture twice.
    fs::remove_dir_all(scene.path("recording")).unwrap();
    fs::copy(
        scene.path("pictures/pat5.png"),
        scene.path("pictures/pat6.png"),
    )
    .unwrap();
    let run = scene.import(&options).succeeded();
    let words = notes(&run);
    assert!(
        words[0].contains("frames 5 and 6 are the same"),
        "{words:?}"
    );
}

#[test]
fn what_cannot_be_imported_is_refused_with_its_exit_code_and_the_remedy() {
    let mut scene = Scene::new();
    scene.level(1.0, 4, |k| k);
    scene.level(8.0, 4, |k| k);
    let refused = |options: &[&str], code: i32, word: &str| {
        let run = scene.import(options);
        assert_eq!(run.code, code, "{options:?}: {}", run.stderr);
        assert!(run.stderr.contains(word), "{options:?}: {}", run.stderr);
        assert!(!scene.path("recording").exists());
    };
    refused(
        &["--fringes", "1,8,64"],
        65,
        "8 pictures (pat0.png to pat7.png), but the options describe 12",
    );
    refused(
        &["--fringes", "1,8", "--steps", "4,4,4"],
        64,
        "--steps has 3 numbers for 2 levels",
    );
    refused(&["--fringes", "8,8"], 64, "two levels have 8 fringes");
    refused(&["--fringes", "1,8", "--gray", "5"], 64, "--gray-cell");
    refused(&["--fringes", "1,8", "--order", "gray,sine"], 64, "--order");
    refused(
        &["--fringes", "1,8", "--name", "x"],
        65,
        "no picture whose name begins with \"x\"",
    );
    refused(
        &["--fringes", "1,8", "--models", "/none.yml"],
        66,
        "no such file",
    );
    refused(&["--fringes", "1,8", "--gray-cell", "50"], 64, "--gray");
    refused(&["--fringes", "1,8", "--gray-invert"], 64, "--gray");
    refused(
        &[
            "--fringes",
            "8",
            "--gray",
            "3",
            "--gray-offset",
            "25",
            "--gray-binary",
        ],
        64,
        "--gray-offset",
    );
    refused(&[], 64, "--fringes");
    let nowhere = import(
        &scene.path("none"),
        &scene.path("recording"),
        "400x240",
        &["--fringes", "1,8"],
    );
    assert_eq!(nowhere.code, 66, "{}", nowhere.stderr);
    fs::write(scene.path("pictures/pat3.png"), "no picture").unwrap();
    refused(&["--fringes", "1,8"], 65, "pat3.png");
    let small = png_of(3, 2);
    fs::write(scene.path("pictures/pat3.png"), small).unwrap();
    refused(&["--fringes", "1,8"], 65, "all must come from one camera");
}

#[test]
fn frames_that_are_imported_with_models_of_opencv_give_the_heights_of_their_recording() {
    let recording = geometric().record();
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let direct = Written::new(&recording);
    direct.measure(&[]).succeeded();
    let mut options = Vec::new();
    for (option, model) in [
        ("--camera-model", &recording.camera_model),
        ("--projector-model", &recording.projector.model),
    ] {
        let file = path(&format!("{}.yml", &option[2..]));
        fs::write(&file, files::opencv(model.as_ref().unwrap(), 0.1)).unwrap();
        options.extend([option.to_owned(), file.to_str().unwrap().to_owned()]);
    }
    let fringes = [0.0192, 0.138, 1.0].map(|ratio: f64| (49.0 * ratio).to_string());
    options.extend(["--fringes".to_owned(), fringes.join(",")]);
    let options: Vec<&str> = options.iter().map(String::as_str).collect();
    let frames = direct.recording().join("frames");
    let imported = path("imported");
    let without_unit = import(&frames, &imported, "256x192", &options);
    assert_eq!(without_unit.code, 65, "{}", without_unit.stderr);
    let options = [&options[..], &["--unit", "cm", "--json"]].concat();
    let run = import(&frames, &imported, "256x192", &options).succeeded();
    // The scene has a patch that is too bright.
    assert!(
        notes(&run).iter().all(|note| note.contains("full scale")),
        "{:?}",
        notes(&run)
    );
    let out = path("out");
    program().measure(&imported, &out, &[]).succeeded();
    let heights = |folder: &Path| files::array(&folder.join("height.npy")).elements;
    let pairs = heights(&out).into_iter().zip(heights(&direct.out()));
    let mut compared = 0;
    for (found, expected) in pairs.filter(|(a, b)| !a.is_nan() && !b.is_nan()) {
        assert!((found - expected).abs() < 1e-3, "{found} {expected}");
        compared += 1;
    }
    assert!(compared > 7000, "{compared}");
}

#[test]
fn the_frames_of_slstudio_are_imported_as_they_were_by_hand() {
    for (name, options) in [
        (
            "slstudio-calib-1",
            ["--fringes", "16,1", "--direction", "both"],
        ),
        (
            "slstudio-skull",
            ["--fringes", "1,16", "--direction", "vertical"],
        ),
    ] {
        let Some(folder) = shared::folder(name) else {
            continue;
        };
        let place = tempfile::tempdir().unwrap();
        let (recording, out) = (place.path().join("recording"), place.path().join("out"));
        let shifts = [
            "--steps",
            "3",
            "--convention",
            "cos",
            "--shift",
            "-",
            "--json",
        ];
        let options = [&options[..], &shifts].concat();
        let frames = folder.join("frames");
        let run = import(&frames, &recording, "1824x1140", &options).succeeded();
        // The scenes are dark at their edges, which is not wrong.
        assert_eq!(notes(&run), [""; 0], "{name}");
        program().measure(&recording, &out, &[]).succeeded();
        let by_hand = place.path().join("by hand");
        program().measure(&folder, &by_hand, &[]).succeeded();
        let read = |folder: &Path, file: &str| fs::read(folder.join(file)).unwrap();
        for file in ["phase.npy", "wrapped.npy", "mask.npy", "picture.png"] {
            assert!(
                read(&out, file) == read(&by_hand, file),
                "{name}: {file} differs"
            );
        }
        let known = files::flags(&out.join("mask.npy"));
        let known = known.iter().filter(|flag| **flag == 1).count();
        assert!(known > 200_000, "{name}: {known}");
    }
}
