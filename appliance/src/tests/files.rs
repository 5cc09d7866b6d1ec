//! Boundary values in calibrations, models of OpenCV, recordings, scenarios and configurations.

use super::{Place, Tally, one_in, values};
use crate::config::Config;
use crate::head::calibration::file::{
    CalibratedCamera, CalibratedProjector, CalibrationFile, ContrastFile, FORMAT, LevelFile,
    NoiseFile, PitchFile, TimingFile, VERSION,
};
use crate::head::calibration::geometry::{
    BoardFile, GeometryFile, MapFile, PoseFile, ReferenceFile,
};
use crate::head::calibration::opencv::{Declared, Sizes, from_two};
use crate::head::calibration::{Calibration, HeightsBy};
use crate::head::exposing::Exposing;
use crate::head::seam;
use crate::measure::measure;
use algo::pattern::Shot;
use hal::frame::{Frame, FrameFormat, Pixels};
use hal::head::Stamp;
use hal::model::PlaneModel;
use hal::replay::Recording;
use hal::replay::recording::{PatternSpec, RecipeReference, RecordedCode};
use hal::units::Timestamp;
use serde_json::{Value, json};
use sim::Scenario;
use std::cell::Cell;
use std::fmt::Write as _;
use std::fs;
use std::sync::Arc;

fn small_head() -> Scenario {
    let mut scenario = Scenario {
        sub_rays: 1,
        ..Scenario::default()
    };
    (scenario.rig.camera.width, scenario.rig.camera.height) = (16, 12);
    (scenario.rig.projector.width, scenario.rig.projector.height) = (32, 24);
    scenario
}

#[test]
fn a_boundary_value_in_a_calibration_is_refused_by_its_key_or_the_head_is_known_by_it() {
    let Scenario { rig, bit_depth, .. } = small_head();
    let map = |name: &str| MapFile {
        file: format!("{name}.npy"),
        sha256: "0".repeat(64),
        residual_turns: 1e-4,
        noise_turns: 1e-3,
        filled: 0.99,
    };
    let file = CalibrationFile {
        format: FORMAT.into(),
        version: VERSION,
        fingerprint: String::new(),
        checksum: String::new(),
        made_by: "fringed".into(),
        made_at_unix_s: 0,
        temperature_c: Some(30.0),
        models_from: "scenario".into(),
        camera: CalibratedCamera {
            width: rig.camera.width,
            height: rig.camera.height,
            bit_depth,
            model: rig.camera.model(),
        },
        projector: CalibratedProjector {
            width: rig.projector.width,
            height: rig.projector.height,
            model: rig.projector.model(),
        },
        timing: Some(TimingFile {
            flip_to_light_ns: 1000,
            sigma_ns: 10,
            stamp: Stamp::ExposureStart,
            stamp_late_ns: Some(150_000),
            readout_ns: 0,
            refreshes: Some(3),
        }),
        noise: Some(NoiseFile {
            counts: 3.0,
            read_counts: 1.0,
            shot: 0.01,
            clips_from: None,
            levels: vec![LevelFile {
                level: 100.0,
                counts: 3.0,
            }],
            exposing: Some(Exposing {
                exposure_us: 16_667,
                gain: 2.0,
            }),
        }),
        response: Some((0..256).map(f64::from).collect()),
        contrast: Some(ContrastFile {
            modulation_counts: 90.0,
            pitches: vec![PitchFile {
                pitch_px: 16,
                contrast: 1.0,
            }],
        }),
        heights_by: HeightsBy::Measured,
        reference: Some(ReferenceFile {
            pitch_px: 16.0,
            models_off_px: 0.01,
            plane: PlaneModel {
                xi: [0.5; 28],
                eta: [0.5; 28],
            },
            vertical: map("reference_vertical"),
            horizontal: map("reference_horizontal"),
        }),
        geometry: Some(GeometryFile {
            board: BoardFile {
                columns: 9,
                rows: 13,
                square_mm: 10.0,
                sigma_ppm: 200.0,
                bow_mm: [0.01, 0.02, -0.03],
            },
            baseline_mm: 250.0,
            camera_px: 0.1,
            projector_px: 0.1,
            height_sigma_mm: 0.01,
            length_sigma_mm: 0.03,
            poses: vec![PoseFile {
                recording: "pose-1".into(),
                corners: 117,
                camera_px: 0.1,
                projector_px: 0.1,
                tilt_degrees: 20.0,
                distance_mm: 400.0,
            }],
        }),
    };
    let (file, _) = file.sealed().unwrap();
    let tree = serde_json::to_value(&file).unwrap();
    let write = |tree: &Value| serde_json::to_string_pretty(tree).unwrap();
    let mut tally = Tally::default();
    tally.walk(&tree, |place, value| {
        let text = place.replaced(&tree, value, write);
        let read = CalibrationFile::read(text.as_bytes());
        // A well-formed file would be refused for its checksum alone, so it gets the right one.
        let Ok(file) = serde_json::from_str::<CalibrationFile>(&text) else {
            return Ok(read.map(drop)?);
        };
        let (file, bytes) = file.sealed()?;
        assert_eq!(CalibrationFile::read(&bytes)?, file);
        file.calibration()?;
        Ok(())
    });
    tally.end("calibration", 9000);
}

#[test]
fn a_boundary_value_in_a_model_of_opencv_is_refused_by_its_node_or_a_device_is_known_by_it() {
    const YAML: &str = "image_width: 512
image_height: 512
camera_matrix:
   rows: 3
   cols: 3
   dt: d
   data: [ 1451.85, 0., 255.5, 0., 1451.85, 255.5, 0., 0., 1. ]
distortion_coefficients:
   rows: 1
   cols: 5
   dt: d
   data: [ -0.12, 0.15, 0.0002, -0.0003, 0. ]
R:
   rows: 3
   cols: 3
   dt: d
   data: [ 0.9396926, 0., -0.3420201, 0., -1., 0., -0.3420201, 0., -0.9396926 ]
T:
   rows: 3
   cols: 1
   dt: d
   data: [ 0., 0., 600. ]
unit: mm
";
    let folder = tempfile::tempdir().unwrap();
    let (camera, projector) = (
        folder.path().join("camera"),
        folder.path().join("projector"),
    );
    fs::write(&projector, YAML).unwrap();
    let size = (512, 512);
    let read = |text: &str| {
        fs::write(&camera, text).unwrap();
        let sizes = Sizes {
            camera: size,
            projector: size,
        };
        let models = from_two(&camera, &projector, sizes, Declared::default())
            .map_err(|failure| failure.to_string())?;
        let models = (&models.camera, &models.projector);
        Calibration::new((size.0, size.1, 8), size, models, 1.0)?;
        Ok(())
    };
    read(YAML).unwrap();
    let mut tally = Tally::default();
    let words: Vec<&str> = YAML.split([' ', '\n', ',']).collect();
    let mut from = 0;
    for word in words.into_iter().filter(|word| !word.is_empty()) {
        let at = from + YAML[from..].find(word).unwrap();
        from = at + word.len();
        // Nodes have no keys that messages repeat, but every message names the file, which is
        // called `camera`.
        let place = Place(vec!["camera".into()]);
        for value in values()
            .iter()
            .map(String::as_str)
            .chain([".Nan", "-.Inf", "*a", "!!x y"])
        {
            let text = [&YAML[..at], value, &YAML[from..]].concat();
            tally.run(&place, value, || read(&text));
        }
    }
    tally.end("model of OpenCV", 2000);
}

/// A recording of a few pixels with every optional key.
fn recording() -> Recording {
    let picture = || {
        let format = FrameFormat::packed(16, 12, 8);
        Frame::new(format, Arc::new(Pixels::zeroed(&format)), Timestamp(0), 0).unwrap()
    };
    let scenario = small_head();
    let calibration = Calibration::of_scenario(&scenario).unwrap();
    let format = FrameFormat::packed(16, 12, 8);
    let levels = [0.03, 0.2, 1.0];
    let shots = levels.into_iter().flat_map(|ratio| Shot::level(ratio, 3));
    let frames = (0..).zip(shots).map(|(at, shot)| {
        let sample = |u: usize| {
            let turns = shot.ratio * 30.0 * u as f64 / 16.0 + shot.shift;
            (127.0 + 100.0 * (std::f64::consts::TAU * turns).sin()) as u8
        };
        let pixels = Pixels::Eight((0..16 * 12).map(|at| sample(at % 16)).collect());
        let frame = Frame::new(format, Arc::new(pixels), Timestamp(at * 1000), at);
        seam::recorded(shot, frame.unwrap())
    });
    Recording {
        description: "a test".into(),
        notes: Vec::new(),
        source: "computed".into(),
        noise_counts: Some(3.7),
        patterns: vec![PatternSpec::Vertical { fringes: 30.0 }],
        frames: frames.collect(),
        codes: vec![RecordedCode {
            pattern: 0,
            cell_px: 8.0,
            offset_px: 0.0,
            binary: false,
            inverted: false,
            bits: (0..2).map(|_| picture()).collect(),
            inverse: (0..2).map(|_| picture()).collect(),
        }],
        white: Some(picture()),
        black: Some(picture()),
        range_mm: Some([-50.0, 50.0]),
        exposure_us: Some(33_333.0),
        part_id: Some("7".into()),
        recipe: Some(RecipeReference {
            number: 1,
            fingerprint: "0".repeat(64),
        }),
        ..calibration.recording()
    }
}

#[test]
fn a_boundary_value_in_a_recording_is_refused_by_its_key_or_it_is_measured() {
    let folder = tempfile::tempdir().unwrap();
    let place = folder.path().join("recording");
    hal::replay::recorder::write(&recording(), &place).unwrap();
    let manifest = place.join("recording.json");
    let tree: Value = serde_json::from_slice(&fs::read(&manifest).unwrap()).unwrap();
    let write = |tree: &Value| serde_json::to_string_pretty(tree).unwrap();
    let mut tally = Tally::default();
    tally.walk(&tree, |place_of_value, value| {
        fs::write(&manifest, place_of_value.replaced(&tree, value, write)).unwrap();
        let recording = Recording::open(&place).map_err(|error| error.to_string())?;
        // The frames may show nothing; that is not checked here.
        drop(measure(&recording, &place));
        Ok(())
    });
    tally.end("recording", 3600);
}

/// A tree as TOML. Tables come after values, so that each value keeps its table.
fn toml(tree: &Value) -> String {
    fn inline(value: &Value) -> String {
        match value {
            Value::Object(map) => {
                let pairs = map
                    .iter()
                    .filter(|(_, value)| !value.is_null())
                    .map(|(key, value)| format!("{key} = {}", inline(value)));
                format!("{{ {} }}", pairs.collect::<Vec<_>>().join(", "))
            }
            Value::Array(list) => {
                let all: Vec<String> = list.iter().map(inline).collect();
                format!("[{}]", all.join(", "))
            }
            other => other.to_string(),
        }
    }
    let mut text = String::new();
    let all = tree.as_object().unwrap().iter();
    for (key, value) in all.filter(|(_, value)| !value.is_null()) {
        let _ = writeln!(text, "{key} = {}", inline(value));
    }
    text
}

/// A boundary value of JSON as TOML writes it.
fn in_toml(value: &str) -> &str {
    match value {
        "NaN" => "nan",
        "1e999" => "inf",
        "-1e999" => "-inf",
        other => other,
    }
}

#[test]
fn a_boundary_value_in_a_scenario_is_refused_by_its_key_or_the_scene_can_be_lit() {
    // Of those that can be read one in so many lights its scene.
    let lit = one_in();
    let readable = Cell::new(0);
    let light = |scenario: &Scenario| {
        readable.set(readable.get() + 1);
        match readable.get() % lit {
            0 => sim::head(scenario)
                .map(drop)
                .map_err(|error| error.to_string()),
            _ => Ok(()),
        }
    };
    let mut scenario = small_head();
    scenario.timing.calibrated_flip_to_light_us = Some(0);
    scenario.timing.calibrated_refreshes = Some(2);
    scenario.timing.calibrated_stamp_late_us = Some(0);
    let mut tree = serde_json::to_value(&scenario).unwrap();
    tree["part"]["defects"] = json!([
        { "kind": "dent", "x": 0.0, "y": -8.0, "depth_mm": 0.6, "diameter_mm": 14.0 },
        { "kind": "missing_hole", "index": 0 },
        { "kind": "bent_flange", "degrees": 2.0 },
    ]);
    let mut tally = Tally::default();
    tally.walk(&tree, |place, value| {
        let text = place.replaced(&tree, in_toml(value), toml);
        let scenario = Scenario::from_toml(&text, "here").map_err(|error| error.to_string())?;
        Calibration::of_scenario(&scenario)?;
        let camera = &scenario.rig.camera;
        if camera.width * camera.height * scenario.sub_rays.pow(2) <= 16 * 12 * 4 {
            light(&scenario)?;
        }
        Ok(())
    });
    for part in [
        "cone",
        "sawtooth",
        "sphere",
        "tube",
        "flowerpot",
        "spline",
        "face",
        "handset",
        "plane",
        "board",
    ] {
        let text = format!("[part]\nkind = \"{part}\"\n");
        let part = Scenario::from_toml(&text, "here").unwrap().part;
        let mut tree = tree.clone();
        tree["part"] = serde_json::to_value(part).unwrap();
        let only = json!({ "part": tree["part"] });
        let scene = |part: &Value| {
            let mut tree = tree.clone();
            tree["part"] = part["part"].clone();
            toml(&tree)
        };
        tally.walk(&only, |place, value| {
            let text = place.replaced(&only, in_toml(value), scene);
            let scenario = Scenario::from_toml(&text, "here").map_err(|error| error.to_string())?;
            light(&scenario)
        });
    }
    tally.end("scenario", 5000);
}

#[test]
fn a_boundary_value_in_a_configuration_is_refused_by_its_key_or_it_can_be_read_again() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("fringed.toml");
    let mut config = Config {
        state: Some("state".into()),
        ..Config::default()
    };
    config.modbus.strict_unit_id = Some(1);
    config.http.hosts = vec!["sensor.local".into()];
    let head = &mut config.head;
    (head.scenario, head.calibration) = (Some("a.toml".into()), Some("c.json".into()));
    head.recordings = vec!["recording".into()];
    let (camera, projector) = (&mut head.camera, &mut head.projector);
    (camera.width, camera.height) = (Some(1456), Some(1088));
    camera.id = Some("camera".into());
    (projector.width, projector.height) = (Some(912), Some(1140));
    (projector.card, projector.connector) = (Some("/dev/dri/card1".into()), Some("DPI-1".into()));
    projector.refresh_hz = Some(60.0);
    head.trigger.line = Some("GPIO1".into());
    config.lines.start = Some("GPIO2".into());
    config.lines.busy = Some("GPIO3".into());
    config.lines.ok = Some("GPIO4".into());
    config.lines.fault = Some("GPIO5".into());
    let tree = serde_json::to_value(&config).unwrap();
    let mut tally = Tally::default();
    tally.walk(&tree, |place, value| {
        fs::write(&path, place.replaced(&tree, in_toml(value), toml)).unwrap();
        let config = Config::read(&path).map_err(|failure| failure.to_string())?;
        let text = toml::to_string(&config).map_err(|error| error.to_string())?;
        fs::write(&path, text).unwrap();
        assert_eq!(Config::read(&path).unwrap(), config);
        Ok(())
    });
    tally.end("configuration", 1500);
}
