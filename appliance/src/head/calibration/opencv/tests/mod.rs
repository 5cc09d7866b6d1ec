//! Imports of models: what FileStorage writes is read, what is broken is refused with its remedy.

mod other_programs;

use super::{Declared, ImportedModels, Sizes, Unit, from_one, from_two};
use hal::model::DeviceModel;
use sim::Scenario;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// As OpenCV 4 writes it; OpenCV 5 begins with "%YAML 1.2".
const YAML: &str = "%YAML:1.0
---
image_width: 512
image_height: 512
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 1451.8499999999999, 0., 255.5, 0., 1451.8499999999999, 255.5,
       0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 1
   cols: 5
   dt: d
   data: [ -0.12, 0.14999999999999999, 0.00020000000000000001,
       -0.00029999999999999997, 0. ]
R: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 0.93969262078590843, 0., -0.34202014332566871, 0., -1., 0.,
       -0.34202014332566871, 0., -0.93969262078590843 ]
T: !!opencv-matrix
   rows: 3
   cols: 1
   dt: d
   data: [ 0., 0., 600. ]
unit: mm
rms: 0.20999999999999999
";
const XML: &str = r#"<?xml version="1.0"?>
<opencv_storage>
<image_width>512</image_width>
<image_height>512</image_height>
<camera_matrix type_id="opencv-matrix">
  <rows>3</rows>
  <cols>3</cols>
  <dt>d</dt>
  <data>
    1451.8499999999999 0. 255.5 0. 1451.8499999999999 255.5 0. 0. 1.</data></camera_matrix>
<distortion_coefficients type_id="opencv-matrix">
  <rows>1</rows>
  <cols>5</cols>
  <dt>d</dt>
  <data>
    -0.12 0.14999999999999999 0.00020000000000000001
    -0.00029999999999999997 0.</data></distortion_coefficients>
<R type_id="opencv-matrix">
  <rows>3</rows>
  <cols>3</cols>
  <dt>d</dt>
  <data>
    0.93969262078590843 0. -0.34202014332566871 0. -1. 0.
    -0.34202014332566871 0. -0.93969262078590843</data></R>
<T type_id="opencv-matrix">
  <rows>3</rows>
  <cols>1</cols>
  <dt>d</dt>
  <data>
    0. 0. 600.</data></T>
<unit>mm</unit>
<rms>0.20999999999999999</rms>
</opencv_storage>
"#;
const JSON: &str = r#"{
    "image_width": 512,
    "image_height": 512,
    "camera_matrix": {
        "type_id": "opencv-matrix",
        "rows": 3,
        "cols": 3,
        "dt": "d",
        "data": [ 1451.8499999999999, 0.0, 255.5, 0.0,
            1451.8499999999999, 255.5, 0.0, 0.0, 1.0 ]
    },
    "distortion_coefficients": {
        "type_id": "opencv-matrix",
        "rows": 1,
        "cols": 5,
        "dt": "d",
        "data": [ -0.12, 0.14999999999999999, 0.00020000000000000001,
            -0.00029999999999999997, 0.0 ]
    },
    "R": {
        "type_id": "opencv-matrix",
        "rows": 3,
        "cols": 3,
        "dt": "d",
        "data": [ 0.93969262078590843, 0.0, -0.34202014332566871, 0.0,
            -1.0, 0.0, -0.34202014332566871, 0.0, -0.93969262078590843 ]
    },
    "T": {
        "type_id": "opencv-matrix",
        "rows": 3,
        "cols": 1,
        "dt": "d",
        "data": [ 0.0, 0.0, 600.0 ]
    },
    "unit": "mm",
    "rms": 0.20999999999999999
}
"#;

const SIZES: Sizes = Sizes {
    camera: (512, 512),
    projector: (512, 512),
};

fn model() -> DeviceModel {
    DeviceModel {
        fx: 1451.85,
        fy: 1451.85,
        cx: 255.5,
        cy: 255.5,
        distortion: [-0.12, 0.15, 2e-4, -3e-4, 0.0],
        rotation: [
            0.939_692_620_785_908_4,
            0.0,
            -0.342_020_143_325_668_7,
            0.0,
            -1.0,
            0.0,
            -0.342_020_143_325_668_7,
            0.0,
            -0.939_692_620_785_908_4,
        ],
        translation_mm: [0.0, 0.0, 600.0],
    }
}

fn written(folder: &Path, text: impl AsRef<[u8]>) -> PathBuf {
    let path = folder.join("models.any");
    std::fs::write(&path, text).unwrap();
    path
}

/// Reads a text as the file of the camera and of the projector.
fn read(text: impl AsRef<[u8]>, declared: Declared) -> crate::error::Result<DeviceModel> {
    let folder = tempfile::tempdir().unwrap();
    let path = written(folder.path(), text);
    let ImportedModels {
        camera,
        projector,
        has_plane,
        notes,
    } = from_two(&path, &path, SIZES, declared)?;
    assert_eq!(camera, projector);
    assert!(has_plane && notes.is_empty(), "{notes:?}");
    Ok(camera)
}

#[test]
fn the_three_languages_of_file_storage_say_the_same() {
    let five = YAML.replace("%YAML:1.0", "%YAML 1.2");
    for text in [YAML, &five, XML, JSON] {
        assert_eq!(read(text, Declared::default()).unwrap(), model(), "{text}");
    }
}

#[test]
fn lengths_are_in_the_unit_that_is_declared() {
    let bare = YAML.replace("unit: mm\n", "").replace("600.", "60.");
    let declared = |unit| Declared {
        unit,
        ..Declared::default()
    };
    let read_in = |unit| read(&bare, declared(Some(unit))).map(|model| model.translation_mm[2]);
    assert_eq!(read_in(Unit::Cm), Ok(600.0));
    assert_eq!(read_in(Unit::M), Ok(60_000.0));
    assert_eq!(read_in(Unit::Inch), Ok(1524.0));
    let error = read(&bare, declared(None)).unwrap_err().to_string();
    assert!(error.contains("--unit"), "{error}");
    let error = read(YAML, declared(Some(Unit::M))).unwrap_err().to_string();
    assert!(error.contains("one of them is wrong"), "{error}");
}

#[test]
fn a_rotation_vector_is_its_matrix_and_a_board_s_z_can_be_turned() {
    let (_, rest) = YAML.split_once("R: !!").unwrap();
    let (matrix, _) = rest.split_once("T: !!").unwrap();
    // Half a turn about (cos 10°, 0, −sin 10°) is the study's camera.
    let axis = 10_f64.to_radians();
    let vector = [
        std::f64::consts::PI * axis.cos(),
        0.0,
        -std::f64::consts::PI * axis.sin(),
    ];
    let text = YAML.replace(
        &format!("R: !!{matrix}"),
        &format!(
            "rvec: !!opencv-matrix\n   rows: 3\n   cols: 1\n   dt: d\n   data: [ {}, {}, {} ]\n",
            vector[0], vector[1], vector[2]
        ),
    );
    let found = read(text, Declared::default()).unwrap();
    for (found, expected) in found.rotation.iter().zip(model().rotation) {
        assert!((found - expected).abs() < 1e-12);
    }
    let away = Declared {
        z_away: true,
        ..Declared::default()
    };
    let turned = read(YAML, away).unwrap().rotation;
    let expected = [0.939_692_620_785_908_4, 0.0, 0.342_020_143_325_668_7];
    assert_eq!(turned[..3], expected);
    assert_eq!(turned[4], 1.0);
}

fn yaml_matrix(text: &mut String, name: &str, rows: usize, numbers: &[f64]) {
    let data: Vec<String> = numbers.iter().map(f64::to_string).collect();
    let columns = numbers.len() / rows;
    write!(
        text,
        "{name}: !!opencv-matrix\n   rows: {rows}\n   cols: {columns}\n   dt: d\n   data: [ {} ]\n",
        data.join(", ")
    )
    .unwrap();
}

fn k(model: &DeviceModel) -> [f64; 9] {
    [
        model.fx, 0.0, model.cx, 0.0, model.fy, model.cy, 0.0, 0.0, 1.0,
    ]
}

#[test]
fn a_stereo_calibration_with_the_pose_of_the_plate_gives_both_devices() {
    let rig = Scenario::default().rig;
    let (camera, projector) = (rig.camera.model(), rig.projector.model());
    // R₂ = R_p R_cᵀ, t₂ = t_p − R₂ t_c, worked out here by the sums themselves.
    let mut between = [0.0; 9];
    for (at, element) in between.iter_mut().enumerate() {
        for k in 0..3 {
            *element += projector.rotation[at / 3 * 3 + k] * camera.rotation[at % 3 * 3 + k];
        }
    }
    let mut shift = projector.translation_mm;
    for (row, length) in shift.iter_mut().enumerate() {
        for k in 0..3 {
            *length -= between[3 * row + k] * camera.translation_mm[k];
        }
    }
    let mut text = String::from("%YAML:1.0\n---\nunit: mm\n");
    for (name, rows, numbers) in [
        ("cam_K", 3, &k(&camera)[..]),
        ("cam_kc", 1, &camera.distortion),
        ("proj_K", 3, &k(&projector)),
        ("proj_kc", 1, &projector.distortion),
        ("R", 3, &between),
        ("T", 3, &shift),
        ("plate_R", 3, &camera.rotation),
        ("plate_T", 3, &camera.translation_mm),
    ] {
        yaml_matrix(&mut text, name, rows, numbers);
    }
    let folder = tempfile::tempdir().unwrap();
    let sizes = Sizes {
        camera: (512, 512),
        projector: (1024, 768),
    };
    let path = written(folder.path(), &text);
    let found = from_one(&path, sizes, Declared::default()).unwrap();
    assert_eq!(found.camera, camera);
    let numbers = |model: &DeviceModel| {
        let pose = model.rotation.into_iter().chain(model.translation_mm);
        pose.chain(k(model)).collect::<Vec<f64>>()
    };
    for (found, expected) in numbers(&found.projector).iter().zip(numbers(&projector)) {
        assert!((found - expected).abs() < 1e-9, "{found} {expected}");
    }
    let without = text.replace("plate_T", "else");
    let path = written(folder.path(), without);
    let error = from_one(&path, sizes, Declared::default())
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("plate_T") && error.contains("solvePnP"),
        "{error}"
    );
}

#[test]
fn what_is_broken_is_refused_with_the_node_and_the_remedy() {
    let bomb = "<?xml version=\"1.0\"?><!DOCTYPE x [<!ENTITY a \"aaaaaaaaaa\"><!ENTITY b \"&a;&a;&a;&a;&a;&a;&a;&a;\">\
                <!ENTITY c \"&b;&b;&b;&b;&b;&b;&b;&b;\">]><opencv_storage><R>&c;</R></opencv_storage>";
    let aliases = "a: &a [x,x,x,x,x,x]\nb: &b [*a,*a,*a,*a,*a,*a]\nR: [*b,*b,*b,*b,*b,*b]\n";
    let deep_xml = "<a>".repeat(200_000);
    let deep_yaml = "[".repeat(200_000);
    let large = format!("{YAML}pictures: {}\n", "0".repeat(2 << 20));
    let change = |from: &str, to: &str| {
        assert!(YAML.contains(from), "{from}");
        YAML.replacen(from, to, 1)
    };
    let cases: Vec<(String, &[&str])> = vec![
        (
            change("1451.8499999999999", ".Nan"),
            &["camera_matrix", "finite", "board"],
        ),
        (change("600.", "-.Inf"), &["T ", "finite"]),
        (change("600.", "1e999"), &["T ", "finite"]),
        (change("600.", "six hundred"), &["T ", "not a number"]),
        (change("600.", "600., 0."), &["T ", "3×1", "4 numbers"]),
        (
            change("   rows: 3\n   cols: 3", "   rows: 9\n   cols: 1"),
            &["camera_matrix", "3×3"],
        ),
        (
            change(
                "   rows: 3\n   cols: 3",
                "   rows: 99999999999999999999\n   cols: 3",
            ),
            &["rows", "whole number"],
        ),
        (
            change(
                "   rows: 3\n   cols: 3",
                "   rows: 4294967296\n   cols: 4294967296",
            ),
            &["camera_matrix", "9 numbers"],
        ),
        (change("   rows: 3\n", ""), &["camera_matrix has no rows"]),
        (change("dt: d", "dt: \"3u\""), &["camera_matrix", "dt: d"]),
        (
            change("camera_matrix:", "matrix:"),
            &["camera_matrix or", "3×3"],
        ),
        (
            change("distortion_coefficients:", "d:"),
            &["distortion_coefficients", "k1 k2 p1 p2 k3"],
        ),
        (change("\nR:", "\nQ:"), &["no node Rlp or R or", "rotation"]),
        (change("\nT:", "\nQ:"), &["node T or", "translation"]),
        (
            change("0., -1., 0.", "0., 1., 0."),
            &["R mirrors", "left-handed", "--z-away"],
        ),
        (
            change("0., -1., 0.", "0., -1.1, 0."),
            &["R is not a rotation matrix", "digits"],
        ),
        (
            change("1451.8499999999999, 0.,", "1451.8499999999999, 3.,"),
            &["camera_matrix", "skew"],
        ),
        (
            change("0., 0., 1. ]", "0., 0., 2. ]"),
            &["camera_matrix", "0 0 1"],
        ),
        (
            change("cols: 5", "cols: 6")
                .replace("17, 0. ]", "17, 0., 1. ]")
                .replace("97, 0. ]", "97, 0., 1. ]"),
            &["distortion_coefficients", "1×6"],
        ),
        (
            change("cols: 5", "cols: 8").replace("97, 0. ]", "97, 0., 1., 0., 0. ]"),
            &["8 coefficients", "CALIB_RATIONAL_MODEL"],
        ),
        (
            change("image_width: 512", "image_width: 640"),
            &["image_width is 640", "512"],
        ),
        (
            change("unit: mm", "unit: furlong"),
            &["furlong", "mm, cm, m or inch"],
        ),
        (change("unit: mm", "T: 5\nunit: mm"), &["T is there twice"]),
        (
            YAML.replace("R: !!opencv-matrix\n", "R: 5\nX:\n"),
            &["R is 1×1", "3×3"],
        ),
        (bomb.to_owned(), &["DOCTYPE", "remove it"]),
        (aliases.to_owned(), &["alias", "the value itself"]),
        (deep_xml, &["deep"]),
        (deep_yaml, &["recursion limit", "FileStorage"]),
        (large, &["bytes", "no pictures"]),
        (
            XML.replace("</R>", "</S>"),
            &["not valid XML", "FileStorage"],
        ),
        (
            JSON.replace("\"T\": {", "\"T\": {{"),
            &["not a word", "FileStorage"],
        ),
        (
            JSON.replacen("1451.8499999999999", ".Nan", 1),
            &["camera_matrix", "finite"],
        ),
        (String::new(), &["empty", "FileStorage"]),
        ("just words".into(), &["names no values"]),
        ("<a/>".into(), &["names no values"]),
        ("- 1\n- 2\n".into(), &["names no values"]),
        ("? [a, b]\n: c\n".into(), &["not a word"]),
    ];
    for (text, words) in cases {
        let read = read(&text, Declared::default());
        let error = read.expect_err(words[0]).to_string();
        assert!(error.contains("models.any"), "{error}");
        for word in words {
            assert!(error.contains(word), "{word:?} is not in: {error}");
        }
    }
    let error = read(b"\x1f\x8b\x08\xff\xfe", Declared::default())
        .unwrap_err()
        .to_string();
    assert!(error.contains("compressed"), "{error}");
}

#[test]
fn no_prefix_and_no_changed_byte_of_a_file_makes_the_import_panic_or_hang() {
    for text in [YAML, XML, JSON] {
        for end in (0..text.len()).step_by(7) {
            // A truncated file is refused, or has everything that is needed already.
            let _ = read(&text[..end], Declared::default());
        }
        for at in (0..text.len()).step_by(11) {
            for byte in [b'&', b'*', b'[', b'<', b'"', b'\t', 0, 0xff] {
                let mut bytes = text.as_bytes().to_vec();
                bytes[at] = byte;
                let _ = read(&bytes, Declared::default());
            }
        }
    }
}
