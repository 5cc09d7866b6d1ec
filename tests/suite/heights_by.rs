//! Heights by the measured reference plane and by the models: `fringed calibrate --heights-by`, on
//! one recording of a simulated head.

use crate::written::program;
use hal::model::DeviceModel;
use serde_json::Value;
use sim::Scenario;
use std::fs;
use std::path::{Path, PathBuf};
use tests::files;

/// A head with lenses, and the field of view of the default one.
const HEAD: &str = "sub_rays = 2
part = { kind = \"plane\" }
[rig.camera]
width = 160
height = 160
";
/// Where the part lies: on both sides of the reference plane, all over the frame.
const PLACEMENT: &str = "[placement]\nshift_mm = [0.0, 0.0, 4.0]\ntilt_deg = [6.0, -4.0]\n";
/// Largest RMS difference of both kinds of heights where the models are exact, mm.
const MOST_MM: f64 = 0.003;
/// Radial distortion of the camera that is half a pixel in the corners of the frame: 454 px · k ·
/// 0.249³.
const HALF_A_PIXEL: f64 = 0.0714;

struct Head {
    folder: tempfile::TempDir,
}

impl Head {
    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn text(&self, name: &str) -> String {
        self.path(name).to_str().unwrap().to_owned()
    }

    /// Calibrates with these options into the state folder `state`, and returns the content of the
    /// calibration.
    fn calibrate(&self, state: &str, more: &[&str]) -> Value {
        let (state, scenario) = (self.text(state), self.text("plate.toml"));
        let all = [
            "calibrate",
            "--json",
            "--state",
            &state,
            "--scenario",
            &scenario,
        ];
        let run = program().run(&[&all[..], more].concat()).succeeded();
        serde_json::from_str::<Value>(&run.stdout).unwrap()["calibration"].clone()
    }

    /// The heights of the recording by the calibration in `state`.
    fn heights(&self, state: &str) -> Vec<f32> {
        let calibration = self.path(state).join("calibration/calibration.json");
        let (recording, out) = (self.text("recording"), self.path(state).join("measured"));
        let calibration = calibration.to_str().unwrap();
        let measured = out.to_str().unwrap();
        let all = [
            "measure",
            &recording,
            "--calibration",
            calibration,
            "--out",
            measured,
        ];
        program().run(&all).succeeded();
        let bytes = fs::read(out.join("height.npy")).unwrap();
        hal::npy::read::<f32>(&bytes).unwrap().elements
    }

    /// What the doctor says of the heights by the calibration in `state`.
    fn doctor(&self, state: &str) -> Value {
        let config = self.config("plate.toml");
        let all = [
            "doctor",
            "--json",
            "--state",
            &self.text(state),
            "--config",
            &config,
        ];
        let run = program().run(&all);
        let report: Value = serde_json::from_str(&run.stdout).unwrap();
        let checks = report["steps"]
            .as_array()
            .unwrap_or_else(|| panic!("{report:#}"));
        let heights = checks.iter().find(|check| check["step"] == "heights");
        heights.unwrap_or_else(|| panic!("{report:#}")).clone()
    }

    /// A configuration with this scenario.
    fn config(&self, scenario: &str) -> String {
        let text = format!(
            "[head]\nbackend = \"sim\"\nscenario = {:?}\n",
            self.path(scenario)
        );
        fs::write(self.path("fringed.toml"), text).unwrap();
        self.text("fringed.toml")
    }
}

/// RMS difference over the pixels that both have, which must be nearly all.
fn rms(these: &[f32], those: &[f32]) -> f64 {
    let both = these.iter().zip(those).map(|(a, b)| f64::from(a - b));
    let squares: Vec<f64> = both
        .filter(|off| off.is_finite())
        .map(|off| off * off)
        .collect();
    assert!(squares.len() > 23_000, "{}", squares.len());
    (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
}

fn imported(folder: &Path, name: &str, model: &DeviceModel) -> String {
    let path = folder.join(name);
    fs::write(&path, files::opencv(model, 1.0)).unwrap();
    path.to_str().unwrap().to_owned()
}

#[test]
fn heights_by_the_measured_plane_are_those_of_exact_models_and_better_than_those_of_wrong_ones() {
    let folder = tempfile::tempdir().unwrap();
    let head = Head { folder };
    fs::write(head.path("plate.toml"), HEAD).unwrap();
    fs::write(head.path("part.toml"), format!("{HEAD}{PLACEMENT}")).unwrap();
    let config = head.config("part.toml");
    let (recording, state) = (head.text("recording"), head.text("other"));
    let all = ["record", &recording, "--config", &config, "--state", &state];
    program().run(&all).succeeded();

    let by_models = head.calibrate("exact", &[]);
    assert_eq!(by_models["heights_by"], "models");
    let by_models = head.calibrate("exact", &["--heights-by", "models"]);
    let exact = head.heights("exact");
    let measured = head.calibrate("measured", &["--heights-by", "measured"]);
    assert_eq!(measured["heights_by"], "measured");
    assert_ne!(measured["fingerprint"], by_models["fingerprint"]);
    let off = rms(&head.heights("measured"), &exact);
    println!("exact models: {:.2} µm RMS", off * 1e3);
    assert!(off > 0.0 && off <= MOST_MM, "{off} mm");
    // What was chosen stays until something else is.
    let again = head.calibrate("measured", &[]);
    assert_eq!(again["heights_by"], "measured");

    let rig = Scenario::from_toml(HEAD, "here").unwrap().rig;
    let mut camera = rig.camera.model();
    camera.distortion[0] += HALF_A_PIXEL;
    let camera = imported(head.folder.path(), "camera.yml", &camera);
    let projector = imported(head.folder.path(), "projector.yml", &rig.projector.model());
    let models = [
        "--camera",
        &camera,
        "--projector",
        &projector,
        "--unit",
        "mm",
        "--heights-by",
    ];
    let wrong = |by: &'static str| {
        let state = format!("wrong-{by}");
        head.calibrate(&state, &[&models[..], &[by]].concat());
        (rms(&head.heights(&state), &exact), head.doctor(&state))
    };
    let ((by_models, says), (by_plane, _)) = (wrong("models"), wrong("measured"));
    println!(
        "models half a pixel off: {:.1} µm RMS, by the measured plane {:.1} µm; {says:#}",
        by_models * 1e3,
        by_plane * 1e3
    );
    assert!(by_plane <= 0.5 * by_models, "{by_plane} and {by_models} mm");
    let seen = says["measured"]["difference_rms_mm"].as_f64().unwrap();
    assert!((seen / by_models - 1.0).abs() < 0.5, "{says:#}");
}

#[test]
fn a_plane_is_needed_for_heights_that_go_by_it() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scenario.toml");
    fs::write(&path, HEAD).unwrap();
    let run = program().run(&[
        "calibrate",
        "--scenario",
        path.to_str().unwrap(),
        "--heights-by",
        "measured",
        "--no-plate",
    ]);
    assert_eq!(run.code, 64, "{}", run.stderr);
}
