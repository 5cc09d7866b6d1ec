//! Gray codes without fringes: imported, measured, and made into models.

use super::codes::{Code, HALF};
use super::gray;
use super::scene::{HEIGHT, Scene, WIDTH, import, lit_by, notes};
use crate::written::program;
use serde_json::Value;
use std::fs;
use tests::board::{self, poses};
use tests::{files, shared};

/// Options for codes of 9 and 8 bits with cells of one pixel, each picture followed by its inverse,
/// then white and black.
const OPTIONS: [&str; 8] = [
    "--gray",
    "9,8",
    "--gray-inverse",
    "--direction",
    "both",
    "--order",
    "gray,white,black",
    "--json",
];

fn codes(cell: f64, bits: [u32; 2]) -> Scene {
    let mut scene = Scene::new();
    gray(&mut scene, bits[0], cell, true);
    gray(&mut scene, bits[1], cell, false);
    scene.show(|_, _| 1.0);
    scene.show(|_, _| 0.0);
    scene
}

/// Mean and largest distance of known places from the projector's, and their number.
fn off(path: &std::path::Path, along: usize) -> (f64, f64, usize) {
    let map = files::array(path);
    assert_eq!((map.rows, map.columns), (HEIGHT, WIDTH));
    let known = map
        .elements
        .iter()
        .enumerate()
        .filter(|(_, place)| !place.is_nan());
    let (mut sum, mut most, mut count) = (0.0, 0.0_f64, 0);
    for (at, place) in known {
        let (xi, eta) = lit_by(at % WIDTH, at / WIDTH);
        let error = (f64::from(*place) - [xi, eta][along]).abs();
        (sum, most, count) = (sum + error, most.max(error), count + 1);
    }
    (sum / f64::from(count), most, count as usize)
}

#[test]
fn a_gray_code_alone_gives_column_and_row_within_half_a_cell_and_better_between_borders() {
    let scene = codes(1.0, [9, 8]);
    assert_eq!(notes(&scene.import(&OPTIONS).succeeded()), [""; 0]);
    let out = scene.measure();
    let report = files::report(&out);
    assert_eq!(report["kind"], "gray code alone");
    // The picture of a cell of one pixel is that of its middle, and the camera's pixel takes the
    // nearest.
    for (name, along) in [("column.npy", 0), ("row.npy", 1)] {
        let (_, most, count) = off(&out.join(name), along);
        assert!(
            most <= 0.501 && count == WIDTH * HEIGHT,
            "{name}: {most} {count}"
        );
    }
    // Cells of sixteen pixels are seen as six or seven: a border within one pixel is a place within
    // three.
    let scene = codes(16.0, [5, 4]);
    let options = [&OPTIONS[..], &["--gray-cell", "16"]].concat();
    let options: Vec<&str> = options
        .iter()
        .map(|word| if *word == "9,8" { "5,4" } else { *word })
        .collect();
    assert_eq!(notes(&scene.import(&options).succeeded()), [""; 0]);
    let out = scene.measure();
    for (name, along) in [("column.npy", 0), ("row.npy", 1)] {
        let (mean, most, count) = off(&out.join(name), along);
        assert!(
            mean < 1.5 && most < 8.6 && count == WIDTH * HEIGHT,
            "{name}: {mean} {most} {count}"
        );
    }
    let phase = files::array(&out.join("phase-0.npy")).elements;
    let column = files::array(&out.join("column.npy")).elements;
    // A turn is a cell.
    for (phase, column) in phase.iter().zip(&column) {
        assert!((phase * 16.0 - column).abs() < 1e-2, "{phase} {column}");
    }
    // Without anything to compare it with, and in the wrong order.
    let run = scene.import(&["--gray", "5"]);
    assert_eq!(run.code, 64, "{}", run.stderr);
    assert!(run.stderr.contains("--gray-inverse"), "{}", run.stderr);
    fs::remove_dir_all(scene.path("recording")).unwrap();
    let reversed = Scene::new();
    for at in 0..18 {
        let from = scene.path(&format!("pictures/pat{}.png", at ^ 1));
        fs::copy(from, reversed.path(&format!("pictures/pat{at}.png"))).unwrap();
    }
    for at in 18..20 {
        let name = format!("pictures/pat{at}.png");
        fs::copy(scene.path(&name), reversed.path(&name)).unwrap();
    }
    // Each inverse before its picture: dark is bright.
    let wrong = notes(&reversed.import(&options).succeeded());
    assert!(
        wrong
            .iter()
            .any(|note| note.contains("Gray code of columns") && note.contains("--gray-invert")),
        "{wrong:?}"
    );
}

/// A picture of a code of cells of one pixel under a lens that blurs over a projector pixel and a
/// half.
fn blurred(scene: &mut Scene, bits: u32, vertical: bool) {
    const SIGMA: f64 = 1.5;
    for bit in (0..bits).rev() {
        for inverse in [false, true] {
            let lit = |at: f64| {
                let cell = at.round() as u32;
                let set = (cell ^ cell >> 1) >> bit & 1 == 1;
                if set == inverse { 0.0 } else { 1.0 }
            };
            scene.show(|xi, eta| {
                let at = if vertical { xi } else { eta };
                let taps = (-30..=30).map(|tap| 0.2 * f64::from(tap));
                let (mut sum, mut weights) = (0.0, 0.0);
                for aside in taps {
                    let weight = (-aside * aside / (2.0 * SIGMA * SIGMA)).exp();
                    sum += weight * lit(at + aside);
                    weights += weight;
                }
                sum / weights
            });
        }
    }
}

#[test]
fn a_gray_code_whose_finest_bits_are_washed_out_is_read_by_the_others() {
    let mut scene = Scene::new();
    blurred(&mut scene, 9, true);
    blurred(&mut scene, 8, false);
    scene.show(|_, _| 1.0);
    scene.show(|_, _| 0.0);
    assert_eq!(notes(&scene.import(&OPTIONS).succeeded()), [""; 0]);
    let out = scene.measure();
    for (name, along) in [("column.npy", 0), ("row.npy", 1)] {
        let (mean, most, count) = off(&out.join(name), along);
        // The camera's pixels are two and a half cells apart, so that it sees few borders, and half
        // a cell of the eight finest bits is a pixel.
        assert!(
            mean < 0.4 && most < 1.6 && count > WIDTH * HEIGHT * 99 / 100,
            "{name}: {mean} {most} {count}"
        );
    }
}

#[test]
fn a_gray_code_alone_that_was_projected_otherwise_than_described_is_named_and_read_as_named() {
    let plain = Code {
        bits: 5,
        cell: 16.0,
        ..HALF
    };
    let lsb = Code { lsb: true, ..plain };
    let inverted = Code {
        inverted: true,
        ..plain
    };
    let binary = Code {
        binary: true,
        ..plain
    };
    // Where a code begins cannot be told from it alone.
    let moved = Code {
        offset: 8.0,
        ..plain
    };
    let stated = ["--gray", "5", "--gray-cell", "16", "--json"];
    let stated = [&stated[..], &["--order", "gray,white,black"]].concat();
    for (code, named, is_seen) in [
        (lsb, &["--gray-order", "lsb"][..], true),
        (inverted, &["--gray-invert"], true),
        (binary, &["--gray-binary"], true),
        (moved, &["--gray-offset", "8"], false),
    ] {
        let mut scene = Scene::new();
        code.show(&mut scene);
        scene.show(|_, _| 1.0);
        scene.show(|_, _| 0.0);
        let said = notes(&scene.import(&stated).succeeded());
        fs::remove_dir_all(scene.path("recording")).unwrap();
        let remedy = format!("give {}", named.join(" "));
        let is_named = said.iter().any(|note| note.ends_with(&remedy));
        assert_eq!(is_named, is_seen, "{remedy}: {said:?}");
        let options = [&stated[..], named].concat();
        assert_eq!(notes(&scene.import(&options).succeeded()), [""; 0]);
        let (mean, most, count) = off(&scene.measure().join("column.npy"), 0);
        assert!(
            mean < 1.5 && most < 8.6 && count == WIDTH * HEIGHT,
            "{remedy}: {mean} {most} {count}"
        );
    }
}

#[test]
fn models_are_made_of_five_poses_of_a_board_under_a_gray_code_alone() {
    let folder = tempfile::tempdir().unwrap();
    let mut recordings = Vec::new();
    for (at, pose) in poses()[1..].iter().enumerate() {
        let pictures = folder.path().join(format!("pictures-{at}"));
        board::write_codes(pose, at as u64, 2.0, &pictures);
        let recording = folder.path().join(format!("pose-{at}"));
        let options = ["--gray", "9,8", "--gray-cell", "2"];
        let options = [&OPTIONS[2..], &options].concat();
        import(&pictures, &recording, "640x480", &options).succeeded();
        recordings.push(recording);
    }
    let out = folder.path().join("calibration.json");
    let mut arguments = vec!["calibrate", "--json", "--board", "checker:6x8:10"];
    arguments.extend(["--out", out.to_str().unwrap(), "--poses"]);
    arguments.extend(recordings.iter().map(|path| path.to_str().unwrap()));
    let run = program().run(&arguments).succeeded();
    let report: Value = serde_json::from_str(&run.stdout).unwrap();
    let number = |value: &Value| value.as_f64().unwrap();
    assert!(
        number(&report["camera_px"]) < 0.1,
        "{}",
        report["camera_px"]
    );
    assert!(
        number(&report["projector_px"]) < 0.3,
        "{}",
        report["projector_px"]
    );
    let found = &report["calibration"];
    for (device, focal) in [("camera", board::FOCAL.0), ("projector", board::FOCAL.1)] {
        let fx = number(&found[device]["model"]["fx"]);
        assert!((fx / focal - 1.0).abs() < 5e-3, "{device}: {fx}");
    }
    // What is made of them measures the board again.
    let heights = folder.path().join("heights");
    let calibration = ["--calibration", out.to_str().unwrap()];
    program()
        .measure(&recordings[4], &heights, &calibration)
        .succeeded();
    let report = files::report(&heights);
    // 0.29 of a cell of 0.9 mm, seen at an angle of 20°.
    assert!(
        (0.3..1.2).contains(&number(&report["sigma_mm"])),
        "{report}"
    );
    let heights = files::array(&heights.join("height.npy")).elements;
    let mut known: Vec<f32> = heights.into_iter().filter(|z| z.is_finite()).collect();
    known.sort_by(f32::total_cmp);
    assert!(known.len() > 20_000, "{}", known.len());
    let median = known[known.len() / 2];
    assert!(median.abs() < 0.1, "{median}");
}

#[test]
fn a_shared_gray_code_alone_gives_its_columns() {
    let Some(case) = shared::case("08-gray-only") else {
        return;
    };
    let place = tempfile::tempdir().unwrap();
    let (recording, out) = (place.path().join("recording"), place.path().join("out"));
    let options = ["--gray", "10", "--gray-cell", "1", "--gray-inverse"];
    let options = [&options[..], &["--order", "gray,white,black", "--json"]].concat();
    let run = import(&case.join("frames"), &recording, "640x400", &options).succeeded();
    assert_eq!(notes(&run), [""; 0]);
    program().measure(&recording, &out, &[]).succeeded();
    let found = files::array(&out.join("column.npy")).elements;
    let bytes = fs::read(case.join("expected_column.npy")).unwrap();
    let expected = hal::npy::read::<i16>(&bytes).unwrap().elements;
    assert_eq!(found.len(), expected.len());
    for (found, expected) in found.iter().zip(expected) {
        assert!(
            (found - f32::from(expected)).abs() <= 0.501,
            "{found} {expected}"
        );
    }
}
