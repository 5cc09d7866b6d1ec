//! Models of other programs beside imported pictures: without a plate, with a plate that is turned,
//! and models that the fringes contradict.

use super::scene::{import, notes};
use crate::written::{Written, program};
use hal::model::DeviceModel;
use hal::replay::Recording;
use hal::replay::recording::PatternSpec;
use serde_json::{Value, json};
use std::fs;
use std::path::PathBuf;
use tests::program::Run;
use tests::render::{Scene, levels};
use tests::{files, shared};

/// A tilted plane with a bump under fringes of both directions, and options that describe them.
fn rendered() -> Recording {
    Scene {
        patterns: vec![
            PatternSpec::Vertical { fringes: 50.0 },
            PatternSpec::Horizontal { fringes: 40.0 },
        ],
        patches: false,
        ..Scene::new(50.0, levels(&[0.02, 0.14, 1.0], 4))
    }
    .record()
}
const OPTIONS: [&str; 6] = [
    "--fringes",
    "1,7,50/0.8,5.6,40",
    "--direction",
    "both",
    "--unit",
    "mm",
];

/// The rendered recording, and imports of its frames with the models that are written for it.
struct Imports {
    written: Written,
    recording: Recording,
    folder: tempfile::TempDir,
}

/// Both models in one file, as Python's json.dump writes them: R and T from the camera to the
/// projector, and the camera's pose as that of the plate.
fn stereo(camera: &DeviceModel, projector: &DeviceModel) -> Value {
    let rows = |numbers: &[f64; 9]| numbers.chunks(3).map(Vec::from).collect::<Vec<_>>();
    let k = |of: &DeviceModel| json!([[of.fx, 0, of.cx], [0, of.fy, of.cy], [0, 0, 1]]);
    let (c, p) = (&camera.rotation, &projector.rotation);
    let r: [f64; 9] =
        std::array::from_fn(|at| (0..3).map(|k| p[at / 3 * 3 + k] * c[at % 3 * 3 + k]).sum());
    let t: [f64; 3] = std::array::from_fn(|row| {
        let moved: f64 = (0..3)
            .map(|k| r[3 * row + k] * camera.translation_mm[k])
            .sum();
        projector.translation_mm[row] - moved
    });
    json!({
        "cam_int": k(camera), "cam_dist": [camera.distortion],
        "proj_int": k(projector), "proj_dist": [projector.distortion],
        "rotation": rows(&r), "translation": t.map(|length| [length]),
        "plate_R": rows(c), "plate_T": camera.translation_mm,
    })
}

impl Imports {
    fn new() -> Self {
        let recording = rendered();
        Self {
            written: Written::new(&recording),
            recording,
            folder: tempfile::tempdir().unwrap(),
        }
    }

    fn stereo(&self) -> Value {
        let models = self.recording.camera_model.as_ref();
        let (camera, projector) = models.zip(self.recording.projector.model.as_ref()).unwrap();
        stereo(camera, projector)
    }

    fn imported(&self) -> PathBuf {
        self.folder.path().join("imported")
    }

    fn run(&self, models: &Value, more: &[&str]) -> Run {
        let _ = fs::remove_dir_all(self.imported());
        let file = self.folder.path().join("models.json");
        fs::write(&file, models.to_string()).unwrap();
        let options = [
            &OPTIONS[..],
            &["--json", "--models", file.to_str().unwrap()],
            more,
        ]
        .concat();
        let frames = self.written.recording().join("frames");
        import(&frames, &self.imported(), "256x192", &options)
    }

    /// The points that are measured, in the camera's frame.
    fn cloud(&self, recording: PathBuf) -> Vec<[f64; 3]> {
        let out = self.folder.path().join("out");
        let run = program().measure(&recording, &out, &["--axes", "camera"]);
        run.succeeded();
        let vertices = files::cloud(&out.join("cloud.ply"));
        let points = vertices.iter().map(|vertex| vertex.point.map(f64::from));
        points.collect()
    }
}

#[test]
fn models_without_a_plate_give_the_same_cloud_in_the_camera_s_frame_wherever_the_plane_is() {
    let imports = Imports::new();
    let truth = imports.cloud(imports.written.recording());
    let mut models = imports.stereo();
    assert_eq!(notes(&imports.run(&models, &[]).succeeded()), [""; 0]);
    for name in ["plate_R", "plate_T"] {
        models.as_object_mut().unwrap().remove(name);
    }
    let range = ["--range", "-150,150"];
    for more in [&["--plane-at", "600"][..], &[]] {
        let run = imports
            .run(&models, &[&range[..], more].concat())
            .succeeded();
        let words = notes(&run);
        match more.is_empty() {
            false => assert_eq!(words, [""; 0]),
            true => assert!(
                words.len() == 1 && words[0].contains("fits the measured points best"),
                "{words:?}"
            ),
        }
        let cloud = imports.cloud(imports.imported());
        assert_eq!(cloud.len(), truth.len());
        for (found, expected) in cloud.iter().zip(&truth) {
            for (found, expected) in found.iter().zip(expected) {
                assert!((found - expected).abs() < 2e-3, "{found} {expected}");
            }
        }
        if more.is_empty() {
            // Most of the surface is a plane, so most heights are 0.
            let report = files::report(&imports.folder.path().join("out"));
            let [low, high] = [0, 1].map(|at| report["height_mm"][at].as_f64().unwrap());
            assert!(low > -3.0 && (4.0..15.0).contains(&high), "{low} {high}");
        }
    }
    let run = imports.run(&imports.stereo(), &["--plane-at", "600"]);
    assert_eq!(run.code, 65, "{}", run.stderr);
    assert!(
        run.stderr.contains("leave out --plane-at"),
        "{}",
        run.stderr
    );
}

#[test]
fn a_plate_whose_z_points_away_is_refused_at_import_with_the_option_that_turns_it() {
    let imports = Imports::new();
    let mut models = imports.stereo();
    // As OpenCV has it: y down and z into the board.
    for row in models["plate_R"].as_array_mut().unwrap() {
        for at in [1, 2] {
            row[at] = json!(-row[at].as_f64().unwrap());
        }
    }
    let run = imports.run(&models, &[]);
    assert_eq!(run.code, 65, "{}", run.stderr);
    assert!(run.stderr.contains("add --z-away"), "{}", run.stderr);
    assert!(!imports.imported().exists());
    let run = imports.run(&models, &["--z-away"]).succeeded();
    assert_eq!(notes(&run), [""; 0]);
    if let Some(case) = shared::case("10-z-away-at-import") {
        let options = ["--fringes", "1,8,64", "--steps", "4", "--unit", "mm"];
        let model = case.join("board-z-into.yml");
        let options = [&options[..], &["--models", model.to_str().unwrap()]].concat();
        let out = imports.folder.path().join("case");
        let run = import(&case.join("frames"), &out, "640x400", &options);
        assert_eq!(run.code, 65, "{}", run.stderr);
        assert!(run.stderr.contains("add --z-away"), "{}", run.stderr);
    }
}

/// Numbers of a JSON matrix, changed by their row and column.
fn change(matrix: &mut Value, by: impl Fn(usize, usize, f64) -> f64) {
    for (row, numbers) in matrix.as_array_mut().unwrap().iter_mut().enumerate() {
        for (column, number) in numbers.as_array_mut().unwrap().iter_mut().enumerate() {
            *number = json!(by(row, column, number.as_f64().unwrap()));
        }
    }
}

#[test]
fn models_that_contradict_fringes_of_both_directions_are_named_with_what_would_fit() {
    let imports = Imports::new();
    let named = |models: &Value, words: &str| {
        let found = notes(&imports.run(models, &[]).succeeded());
        assert!(
            found
                .iter()
                .any(|note| note.contains("epipolar") && note.contains(words)),
            "{words}: {found:?}"
        );
    };
    let right = imports.stereo();
    let mut inverse = right.clone();
    let r = |row: usize, column: usize| right["rotation"][row][column].as_f64().unwrap();
    let t = |row: usize| right["translation"][row][0].as_f64().unwrap();
    change(&mut inverse["rotation"], |row, column, _| r(column, row));
    change(&mut inverse["translation"], |row, _, _| {
        -(0..3).map(|k| r(k, row) * t(k)).sum::<f64>()
    });
    named(&inverse, "R and T are from the projector to the camera");
    let mut transposed = right.clone();
    change(&mut transposed["rotation"], |row, column, _| r(column, row));
    let mut centre = right.clone();
    change(&mut centre["translation"], |row, _, _| {
        -(0..3).map(|k| r(k, row) * t(k)).sum::<f64>()
    });
    for (models, words) in [
        (transposed, "R is transposed: exchange its rows and columns"),
        (
            centre,
            "T is the place of the projector's centre: give −R T",
        ),
    ] {
        let mut without_plate = models.clone();
        for name in ["plate_R", "plate_T"] {
            without_plate.as_object_mut().unwrap().remove(name);
        }
        for (models, more) in [
            (&models, &[][..]),
            (&without_plate, &[]),
            (&without_plate, &["--plane-at", "600"]),
        ] {
            let run = imports.run(models, more);
            let said = format!("{}{}", run.stdout, run.stderr);
            assert!(said.contains(words), "{words}: {said}");
        }
    }
    for (device, words) in [
        ("cam_int", "the camera's model is of half"),
        ("proj_int", "the projector's model is of half"),
    ] {
        let mut half = right.clone();
        change(&mut half[device], |row, _, number| {
            if row < 2 { number / 2.0 } else { number }
        });
        named(&half, words);
    }
    let mut from_one = right.clone();
    change(&mut from_one["cam_int"], |row, column, number| {
        if row < 2 && column == 2 {
            number + 1.0
        } else {
            number
        }
    });
    named(&from_one, "the camera's pixels are counted from 1");
    if let Some(case) = shared::case("05-models-contradict-second-direction") {
        for (file, wrong) in [("inverse.yml", true), ("right.yml", false)] {
            let options = [
                "--fringes",
                "1,8,64",
                "--direction",
                "both",
                "--unit",
                "mm",
                "--json",
            ];
            let model = case.join(file);
            let options = [&options[..], &["--models", model.to_str().unwrap()]].concat();
            let out = imports.folder.path().join(file);
            let run = import(&case.join("frames"), &out, "640x400", &options).succeeded();
            let said = notes(&run)
                .iter()
                .any(|note| note.contains("from the projector to the camera"));
            assert_eq!(said, wrong, "{file}: {:?}", notes(&run));
        }
    }
}

#[test]
fn a_rotation_to_three_digits_is_made_one_and_it_is_said() {
    let imports = Imports::new();
    let mut models = imports.stereo();
    // What rounding can leave.
    change(&mut models["rotation"], |_, _, number| number * 1.0003);
    let found = notes(&imports.run(&models, &[]).succeeded());
    assert!(
        found
            .iter()
            .any(|note| note.contains("rotation") && note.contains("digits")),
        "{found:?}"
    );
    change(&mut models["rotation"], |_, _, number| number * 1.01);
    let run = imports.run(&models, &[]);
    assert_eq!(run.code, 65, "{}", run.stderr);
    assert!(
        run.stderr.contains("not a rotation matrix"),
        "{}",
        run.stderr
    );
}
