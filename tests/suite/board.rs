//! `fringed calibrate --board`: models from recordings of a checkerboard, rendered ones and real ones, and what is refused.

use crate::measured::BOARD as REAL_BOARD;
use crate::written::{FRINGED, program};
use appliance::head::calibration::place::Place;
use appliance::measure::measure;
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;
use tests::board::{self, BOARD, FOCAL, PROJECTOR, Pose, poses};
use tests::plane::Plane;
use tests::program::{Program, Run};
use tests::shared;

/// The rendered board, as the command line takes it.
const CHECKER: &str = "checker:6x8:10";
/// Bounds on the five real poses: the residuals that OpenCV's adjustment leaves are .299 and .331 px.
const REAL_CAMERA_PX: f64 = 0.33;
const REAL_PROJECTOR_PX: f64 = 0.36;
/// Largest RMS distance of a real board from a plane, mm, measured with models of other poses.
const REAL_FLATNESS_MM: f64 = 0.2145;
/// Largest error of a mean pitch of real corners, mm.
const REAL_PITCH_MM: f64 = 0.02;

/// Recordings of a board in some poses.
struct Poses {
    folder: TempDir,
    names: Vec<PathBuf>,
}

impl Poses {
    fn rendered(poses: &[Pose]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let names = (1..=poses.len()).map(|at| folder.path().join(format!("pose-{at}")));
        let names: Vec<_> = names.collect();
        for (at, (pose, name)) in poses.iter().zip(&names).enumerate() {
            board::write(pose, at as u64, name);
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

    /// Fails unless the poses are refused, naming `pose` and each of `words`, and nothing is written.
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
    let run = poses
        .calibrate(CHECKER, &["--board-sigma-ppm", "200"])
        .succeeded();
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
    let loaded = Place::at(&poses.out()).load().unwrap().unwrap();
    assert_eq!(loaded.file.version, 2);
    // Again: the baseline confirms the scale, and squares of another size contradict it.
    let run = poses.calibrate(CHECKER, &[]).succeeded();
    let again: Value = serde_json::from_str(&run.stdout).unwrap();
    assert_eq!(again["scale"], "baseline");
    poses.refused("checker:6x8:10.2", &[], &["mm apart", "--board"]);
    assert_eq!(
        Place::at(&poses.out())
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

/// The shared recordings of a real board.
fn real() -> Option<Vec<PathBuf>> {
    let names = (1..=5).map(|at| format!("slstudio-calib-{at}"));
    names.map(|name| shared::folder(&name)).collect()
}

fn real_report(poses: &[PathBuf], out: &Path) -> Value {
    let mut arguments = vec![
        "calibrate",
        "--json",
        "--board",
        "checker:9x13:10",
        "--out",
        out.to_str().unwrap(),
        "--poses",
    ];
    arguments.extend(poses.iter().map(|pose| pose.to_str().unwrap()));
    let run = program().run(&arguments).succeeded();
    serde_json::from_str(&run.stdout).unwrap()
}

#[test]
fn five_real_poses_fit_as_well_as_with_opencv() {
    let Some(poses) = real() else { return };
    let folder = tempfile::tempdir().unwrap();
    let report = real_report(&poses, &folder.path().join("calibration.json"));
    assert!(number(&report["camera_px"]) <= REAL_CAMERA_PX, "{report}");
    assert!(
        number(&report["projector_px"]) <= REAL_PROJECTOR_PX,
        "{report}"
    );
    let poses = report["poses"].as_array().unwrap();
    assert_eq!(poses.len(), 5);
    for pose in poses {
        assert!(pose["corners"].as_u64().unwrap() >= 110, "{pose}");
        for pitch in pose["pitch_mm"].as_array().unwrap() {
            assert!((number(pitch) - 10.0).abs() < REAL_PITCH_MM, "{pose}");
        }
    }
}

#[test]
fn a_real_pose_that_was_left_out_is_measured_flat() {
    let (Some(mut poses), Some((_, mut recording))) = (real(), shared::recording(REAL_BOARD))
    else {
        return;
    };
    // The board's recording is that of the second pose.
    poses.remove(1);
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("calibration.json");
    real_report(&poses, &out);
    let found = Place::at(&out).load().unwrap().unwrap().file;
    recording.camera_model = Some(found.camera.model);
    recording.projector.model = Some(found.projector.model);
    recording.range_mm = Some([-200.0, 200.0]);
    let measured = measure(&recording, Path::new("in memory")).unwrap();
    let surface = measured.heights.as_ref().unwrap();
    let (camera, width) = (surface.triangulator.camera(), surface.map.width);
    let text = fs::read_to_string(
        shared::recordings()
            .join(REAL_BOARD)
            .join("truth/corners.csv"),
    )
    .unwrap();
    let pixels: Vec<(f64, f64)> = text
        .lines()
        .skip(1)
        .map(|line| {
            let numbers: Vec<f64> = line
                .split(',')
                .map(|number| number.parse().unwrap())
                .collect();
            (numbers[2], numbers[3])
        })
        .collect();
    let ends = |of: fn(&(f64, f64)) -> f64| {
        let each = pixels.iter().map(of);
        (
            each.clone().fold(f64::INFINITY, f64::min),
            each.fold(0.0, f64::max),
        )
    };
    let (columns, rows) = (ends(|pixel| pixel.0), ends(|pixel| pixel.1));
    let mut points = Vec::new();
    for (at, height) in surface.map.height.iter().enumerate() {
        let (u, v) = ((at % width) as f64, (at / width) as f64);
        let inside = u >= columns.0 && u <= columns.1 && v >= rows.0 && v <= rows.1;
        if inside && height.is_known() {
            let (centre, ray) = (camera.centre(), camera.ray(u, v).unwrap());
            let point = centre + ray * ((height.mm() - centre.z) / ray.z);
            points.push([point.x, point.y, point.z]);
        }
    }
    let near = |points: &[[f64; 3]]| {
        let plane = Plane::fit(points).unwrap();
        let kept = points
            .iter()
            .filter(|point| plane.distance(**point).abs() < 5.0);
        kept.copied().collect::<Vec<_>>()
    };
    let kept = near(&points);
    let plane = Plane::fit(&kept).unwrap();
    let squares: f64 = kept
        .iter()
        .map(|point| plane.distance(*point).powi(2))
        .sum();
    let rms = (squares / kept.len() as f64).sqrt();
    let beyond = points.len() - kept.len();
    assert!(
        kept.len() > 300_000 && beyond < 100,
        "{} and {beyond}",
        kept.len()
    );
    assert!(rms <= REAL_FLATNESS_MM, "{rms}");
}
