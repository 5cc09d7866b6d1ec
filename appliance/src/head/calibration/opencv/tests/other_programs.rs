//! ImportedModels as other programs than OpenCV write them: other names, nested nodes, lists of rows, no
//! plate, few digits.

use super::super::{Declared, Unit, from_one, from_two};
use super::{SIZES, written};

/// What Python programs write of K, distortion, R and T of a projector at (−100, 0, 0) of its
/// camera, in metres.
const NESTED: &str = "{\"Camera 0\": {\"K\": [[900, 0, 320], [0, 900, 240], [0, 0, 1]], \"dist\": [[0.1, 0, 0, 0, 0]]},
    \"Projector\": {\"mtx\": [[800, 0, 300], [0, 800, 200], [0, 0, 1]], \"dist\": [0, 0, 0, 0], \"rvec\": [[0], [0], [0]],
    \"tvec\": [[0.1], [0], [0]]}}";
/// The names of a program with two cameras, a third one and a projector; R to three digits.
const FOUR: &str = "M1: [[900, 0, 320], [0, 900, 240], [0, 0, 1]]
D1: [0.1, 0, 0, 0, 0]
M2: [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
D2: [9, 0, 0, 0]
R: [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
T: [9, 9, 9]
M4:
- - 800
  - 0
  - 300
- [0, 800, 200]
- [0, 0, 1]
D4: [[0, 0, 0, 0, 0]]
Rlp: [[0.985, 0, -0.174], [0, 1, 0], [0.174, 0, 0.985]]
Tlp: [[0.1], [0], [0]]
";

#[test]
fn models_without_a_plate_are_read_under_the_names_of_other_programs_and_stand_where_the_plane_is_put()
 {
    let folder = tempfile::tempdir().unwrap();
    let read = |text: &str, plane_at, z_away| {
        let declared = Declared {
            unit: Some(Unit::M),
            plane_at,
            z_away,
        };
        from_one(&written(folder.path(), text), SIZES, declared)
    };
    let found = read(NESTED, Some(500.0), false).unwrap();
    assert!(found.has_plane && found.notes.is_empty());
    let half_turn = [1.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, -1.0];
    let (camera, projector) = (&found.camera, &found.projector);
    assert_eq!((camera.fx, camera.distortion[0]), (900.0, 0.1));
    assert_eq!((projector.fx, projector.cy), (800.0, 200.0));
    assert_eq!(
        (camera.rotation, projector.rotation),
        (half_turn, half_turn)
    );
    assert_eq!(camera.translation_mm, [0.0, 0.0, 500.0]);
    assert_eq!(projector.translation_mm, [100.0, 0.0, 500.0]);
    let found = read(FOUR, None, false).unwrap();
    assert!(!found.has_plane);
    assert_eq!(
        (found.projector.fx, found.projector.distortion),
        (800.0, [0.0; 5])
    );
    let [note] = &found.notes[..] else {
        panic!("{:?}", found.notes)
    };
    assert!(note.contains("Rlp") && note.contains("digits"), "{note}");
    let r = found.projector.rotation;
    let length = r[0] * r[0] + r[1] * r[1] + r[2] * r[2];
    assert!(
        (length - 1.0).abs() < 1e-14 && (r[0] - 0.985).abs() < 5e-4,
        "{r:?}"
    );
    let error = read(FOUR, None, true).unwrap_err().to_string();
    assert!(error.contains("leave out --z-away"), "{error}");
    let worse = FOUR.replace("0.174, 0, 0.985", "0.18, 0, 0.985");
    let error = read(&worse, None, false).unwrap_err().to_string();
    assert!(error.contains("Rlp is not a rotation matrix"), "{error}");
    let both = format!("{FOUR}plate_rvec: [3.14159265358979, 0, 0]\nplate_tvec: [0, 0, 0.5]\n");
    let error = read(&both, Some(500.0), false).unwrap_err().to_string();
    assert!(error.contains("leave out --plane-at"), "{error}");
    assert!(read(&both, None, true).unwrap().has_plane);
    let ragged = FOUR.replace("[0, 800, 200]", "[0, 800]");
    let error = read(&ragged, None, false).unwrap_err().to_string();
    assert!(
        error.contains("M4 has rows of different lengths"),
        "{error}"
    );
}

#[test]
fn a_camera_that_is_the_origin_states_no_plane() {
    let folder = tempfile::tempdir().unwrap();
    let one = |name: &str, pose: &str| {
        let path = folder.path().join(name);
        let text = format!(
            "K: [[900, 0, 300], [0, 900, 200], [0, 0, 1]]\ndist: [[0, 0, 0, 0, 0]]\n{pose}"
        );
        std::fs::write(&path, text).unwrap();
        path
    };
    let turned = "R: [[0.96, 0, 0.28], [0, 1, 0], [-0.28, 0, 0.96]]\nT: [[-100], [0], [12.5]]\n";
    let origin = "R: [[1, 0, 0], [0, 1, 0], [0, 0, 1]]\nT: [[0], [0], [0]]\n";
    let projector = one("projector.yaml", turned);
    let read = |pose: &str, plane_at| {
        let declared = Declared {
            unit: Some(Unit::Mm),
            plane_at,
            z_away: false,
        };
        from_two(&one("camera.yaml", pose), &projector, SIZES, declared)
    };
    let found = read(origin, Some(400.0)).unwrap();
    assert!(found.has_plane);
    assert_eq!(found, read("", Some(400.0)).unwrap());
    assert!(!read(origin, None).unwrap().has_plane);
    let elsewhere = origin.replace("[0]]", "[500]]");
    let refused = read(&elsewhere, Some(400.0)).unwrap_err().to_string();
    assert!(refused.contains("leave out --plane-at"), "{refused}");
}

#[test]
fn a_file_that_names_another_model_than_a_pinhole_camera_s_is_refused_by_that_name() {
    let folder = tempfile::tempdir().unwrap();
    let read = |more: &str| {
        let text = format!("{FOUR}{more}\n");
        from_one(
            &written(folder.path(), &text),
            SIZES,
            Declared {
                unit: Some(Unit::M),
                plane_at: None,
                z_away: false,
            },
        )
    };
    for (more, named) in [
        (
            "distortion_model: equidistant",
            "distortion_model: equidistant",
        ),
        (
            "distortion_model: thin_prism",
            "distortion_model: thin_prism",
        ),
        ("camera_model: omni", "camera_model: omni"),
        ("camera_model: ds", "camera_model: ds"),
        ("cameraModel: KANNALA_BRANDT4", "KANNALA_BRANDT4"),
        ("fisheye_model: 1", "fisheye_model: 1"),
        ("cam0:\n  fisheye: [1, 2]", "fisheye"),
        ("projection: fisheye", "projection: fisheye"),
        ("xi: 1.2", "xi"),
    ] {
        let refused = read(more).unwrap_err().to_string();
        assert!(
            refused.contains(named) && refused.contains("pinhole"),
            "{refused}"
        );
    }
    for more in [
        "distortion_model: plumb_bob",
        "distortion_model: rational_polynomial",
        "camera_model: pinhole",
        "camera_model: acA1440-220um",
        "fisheye_model: 0",
    ] {
        read(more).unwrap();
    }
}
