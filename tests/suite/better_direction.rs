//! Heights go by the fringes that tell them, wherever the projector stands.

use crate::written::{Written, laboratory, program};
use hal::model::DeviceModel;
use hal::replay::Recording;
use hal::replay::recording::PatternSpec;
use serde_json::{Value, json};
use std::fs;
use tests::render::{Scene, levels};
use tests::small_head::SMALL_HEAD;
use tests::{files, rig, shared};

/// Fringes along columns and rows, of about one pitch.
const FRINGES: [f64; 2] = [36.0, 27.0];
const BOTH: [PatternSpec; 2] = [
    PatternSpec::Vertical {
        fringes: FRINGES[0],
    },
    PatternSpec::Horizontal {
        fringes: FRINGES[1],
    },
];

/// A projector above the camera or beside it, with these patterns.
fn recorded(above: bool, patterns: &[PatternSpec]) -> Recording {
    let levels = levels(&[0.94 / 36.0, 0.16, 1.0], 4);
    let scene = Scene {
        patterns: patterns.to_vec(),
        patches: false,
        above,
        ..Scene::new(0.0, levels)
    };
    scene.record()
}

fn measured(recording: &Recording) -> (Value, String) {
    let written = Written::new(recording);
    let run = written.measure(&[]).succeeded();
    (files::report(&written.out()), run.stdout)
}

#[test]
fn heights_are_by_the_direction_that_tells_them_in_whatever_order_the_patterns_are() {
    for (above, wanted) in [(true, "horizontal"), (false, "vertical")] {
        for reversed in [false, true] {
            let mut patterns = BOTH.to_vec();
            if reversed {
                patterns.reverse();
            }
            let (report, table) = measured(&recorded(above, &patterns));
            assert_eq!(report["heights_by"], wanted, "{report}");
            assert!(report["poor_heights"].is_null(), "{report}");
            assert!(table.contains(wanted), "{table}");
            let score = &report["score"];
            let (rms, sigma) = (&score["rms_mm"], &report["sigma_mm"]);
            let share = rms.as_f64().unwrap() / sigma.as_f64().unwrap();
            assert!((0.8..1.2).contains(&share), "{score} {sigma}");
            assert_eq!(score["gross"], 0, "{score}");
        }
    }
}

#[test]
fn fringes_along_the_epipolar_lines_alone_are_said_to_tell_little() {
    let (report, table) = measured(&recorded(true, &BOTH[..1]));
    let words = report["poor_heights"].as_str().unwrap();
    assert!(words.contains("epipolar lines") && words.contains("other direction"));
    assert!(table.contains(words), "{table}");
    let (report, _) = measured(&recorded(false, &BOTH[..1]));
    assert!(report["poor_heights"].is_null(), "{report}");
    assert!(report["heights_by"].is_null(), "{report}");
}

/// A projector 130 mm above the camera (`51-projector-above-camera`).
#[test]
fn the_case_of_a_projector_above_the_camera_is_measured_by_its_horizontal_fringes() {
    let Some(case) = shared::case("51-projector-above-camera") else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let text = |path: std::path::PathBuf| path.to_str().unwrap().to_owned();
    let (recording, out) = (folder.path().join("r"), folder.path().join("m"));
    let mut import = [
        "import".to_owned(),
        text(case.join("frames")),
        "--out".into(),
        text(recording.clone()),
    ]
    .to_vec();
    let options = "--projector 640x400 --fringes 1,8,64 --steps 3 --direction both --unit mm";
    import.extend(options.split(' ').map(str::to_owned));
    for (option, file) in [
        ("--camera-model", "camera.yml"),
        ("--projector-model", "projector.yml"),
    ] {
        import.extend([option.to_owned(), text(case.join(file))]);
    }
    laboratory().run(&import).succeeded();
    program().measure(&recording, &out, &[]).succeeded();
    let found = files::array(&out.join("height.npy")).elements;
    let expected = files::array(&case.join("expected_height.npy")).elements;
    let off = found
        .iter()
        .zip(&expected)
        .filter(|(found, wanted)| found.is_finite() && wanted.is_finite());
    let off: Vec<f64> = off
        .map(|(found, wanted)| f64::from(found - wanted))
        .collect();
    let rms = (off.iter().map(|off| off * off).sum::<f64>() / off.len() as f64).sqrt();
    assert!(
        off.len() > found.len() / 2 && rms < 0.02,
        "{rms} mm over {} px",
        off.len()
    );
}

/// A device's model as `cv2.FileStorage` writes it.
fn opencv(model: &DeviceModel) -> String {
    let matrix = |rows: usize, data: &[f64]| json!({ "type_id": "opencv-matrix", "rows": rows, "cols": data.len() / rows, "dt": "d", "data": data });
    let intrinsics = [
        model.fx, 0.0, model.cx, 0.0, model.fy, model.cy, 0.0, 0.0, 1.0,
    ];
    json!({
        "camera_matrix": matrix(3, &intrinsics), "distortion_coefficients": matrix(1, &model.distortion),
        "R": matrix(3, &model.rotation), "T": matrix(3, &model.translation_mm),
    })
    .to_string()
}

#[test]
fn the_calibration_of_a_head_says_if_the_fringes_of_its_recipes_would_tell_little() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    fs::write(at("head.toml"), SMALL_HEAD).unwrap();
    for (above, expected) in [(true, 1), (false, 0)] {
        let mut models = [rig::camera(128), rig::projector(1024, 768)];
        if above {
            models = models.map(rig::above);
        }
        for (name, model) in ["camera.json", "projector.json"].iter().zip(&models) {
            fs::write(at(name), opencv(model)).unwrap();
        }
        let [head, state] = ["head.toml", "state"].map(at);
        let [camera, projector] = ["camera.json", "projector.json"].map(at);
        let run = program().run(&[
            "calibrate",
            "--json",
            "--no-plate",
            "--unit",
            "mm",
            "--scenario",
            &head,
            "--state",
            &state,
            "--camera",
            &camera,
            "--projector",
            &projector,
        ]);
        let report: Value = serde_json::from_str(&run.succeeded().stdout).unwrap();
        let notes = report["notes"].as_array().unwrap().iter();
        let said = notes.filter(|note| note.as_str().unwrap().contains("epipolar lines"));
        assert_eq!(said.count(), expected, "{report}");
    }
}
