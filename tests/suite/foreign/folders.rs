//! What lies in folders of pictures: JPEG, stacks, companions, two cameras, names in another order.

use super::scene::{HEIGHT, PROJECTOR, Scene, WIDTH, check_phase, import, lit_by, notes};
use crate::written::{Written, geometric, program};
use std::f64::consts::TAU;
use std::fs;
use std::io::Cursor;
use tests::{files, shared};

/// Levels of 1, 6 and 36 fringes, described by these options.
const OPTIONS: [&str; 5] = ["--fringes", "1,6,36", "--convention", "cos", "--json"];
const PICTURES: usize = 12;

fn levels() -> Scene {
    let mut scene = Scene::new();
    for fringes in [1.0, 6.0, 36.0] {
        scene.level(fringes, 4, |k| k);
    }
    scene
}

fn grey(scene: &Scene, at: usize) -> Vec<u8> {
    let picture = files::picture(&scene.path(&format!("pictures/pat{at}.png")));
    picture.samples.iter().map(|&sample| sample as u8).collect()
}

/// Imports without a word but those of `expected`, measures, and returns how many pixels are within
/// `bound` projector pixels.
fn right(scene: &Scene, expected: &[&str], bound: f64) -> usize {
    let run = scene.import(&OPTIONS).succeeded();
    let found = notes(&run);
    assert_eq!(found.len(), expected.len(), "{found:?}");
    for (note, words) in found.iter().zip(expected) {
        assert!(note.contains(words), "{note}");
    }
    let pitch = f64::from(PROJECTOR.0) / 36.0;
    let column = |u, v| lit_by(u, v).0;
    check_phase(&scene.measure().join("phase.npy"), pitch, column, bound)
}

#[test]
fn jpeg_is_read_and_what_its_compression_costs_is_said() {
    let scene = levels();
    for at in 0..PICTURES {
        let mut file = Vec::new();
        let encoder = jpeg_encoder::Encoder::new(&mut file, 92);
        let (width, height) = (WIDTH as u16, HEIGHT as u16);
        let colour = jpeg_encoder::ColorType::Luma;
        encoder
            .encode(&grey(&scene, at), width, height, colour)
            .unwrap();
        fs::remove_file(scene.path(&format!("pictures/pat{at}.png"))).unwrap();
        let ending = if at % 2 == 0 { "jpg" } else { "JPEG" };
        fs::write(scene.path(&format!("pictures/pat{at}.{ending}")), file).unwrap();
    }
    let resolved = right(&scene, &["JPEG"], 0.6);
    assert!(resolved > WIDTH * HEIGHT * 98 / 100, "{resolved}");
    // A file that is cut off is refused by its name.
    fs::remove_dir_all(scene.path("recording")).unwrap();
    let whole = fs::read(scene.path("pictures/pat4.jpg")).unwrap();
    fs::write(scene.path("pictures/pat4.jpg"), &whole[..whole.len() / 2]).unwrap();
    let run = scene.import(&OPTIONS);
    assert_eq!(run.code, 65, "{}", run.stderr);
    assert!(run.stderr.contains("pat4.jpg"), "{}", run.stderr);
}

#[test]
fn each_page_of_a_tiff_is_a_picture_and_a_page_too_few_is_said() {
    let scene = levels();
    let stack = |pages: usize| {
        let mut file = Cursor::new(Vec::new());
        let mut encoder = tiff::encoder::TiffEncoder::new(&mut file).unwrap();
        for at in 0..pages {
            let grey = grey(&scene, at);
            let (width, height) = (WIDTH as u32, HEIGHT as u32);
            encoder
                .write_image::<tiff::encoder::colortype::Gray8>(width, height, &grey)
                .unwrap();
        }
        file.into_inner()
    };
    let (whole, short) = (stack(PICTURES), stack(PICTURES - 1));
    for at in 0..PICTURES {
        fs::remove_file(scene.path(&format!("pictures/pat{at}.png"))).unwrap();
    }
    fs::write(scene.path("pictures/stack.tif"), short).unwrap();
    let run = scene.import(&OPTIONS);
    assert_eq!(run.code, 65, "{}", run.stderr);
    let words = "11 pictures (stack.tif page 1 to stack.tif page 11), but the options describe 12";
    assert!(run.stderr.contains(words), "{}", run.stderr);
    fs::write(scene.path("pictures/stack.tif"), whole).unwrap();
    let resolved = right(&scene, &[], 0.5);
    assert!(resolved > WIDTH * HEIGHT * 99 / 100, "{resolved}");
}

#[test]
fn hidden_companions_of_pictures_are_no_pictures() {
    let scene = levels();
    for at in 0..PICTURES {
        // As macOS writes it: a header without a picture.
        let companion = scene.path(&format!("pictures/._pat{at}.png"));
        fs::write(companion, b"\x00\x05\x16\x07\x00\x02\x00\x00Mac OS X").unwrap();
    }
    let resolved = right(&scene, &[], 0.5);
    assert!(resolved > WIDTH * HEIGHT * 99 / 100, "{resolved}");
}

#[test]
fn a_recording_with_a_byte_order_mark_is_measured() {
    let written = Written::new(&geometric().record());
    let text = fs::read_to_string(written.manifest()).unwrap();
    fs::write(written.manifest(), format!("\u{feff}{text}")).unwrap();
    written.measure(&[]).succeeded();
    assert!(files::report(&written.out())["resolved"].as_u64() > Some(7000));
}

#[test]
fn pictures_of_rows_before_those_of_columns_are_noticed_and_can_be_described() {
    let mut scene = Scene::new();
    let mut names = Vec::new();
    for (letter, vertical) in [("V", true), ("H", false)] {
        for fringes in [1.0, 6.0] {
            for k in 0..4 {
                scene.show(|xi, eta| {
                    let (at, length) = if vertical { (xi, 400.0) } else { (eta, 240.0) };
                    0.5 + 0.5 * (TAU * (fringes * at / length + f64::from(k) / 4.0)).cos()
                });
                names.push(format!("{letter}{fringes}_{k}.png"));
            }
        }
    }
    for (at, name) in names.iter().enumerate() {
        let from = scene.path(&format!("pictures/pat{at}.png"));
        fs::rename(from, scene.path("pictures").join(name)).unwrap();
    }
    let import = |direction: &str| {
        let options = ["--fringes", "1,6", "--convention", "cos", "--json"];
        let options = [&options[..], &["--direction", direction]].concat();
        scene.import(&options).succeeded()
    };
    let wrong = notes(&import("both"));
    assert!(
        wrong
            .iter()
            .any(|note| note.contains("give --direction horizontal-first")),
        "{wrong:?}"
    );
    fs::remove_dir_all(scene.path("recording")).unwrap();
    assert_eq!(notes(&import("horizontal-first")), [""; 0]);
    let out = scene.measure();
    for (file, pitch, along) in [("phase-0.npy", 40.0, 1), ("phase-1.npy", 400.0 / 6.0, 0)] {
        let place = |u, v| [lit_by(u, v).0, lit_by(u, v).1][along];
        let resolved = check_phase(&out.join(file), pitch, place, 0.6);
        assert!(resolved > WIDTH * HEIGHT * 99 / 100, "{file}: {resolved}");
    }
    // Rows alone, said to be columns.
    fs::remove_dir_all(scene.path("recording")).unwrap();
    let options = [
        "--fringes",
        "1,6",
        "--convention",
        "cos",
        "--json",
        "--name",
        "H*",
    ];
    let wrong = notes(&scene.import(&options).succeeded());
    let words = "if they are horizontal ones, give --direction horizontal";
    assert!(wrong.iter().any(|note| note.contains(words)), "{wrong:?}");
}

#[test]
fn pictures_of_two_cameras_are_refused_with_the_names_that_choose_one() {
    let scene = levels();
    for at in 0..PICTURES {
        let path = |name: &str| scene.path("pictures").join(name);
        let (from, other) = (path(&format!("pat{at}.png")), path("other"));
        fs::copy(&from, &other).unwrap();
        fs::rename(&from, path(&format!("{at:02}-left.png"))).unwrap();
        fs::rename(&other, path(&format!("{at:02}-right.png"))).unwrap();
    }
    let run = scene.import(&OPTIONS);
    assert_eq!(run.code, 65, "{}", run.stderr);
    let words = "pictures of 2 cameras: choose one with --name *-left or --name *-right";
    assert!(run.stderr.contains(words), "{}", run.stderr);
    let options = [&OPTIONS[..], &["--name", "*-left"]].concat();
    assert_eq!(notes(&scene.import(&options).succeeded()), [""; 0]);
    fs::remove_dir_all(scene.path("recording")).unwrap();
    let options = [&OPTIONS[..], &["--name", "*-top"]].concat();
    let run = scene.import(&options);
    assert_eq!(run.code, 65, "{}", run.stderr);
    assert!(
        run.stderr.contains("no picture whose name fits \"*-top\""),
        "{}",
        run.stderr
    );
}

#[test]
fn shared_folders_of_pictures_are_imported_whatever_else_lies_there() {
    let Some(case) = shared::case("09-folder-contents") else {
        return;
    };
    let place = tempfile::tempdir().unwrap();
    for (folder, expected) in [("apple", 0), ("stack", 0), ("jpeg", 1)] {
        let recording = place.path().join(folder);
        let options = ["--fringes", "1,8,64", "--steps", "4", "--json"];
        let run = import(&case.join(folder), &recording, "640x400", &options).succeeded();
        let report: serde_json::Value = serde_json::from_str(&run.stdout).unwrap();
        assert_eq!(report["frames"], 12, "{folder}");
        let words = notes(&run).into_iter().filter(|note| note.contains("JPEG"));
        assert_eq!(words.count(), expected, "{folder}: {:?}", notes(&run));
    }
    if let Some(case) = shared::case("11-bom-recording") {
        let out = place.path().join("out");
        program()
            .measure(&case.join("recording"), &out, &[])
            .succeeded();
    }
}
