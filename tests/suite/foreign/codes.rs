//! Gray codes beside fringes: read as they were projected, and named where they are described
//! otherwise.

use super::scene::{HEIGHT, PROJECTOR, Scene, WIDTH, check_phase, lit_by, notes};
use std::f64::consts::TAU;
use std::fs;
use tests::files;

/// How a code of vertical fringes is projected.
#[derive(Clone, Copy)]
pub struct Code {
    pub bits: u32,
    pub cell: f64,
    pub offset: f64,
    pub lsb: bool,
    pub binary: bool,
    pub inverted: bool,
}

/// The options that describe a code of four bits with cells of so many pixels beside eight fringes.
const fn options(cell: &str) -> [&str; 8] {
    [
        "--fringes",
        "8",
        "--convention",
        "cos",
        "--gray",
        "4",
        "--gray-cell",
        cell,
    ]
}

pub const HALF: Code = Code {
    bits: 4,
    cell: 25.0,
    offset: 0.0,
    lsb: false,
    binary: false,
    inverted: false,
};

impl Code {
    pub fn show(self, scene: &mut Scene) {
        for at in 0..self.bits {
            let bit = if self.lsb { at } else { self.bits - 1 - at };
            scene.show(|xi, _| {
                // Pixel centres are at whole numbers.
                let cell = ((xi.round() + 0.5 + self.offset) / self.cell).floor() as u32;
                let word = if self.binary { cell } else { cell ^ cell >> 1 };
                f64::from(u8::from((word >> bit & 1 == 1) != self.inverted))
            });
        }
    }
}

/// Pictures of a cosine of so many fringes, four shifts from the first one, with the code.
fn scene(fringes: f64, first: f64, code: Code) -> Scene {
    let mut scene = Scene::new();
    scene.level(fringes, 4, |k| k + first);
    code.show(&mut scene);
    scene
}

/// What an import says with these options, beside those of the levels.
fn said(scene: &Scene, options: &[&str]) -> Vec<String> {
    let run = scene.import(&[options, &["--json"]].concat()).succeeded();
    fs::remove_dir_all(scene.path("recording")).unwrap();
    notes(&run)
}

/// Imports without a finding, and checks that all but a few pixels of the picture have the right
/// phase; none has a wrong one.
fn is_right(scene: &Scene, options: &[&str], pitch: f64) {
    let run = scene.import(&[options, &["--json"]].concat()).succeeded();
    assert_eq!(notes(&run), [""; 0], "{options:?}");
    let out = scene.measure();
    let count = check_phase(&out.join("phase.npy"), pitch, |u, v| lit_by(u, v).0, 0.6);
    let all = WIDTH * HEIGHT;
    assert!(count > all * 95 / 100, "{options:?}: {count} of {all}");
}

#[test]
fn a_code_that_was_projected_otherwise_than_described_is_named_and_read_as_named() {
    let fringe = Code { cell: 50.0, ..HALF };
    let lsb = Code { lsb: true, ..HALF };
    let inverted = Code {
        inverted: true,
        ..HALF
    };
    let binary = Code {
        binary: true,
        ..HALF
    };
    let shifted = Code {
        offset: 25.0,
        ..fringe
    };
    let both = Code {
        lsb: true,
        ..inverted
    };
    let wide = Code { cell: 26.0, ..HALF };
    let (half, whole) = (options("25"), options("50"));
    for (code, stated, named) in [
        (lsb, half, &["--gray-order", "lsb"][..]),
        (inverted, half, &["--gray-invert"]),
        (both, half, &["--gray-order", "lsb", "--gray-invert"]),
        (binary, half, &["--gray-binary"]),
        (shifted, whole, &["--gray-offset", "25"]),
        (wide, half, &["--gray-cell", "26"]),
    ] {
        let scene = scene(8.0, 0.0, code);
        let words = said(&scene, &stated);
        let option = named.join(" ");
        assert!(
            words.len() == 1 && words[0].contains(&option),
            "{option}: {words:?}"
        );
        let stated: Vec<&str> = match named[0] {
            "--gray-cell" => stated[..6].to_vec(),
            _ => stated.to_vec(),
        };
        is_right(&scene, &[&stated[..], named].concat(), 50.0);
    }
    // The code of half fringes as described, and of whole fringes.
    is_right(&scene(8.0, 0.0, HALF), &half, 50.0);
    is_right(&scene(8.0, 0.0, fringe), &whole, 50.0);
}

/// Code and fringes of the columns, then those of the rows.
#[test]
fn codes_and_fringes_that_are_projected_direction_by_direction_are_read() {
    let mut scene = Scene::new();
    for vertical in [true, false] {
        for bit in (0..4).rev() {
            scene.show(|xi, eta| {
                let at = if vertical { xi } else { eta };
                let cell = ((at.round() + 0.5) / HALF.cell).floor() as u32;
                f64::from((cell ^ cell >> 1) >> bit & 1)
            });
        }
        for k in 0..4 {
            // Periods of two cells.
            scene.show(|xi, eta| {
                let at = if vertical { xi } else { eta };
                0.5 + 0.5 * (TAU * (at / (2.0 * HALF.cell) + f64::from(k) / 4.0)).cos()
            });
        }
    }
    let run = |order| {
        let described = [
            "--pitch",
            "50",
            "--convention",
            "cos",
            "--gray",
            "4",
            "--gray-cell",
            "25",
            "--direction",
            "both",
            "--json",
            "--order",
            order,
        ];
        scene.import(&described)
    };
    let refused = run("gray,sine,gray,sine,sine");
    assert_eq!(refused.code, 64, "{}", refused.stderr);
    assert!(
        refused.stderr.contains("once for each direction"),
        "{}",
        refused.stderr
    );
    assert_eq!(notes(&run("gray,sine,gray,sine").succeeded()), [""; 0]);
    let out = scene.measure();
    for (name, along) in [("phase-0.npy", 0), ("phase-1.npy", 1)] {
        let place = |u, v| [lit_by(u, v).0, lit_by(u, v).1][along];
        let count = check_phase(&out.join(name), 50.0, place, 0.6);
        assert!(count > WIDTH * HEIGHT * 95 / 100, "{name}: {count}");
    }
}

#[test]
fn other_fringes_than_described_beside_a_code_are_named() {
    let twice = scene(16.0, 0.0, HALF);
    let options = ["--convention", "cos", "--gray", "4", "--gray-cell", "25"];
    let words = said(&twice, &[&options[..], &["--fringes", "8"]].concat());
    assert!(
        words.len() == 1 && words[0].contains("--fringes 16"),
        "{words:?}"
    );
    is_right(&twice, &[&options[..], &["--fringes", "16"]].concat(), 25.0);
}

#[test]
fn the_first_shift_and_its_sign_are_named_beside_a_code() {
    let code = ["--fringes", "8", "--gray", "4", "--gray-cell", "25"];
    let dark = scene(8.0, 0.5, HALF);
    for stated in ["sin", "cos"] {
        let options = [&code[..], &["--convention", stated]].concat();
        let words = said(&dark, &options);
        let named = "give --convention cos --shift + --first-shift 0.5";
        assert!(
            words.len() == 1 && words[0].contains(named),
            "{stated}: {words:?}"
        );
    }
    let right = ["--convention", "cos", "--first-shift", "0.5"];
    is_right(&dark, &[&code[..], &right].concat(), 50.0);
    let mut falling = Scene::new();
    falling.level(8.0, 4, |k| 0.5 - k);
    HALF.show(&mut falling);
    let words = said(&falling, &code);
    let named = "give --convention cos --shift - --first-shift 0.5";
    assert!(words[0].contains(named), "{words:?}");
    let right = [
        "--convention",
        "cos",
        "--shift",
        "-",
        "--first-shift",
        "0.5",
    ];
    is_right(&falling, &[&code[..], &right].concat(), 50.0);
}

#[test]
fn codes_of_columns_and_of_rows_have_cells_of_their_own() {
    let mut scene = Scene::new();
    scene.level(8.0, 4, |k| k);
    for k in 0..4 {
        scene.show(|_, eta| {
            let turns = 8.0 * eta / f64::from(PROJECTOR.1) + f64::from(k) / 4.0;
            0.5 + 0.5 * (TAU * turns).cos()
        });
    }
    for (cell, vertical) in [(25.0, true), (15.0, false)] {
        for bit in (0..4).rev() {
            scene.show(|xi, eta| {
                let at = if vertical { xi } else { eta };
                let cell = ((at.round() + 0.5) / cell).floor() as u32;
                f64::from((cell ^ cell >> 1) >> bit & 1)
            });
        }
    }
    let code = [
        "--fringes",
        "8",
        "--convention",
        "cos",
        "--direction",
        "both",
        "--gray",
        "4,4",
    ];
    let words = said(&scene, &[&code[..], &["--gray-cell", "25"]].concat());
    assert!(
        words.len() == 1
            && words[0].starts_with("horizontal")
            && words[0].contains("--gray-cell 25,15"),
        "{words:?}"
    );
    is_right(
        &scene,
        &[&code[..], &["--gray-cell", "25,15"]].concat(),
        50.0,
    );
    let out = scene.path("out");
    let count = check_phase(&out.join("phase-1.npy"), 30.0, |u, v| lit_by(u, v).1, 0.6);
    assert!(count > WIDTH * HEIGHT * 95 / 100, "{count}");
}

#[test]
fn a_measurement_repeats_what_the_import_found() {
    let inverted = Code {
        inverted: true,
        ..HALF
    };
    let scene = scene(8.0, 0.0, inverted);
    let code = options("25");
    scene.import(&code).succeeded();
    let (recording, out) = (scene.path("recording"), scene.path("out"));
    let run = crate::written::program().measure(&recording, &out, &[]);
    let lines = run.succeeded().stdout;
    let line = lines.lines().find(|line| line.starts_with("looks wrong"));
    assert!(
        line.is_some_and(|line| line.contains("--gray-invert")),
        "{lines}"
    );
    let report = files::report(&out);
    assert!(
        report["notes"][0]
            .as_str()
            .unwrap()
            .contains("--gray-invert"),
        "{report}"
    );
    fs::remove_dir_all(&recording).unwrap();
    scene
        .import(&[&code[..], &["--gray-invert"]].concat())
        .succeeded();
    let again = crate::written::program().measure(&recording, &out, &[]);
    assert!(!again.succeeded().stdout.contains("looks wrong"));
    assert!(files::report(&out)["notes"].is_null());
}
