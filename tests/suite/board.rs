//! `fringed calibrate --board`: models from recordings of a checkerboard, rendered ones, and what
//! is refused.

use crate::written::{FRINGED, program};
use appliance::head::calibration::place::CalibrationPlace;
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;
use tests::board::{self, BOARD, FOCAL, PROJECTOR, Pose, Projected, poses};
use tests::program::{Program, Run};

/// The rendered board, as the command line takes it.
const CHECKER: &str = "checker:6x8:10";

/// Recordings of a board in some poses.
struct Poses {
    folder: TempDir,
    names: Vec<PathBuf>,
}

impl Poses {
    fn rendered(poses: &[Pose]) -> Self {
        Self::under(Projected::Geometric, poses)
    }

    fn under(projected: Projected, poses: &[Pose]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let names = (1..=poses.len()).map(|at| folder.path().join(format!("pose-{at}")));
        let names: Vec<_> = names.collect();
        for (at, (pose, name)) in poses.iter().zip(&names).enumerate() {
            board::write_as(pose, projected, at as u64, name);
        }
        Self { folder, names }
    }

    fn calibrate(&self, board: &str, more: &[&str]) -> Run {
        let out = self.out();
        let mut arguments = vec![
            "calibrate",
            "--json",
            "--board",
            board,
            "--out",
            out.to_str().unwrap(),
            "--poses",
        ];
        arguments.extend(self.names.iter().map(|name| name.to_str().unwrap()));
        arguments.extend(more);
        program().run(&arguments)
    }

    fn out(&self) -> PathBuf {
        self.folder.path().join("calibration.json")
    }

    /// Fails unless the poses are refused, naming `pose` and each of `words`, and nothing is
    /// written.
    fn refused(&self, board: &str, more: &[&str], words: &[&str]) {
        let run = self.calibrate(board, more);
        assert_eq!(run.code, 65, "{}", run.stderr);
        for word in words {
            assert!(run.stderr.contains(word), "{word}: {}", run.stderr);
        }
    }
}

fn number(value: &Value) -> f64 {
    value
        .as_f64()
        .unwrap_or_else(|| panic!("{value} is no number"))
}

#[test]
fn models_from_a_rendered_board_are_those_of_the_scene_and_need_the_head_before_they_serve() {
    let poses = Poses::rendered(&poses());
    let pictures = poses.folder.path().join("pictures");
    let drawn = ["--pictures", pictures.to_str().unwrap()];
    let run = poses
        .calibrate(
            CHECKER,
            &[&drawn[..], &["--board-sigma-ppm", "200"]].concat(),
        )
        .succeeded();
    for (name, (columns, rows)) in [
        ("camera.png", board::FRAME),
        ("projector.png", board::RASTER),
        ("coverage.png", board::FRAME),
    ] {
        let bytes = fs::read(pictures.join(name)).unwrap();
        let side = |at: usize| u32::from_be_bytes(bytes[at..at + 4].try_into().unwrap());
        assert_eq!(
            (side(16), side(20)),
            (columns as u32, rows as u32),
            "{name}"
        );
    }
    let report: Value = serde_json::from_str(&run.stdout).unwrap();
    for pose in report["poses"].as_array().unwrap() {
        assert_eq!(pose["corners"], BOARD.0 * BOARD.1, "{pose}");
        for pitch in pose["pitch_mm"].as_array().unwrap() {
            assert!((number(pitch) - BOARD.2).abs() < 0.01, "{pose}");
        }
    }
    assert!(
        number(&report["camera_px"]) < 0.1,
        "{}",
        report["camera_px"]
    );
    assert!(
        number(&report["projector_px"]) < 0.2,
        "{}",
        report["projector_px"]
    );
    let found = &report["calibration"];
    let baseline = PROJECTOR.iter().map(|x| x * x).sum::<f64>().sqrt();
    let off = |value: &Value, truth: f64| (number(value) / truth - 1.0).abs();
    assert!(
        off(&found["geometry"]["baseline_mm"], baseline) < 2e-3,
        "{found}"
    );
    for (device, focal) in [("camera", FOCAL.0), ("projector", FOCAL.1)] {
        assert!(off(&found[device]["model"]["fx"], focal) < 3e-3, "{found}");
    }
    let sigma = number(&report["sigma"]["length_100_mm"]);
    assert!((0.02..0.1).contains(&sigma), "{sigma}");
    assert_eq!(report["scale"], "unchecked");
    let missing = ["timing", "noise", "response", "contrast"];
    assert_eq!(report["missing"], serde_json::json!(missing));
    let loaded = CalibrationPlace::at(&poses.out()).load().unwrap().unwrap();
    assert_eq!(loaded.file.version, 2);
    // Again: the baseline confirms the scale, and squares of another size contradict it.
    let run = poses.calibrate(CHECKER, &[]).succeeded();
    let again: Value = serde_json::from_str(&run.stdout).unwrap();
    assert_eq!(again["scale"], "baseline");
    poses.refused("checker:6x8:10.2", &[], &["mm apart", "--board"]);
    assert_eq!(
        CalibrationPlace::at(&poses.out())
            .load()
            .unwrap()
            .unwrap()
            .file
            .checksum,
        again["calibration"]["checksum"]
    );
    // A head with nothing but models measures nothing, and names what is to be done.
    let folder = poses.folder.path();
    let (width, height) = board::FRAME;
    let (columns, rows) = board::RASTER;
    let scenario = format!(
        "[rig.camera]\nwidth = {width}\nheight = {height}\n[rig.projector]\nwidth = {columns}\nheight = {rows}\n"
    );
    fs::write(folder.join("scenario.toml"), scenario).unwrap();
    let config = format!(
        "[head]\nscenario = {:?}\ncalibration = {:?}\n",
        folder.join("scenario.toml"),
        poses.out()
    );
    fs::write(folder.join("fringed.toml"), config).unwrap();
    let path = |name: &str| folder.join(name).to_str().unwrap().to_owned();
    let run = Program::at(FRINGED).run(&[
        "record".to_owned(),
        path("recorded"),
        "--config".to_owned(),
        path("fringed.toml"),
        "--state".to_owned(),
        path("state"),
    ]);
    assert_eq!(run.code, 65, "{}", run.stderr);
    for word in missing.into_iter().chain(["fringed calibrate"]) {
        assert!(run.stderr.contains(word), "{}", run.stderr);
    }
}

#[test]
fn poses_that_cannot_be_used_are_refused_with_pose_and_reason() {
    let good = poses();
    let with = |at: usize, change: &dyn Fn(&mut Pose)| {
        let mut poses = good;
        change(&mut poses[at]);
        Poses::rendered(&poses)
    };
    let all = Poses::rendered(&good);
    all.refused(
        "checker:5x8:10",
        &[],
        &["pose-1", "6 × 8 inner corners", "--board"],
    );
    all.refused(
        CHECKER,
        &["--check-length", "72"],
        &["72 mm", "70 mm", "--board"],
    );
    let lengths = all
        .calibrate(CHECKER, &["--check-length", "70.1"])
        .succeeded();
    assert!(lengths.stdout.contains("\"scale\": \"length\""));
    with(1, &|pose| pose.blur = 7.0).refused(CHECKER, &[], &["pose-2", "blurred"]);
    with(2, &|pose| pose.moved = 0.4).refused(CHECKER, &[], &["pose-3", "moved", "px"]);
    with(3, &|pose| pose.dark = 330.0).refused(CHECKER, &[], &["pose-4"]);
    Poses::rendered(&good[..2]).refused(CHECKER, &[], &["2 poses", "at least 3"]);
    let flat =
        [0.0, 0.02, 0.04].map(|turn| Pose::new([turn, 0.0, 4.0 * turn], [40.0 * turn, 0.0, 400.0]));
    Poses::rendered(&flat).refused(CHECKER, &[], &["tilt"]);
    let lacking = Poses::rendered(&good[..1]);
    let manifest = lacking.names[0].join("recording.json");
    let text = fs::read_to_string(&manifest).unwrap();
    fs::write(&manifest, text.replace("\"horizontal\"", "\"vertical\"")).unwrap();
    lacking.refused(CHECKER, &[], &["pose-1", "no horizontal fringes"]);
    let run = program().run(&["calibrate", "--board", CHECKER]);
    assert_eq!(
        (run.code, run.stderr.contains("--poses")),
        (64, true),
        "{}",
        run.stderr
    );
}

#[test]
fn models_of_another_head_are_refused_for_a_recording() {
    let poses = Poses::rendered(&poses());
    poses.calibrate(CHECKER, &[]).succeeded();
    let folder = poses.folder.path();
    let text = |path: &Path| path.to_str().unwrap().to_owned();
    let measure = |calibration: &Path| {
        program().run(&[
            "measure".to_owned(),
            text(&poses.names[0]),
            "--calibration".to_owned(),
            text(calibration),
            "--out".to_owned(),
            text(&folder.join("measured")),
        ])
    };
    measure(&poses.out()).succeeded();
    assert!(folder.join("measured/height.npy").exists());
    let run = measure(&folder.join("missing.json"));
    assert_eq!(
        (run.code, run.stderr.contains("no such")),
        (66, true),
        "{}",
        run.stderr
    );
    let garbage = folder.join("garbage.json");
    fs::write(&garbage, "{}").unwrap();
    assert_eq!(measure(&garbage).code, 65);
    let mut file = CalibrationPlace::at(&poses.out())
        .load()
        .unwrap()
        .unwrap()
        .file;
    file.camera.width *= 2;
    let (_, bytes) = file.sealed().unwrap();
    fs::write(&garbage, bytes).unwrap();
    let run = measure(&garbage);
    assert_eq!(run.code, 65, "{}", run.stderr);
    assert!(run.stderr.contains("840 × 360"), "{}", run.stderr);
}

#[test]
fn a_mirrored_device_and_fringes_in_another_order_are_named_instead_of_asking_for_more_poses() {
    let mut mirrored = poses();
    mirrored.iter_mut().for_each(|pose| pose.mirrored = true);
    Poses::rendered(&mirrored).refused(CHECKER, &[], &["mirrored", "camera or of the projector"]);
    // The frames of the horizontal fringes are described as those of the vertical ones.
    let exchanged = Poses::rendered(&poses());
    for name in &exchanged.names {
        let manifest = name.join("recording.json");
        let text = fs::read_to_string(&manifest).unwrap();
        let text = text.replace("\"horizontal\"", "\"other\"");
        let text = text.replace("\"vertical\"", "\"horizontal\"");
        fs::write(&manifest, text.replace("\"other\"", "\"vertical\"")).unwrap();
    }
    exchanged.refused(CHECKER, &[], &["horizontal fringes", "changed places"]);
}

#[test]
fn poses_under_beats_or_a_gray_code_give_the_same_models_as_geometric_ones() {
    for projected in [Projected::Heterodyne, Projected::Gray] {
        let poses = Poses::under(projected, &poses());
        let run = poses.calibrate(CHECKER, &[]).succeeded();
        let report: Value = serde_json::from_str(&run.stdout).unwrap();
        let found = &report["calibration"];
        for (device, focal) in [("camera", FOCAL.0), ("projector", FOCAL.1)] {
            let off = number(&found[device]["model"]["fx"]) / focal - 1.0;
            assert!(off.abs() < 3e-3, "{projected:?}: {device} is off by {off}");
        }
    }
    let dense = Poses::under(Projected::Heterodyne, &poses()[..1]);
    let manifest = dense.names[0].join("recording.json");
    let text = fs::read_to_string(&manifest).unwrap();
    // 16 and 15 fringes of 32: their beat spans two turns.
    let text = text.replace("\"fringes\":16.0", "\"fringes\":32.0");
    fs::write(&manifest, text).unwrap();
    dense.refused(CHECKER, &[], &["pose-1", "no absolute phase", "Gray code"]);
}

#[test]
fn a_place_that_is_given_twice_and_squares_in_metres_are_refused() {
    let mut twice = Poses::rendered(&poses());
    let copied = twice.folder.path().join("pose-7");
    board::write(&poses()[1], 99, &copied);
    twice.names.insert(4, copied);
    twice.refused(CHECKER, &[], &["pose-7", "pose-2", "lies where it lies"]);
    twice.names.remove(4);
    twice.refused("checker:6x8:0.01", &[], &["pose-1", "0.01 mm", "mm, 10 if"]);
}

#[test]
fn a_last_pose_that_is_tilted_is_said_to_be_z_0_and_to_be_looked_at() {
    let mut tilted = poses();
    let all = Poses::rendered(&tilted);
    let flat = all.calibrate(CHECKER, &[]).succeeded();
    let report: Value = serde_json::from_str(&flat.stdout).unwrap();
    assert_eq!(report["notes"], serde_json::json!([]));
    tilted.swap(0, 5);
    let run = Poses::rendered(&tilted).calibrate(CHECKER, &[]).succeeded();
    let report: Value = serde_json::from_str(&run.stdout).unwrap();
    let note = report["notes"][0].as_str().unwrap();
    for word in ["pose-6", "tilted", "flat", "last pose"] {
        assert!(note.contains(word), "{note}");
    }
}
