//! `fringed calibrate` on simulated heads: it measures the values of the scenario, and its files
//! survive a kill.

use crate::written::{FRINGED, program};
use appliance::head::calibration::place::{CalibrationPlace, NamedMap};
use serde_json::Value;
use sim::Scenario;
use std::fs;
use std::path::Path;
use tests::files;
use tests::program::Run;
use tests::small_head::SMALL_HEAD as HEAD;

/// Largest error of the response, levels of 255.
const RESPONSE_TOLERANCE: f64 = 1.0;
/// Largest error of the noise, relative.
const NOISE_TOLERANCE: f64 = 0.05;
/// Largest error of the reference plane, turns.
const RESIDUAL_TOLERANCE: f64 = 5e-4;

/// Calibrates a head of this scenario into the state folder in `folder`.
fn calibrate(folder: &Path, scenario: &str, more: &[&str]) -> Run {
    let path = folder.join("scenario.toml");
    fs::write(&path, scenario).unwrap();
    let state = folder.join("state");
    let mut arguments = vec![
        "calibrate",
        "--json",
        "--state",
        state.to_str().unwrap(),
        "--scenario",
        path.to_str().unwrap(),
    ];
    arguments.extend(more);
    program().run(&arguments)
}

fn calibrated(folder: &Path, scenario: &str, more: &[&str]) -> Value {
    let run = calibrate(folder, scenario, more).succeeded();
    serde_json::from_str(&run.stdout).unwrap()
}

/// Compares everything that was measured with the scenario.
fn check(text: &str, report: &Value) {
    let scenario = Scenario::from_toml(text, "here").unwrap();
    let found = &report["calibration"];
    let delay = found["timing"]["flip_to_light_ns"].as_u64().unwrap();
    assert_eq!(delay, scenario.timing.flip_to_light_us * 1000, "{text}");
    let marks = serde_json::to_value(scenario.timing.stamp).unwrap();
    assert_eq!(found["timing"]["stamp"], marks, "{text}");
    let response = found["response"].as_array().unwrap();
    assert_eq!(response.len(), 256);
    for (grey, light) in response.iter().enumerate() {
        let truth = 255.0 * (grey as f64 / 255.0).powf(scenario.optics.gamma);
        let off = light.as_f64().unwrap() - truth;
        assert!(off.abs() < RESPONSE_TOLERANCE, "{text}\n{grey}: {off}");
    }
    let full_scale = f64::from((1_u32 << scenario.bit_depth) - 1);
    let measured = |key: &str| found["noise"][key].as_f64().unwrap();
    let (noise, truth) = match scenario.noise.noise_counts {
        Some(_) => (measured("counts"), scenario.noise_sigma_counts()),
        // It grows with the light: one electron is so many counts.
        None => (
            measured("shot"),
            scenario.optics.gain * full_scale / scenario.noise.full_well_e,
        ),
    };
    let noise = noise / truth;
    assert!((noise - 1.0).abs() < NOISE_TOLERANCE, "{text}\n{noise}");
    for map in ["vertical", "horizontal"] {
        let residual = found["reference"][map]["residual_turns"].as_f64().unwrap();
        assert!(residual <= RESIDUAL_TOLERANCE, "{text}\n{map} {residual}");
    }
    // The models of a simulated head are exact: this compares both maps with them.
    let pitch = found["reference"]["pitch_px"].as_f64().unwrap();
    let off = found["reference"]["models_off_px"].as_f64().unwrap() / pitch;
    let most = RESIDUAL_TOLERANCE * 2_f64.sqrt();
    assert!(off <= most, "{text}\n{off} turns");
}

/// What may differ from one head to the next.
const HEADS: [&str; 6] = [
    "",
    "[rig.projector]\ndistortion = [0.1, -0.05, 1e-3, -1e-3, 0.0]\n[noise]\nnoise_counts = 0.7\n[light]\nambient = 0.08\n",
    "[timing]\nflip_to_light_us = 33333\nstamp = \"exposure_end\"\nreadout_us = 9000\n[optics]\ngamma = 1.8\n[noise]\nnoise_counts = 10.0\n",
    "[timing]\nflip_to_light_us = 16667\n[optics]\ngamma = 1.4\n[noise]\nnoise_counts = 2.0\n",
    "[timing]\nflip_to_light_us = 50001\nstamp = \"readout_end\"\nreadout_us = 16000\nexposure_refreshes = 1.0\n[optics]\ngamma = 2.2\nprojector_blur_px = 1.0\n",
    "[timing]\nflip_to_light_us = 41234\nexposure_refreshes = 1.0\nreadout_us = 11000\ncamera_period_us = 33333\ncamera_phase_us = 5000\n",
];

#[test]
fn delay_response_noise_and_plane_are_those_of_the_scenario() {
    are_measured(&HEADS[1..3]);
}

#[test]
fn a_camera_that_clips_or_bends_below_full_scale_is_known_by_that() {
    for (optics, from) in [
        ("clips_at = 0.9215686", Some(235..=235)),
        ("knee_at = 0.8\ngain = 0.8", Some(192..=206)),
        ("gamma = 1.0", None),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let scenario = format!("{HEAD}[optics]\n{optics}\n");
        let report = calibrated(folder.path(), &scenario, &[]);
        let found = report["calibration"]["noise"]["clips_from"].as_u64();
        println!("{optics}: {found:?}");
        match (found, from) {
            (Some(found), Some(from)) => assert!(from.contains(&found), "{optics}: {found}"),
            (found, from) => assert!(found.is_none() && from.is_none(), "{optics}: {found:?}"),
        }
    }
}

#[test]
#[ignore = "takes a minute: `.ci/run full`"]
fn delay_response_noise_and_plane_are_those_of_every_scenario() {
    are_measured(&HEADS);
}

/// Calibrates these heads, and one of 12 bits that slips.
fn are_measured(heads: &[&str]) {
    let folder = tempfile::tempdir().unwrap();
    for rest in heads {
        let scenario = format!("{HEAD}{rest}");
        check(&scenario, &calibrated(folder.path(), &scenario, &[]));
    }
    let deep = format!(
        "bit_depth = 12\n{HEAD}[faults]\nflip_jitter_us = 0\nlate_flip = 0.05\nlate_refreshes = 2\ndropped = 0.02\n"
    );
    check(&deep, &calibrated(folder.path(), &deep, &[]));
}

#[test]
fn the_default_head_is_calibrated_on_a_plate_that_lies_there_by_itself() {
    let folder = tempfile::tempdir().unwrap();
    let scenario = "sub_rays = 2\n[timing]\nflip_to_light_us = 25000\n[optics]\ngamma = 1.3\n[rig.camera]\nwidth = 256\nheight = 256\n";
    let report = calibrated(folder.path(), scenario, &["--temperature", "31.5"]);
    check(scenario, &report);
    assert_eq!(report["calibration"]["temperature_c"], 31.5);
    let notes = report["notes"].as_array().unwrap();
    assert!(
        notes
            .iter()
            .any(|note| note.as_str().unwrap().contains("plate"))
    );
    for map in ["vertical", "horizontal"] {
        let name = report["calibration"]["reference"][map]["file"]
            .as_str()
            .unwrap();
        let bytes = fs::read(folder.path().join("state/calibration").join(name)).unwrap();
        let turns = hal::npy::read::<f64>(&bytes).unwrap();
        assert_eq!((turns.rows, turns.columns), (256, 256));
        assert!(turns.elements.iter().all(|turns| turns.is_finite()));
    }
}

#[test]
fn a_tilted_plate_saturation_darkness_and_a_recording_are_refused_with_the_remedy() {
    let folder = tempfile::tempdir().unwrap();
    for (rest, word) in [
        ("[placement]\nshift_mm = [0.0, 0.0, 8.0]\n", "plane z = 0"),
        ("[optics]\ngain = 3.0\n", "expose less"),
        ("[optics]\ngain = 0.15\n", "expose more"),
        ("[light]\ndiffuse = 0.0\n", "lamp"),
        (
            "[optics]\ncontent_gain = -0.2\n",
            "depends on the rest of the picture",
        ),
        ("[faults]\nwire_open = true\n", "trigger"),
        ("[faults]\ncompressed = true\n", "compressed"),
    ] {
        let run = calibrate(folder.path(), &format!("{HEAD}{rest}"), &[]);
        assert!([65, 69].contains(&run.code), "{rest}: {}", run.code);
        assert!(run.stderr.contains(word), "{rest}: {}", run.stderr);
    }
    let json = folder.path().join("state/calibration/calibration.json");
    assert!(!json.exists(), "nothing was written");
    let config = folder.path().join("fringed.toml");
    fs::write(
        &config,
        "[head]\nbackend = \"replay\"\nrecordings = [\"somewhere\"]\n",
    )
    .unwrap();
    let run = program().run(&["calibrate", "--config", config.to_str().unwrap()]);
    assert_eq!(run.code, 64, "{}", run.stderr);
    assert!(run.stderr.contains("--scenario"), "{}", run.stderr);
}

/// Writes the configuration of a head of this scenario, and makes a state folder beside it.
fn configured(folder: &Path, scenario: &str) -> String {
    fs::write(folder.join("scenario.toml"), scenario).unwrap();
    let config = folder.join("fringed.toml");
    let text = "state = \"state\"\n[head]\nbackend = \"sim\"\nscenario = \"scenario.toml\"\n";
    fs::write(&config, text).unwrap();
    config.to_str().unwrap().to_owned()
}

#[test]
fn what_the_doctor_complained_of_is_well_once_it_is_calibrated() {
    let folder = tempfile::tempdir().unwrap();
    let ill = "[optics]\ngamma = 2.2\n[timing]\nflip_to_light_us = 41234\ncalibrated_flip_to_light_us = 8000\n";
    let config = configured(folder.path(), &format!("{HEAD}{ill}"));
    let doctor = || program().run(&["doctor", "--json", "--config", &config]);
    let before = doctor();
    assert_eq!(before.code, 69);
    assert!(
        before.stderr.contains("delay, response"),
        "{}",
        before.stderr
    );
    program()
        .run(&["calibrate", "--quiet", "--config", &config])
        .succeeded();
    let after: Value = serde_json::from_str(&doctor().succeeded().stdout).unwrap();
    assert_eq!(after["healthy"], true, "{after:#}");
}

#[test]
fn models_made_with_opencv_are_imported_and_stay() {
    let folder = tempfile::tempdir().unwrap();
    let scenario = format!("{HEAD}[timing]\nflip_to_light_us = 16667\n");
    let rig = Scenario::from_toml(&scenario, "here").unwrap().rig;
    let write = |name: &str, model: &hal::model::DeviceModel, metres: f64| {
        let path = folder.path().join(name);
        fs::write(&path, files::opencv(model, metres)).unwrap();
        path.to_str().unwrap().to_owned()
    };
    let camera = write("camera.yml", &rig.camera.model(), 1e-3);
    let projector = write("projector.yml", &rig.projector.model(), 1e-3);
    let import = ["--camera", &camera, "--projector", &projector];
    let with = |more: &[&str]| calibrate(folder.path(), &scenario, &[&import, more].concat());

    let run = with(&[]);
    assert_eq!(
        (run.code, run.stderr.contains("--unit")),
        (65, true),
        "{}",
        run.stderr
    );
    // With z reversed the camera looks from below.
    let run = with(&["--unit", "m", "--z-away"]);
    assert_eq!(run.code, 65, "{}", run.stderr);
    assert!(run.stderr.contains("not above the plane"), "{}", run.stderr);
    let run = with(&["--unit", "m", "--models", "x"]);
    assert_eq!(run.code, 64, "{}", run.stderr);
    // Models of another projector: the plate shows that they are wrong.
    let mut other = rig.projector.model();
    other.cx += 4.0;
    let other = write("other.yml", &other, 1e-3);
    let import = ["--camera", &camera, "--projector", &other];
    let run = calibrate(
        folder.path(),
        &scenario,
        &[&import[..], &["--unit", "m"]].concat(),
    );
    assert_eq!(run.code, 65, "{}", run.stderr);
    assert!(
        run.stderr.contains("off the measured plate"),
        "{}",
        run.stderr
    );
    let run = calibrate(folder.path(), &scenario, &["--models", "/no/such.yml"]);
    assert_eq!(run.code, 66, "{}", run.stderr);
    assert!(
        !folder
            .path()
            .join("state/calibration/calibration.json")
            .exists()
    );

    let first: Value = serde_json::from_str(&with(&["--unit", "m"]).succeeded().stdout).unwrap();
    check(&scenario, &first);
    let from = first["calibration"]["models_from"].as_str().unwrap();
    assert!(from.contains("camera.yml") && from.contains("projector.yml"));
    // To another file: the station's calibration stays.
    let stored = fs::read(folder.path().join("state/calibration/calibration.json")).unwrap();
    let out = folder.path().join("elsewhere.json");
    let to = ["--unit", "m", "--out", out.to_str().unwrap()];
    with(&to).succeeded();
    let elsewhere: Value = serde_json::from_slice(&fs::read(&out).unwrap()).unwrap();
    assert_eq!(
        elsewhere["fingerprint"],
        first["calibration"]["fingerprint"]
    );
    assert_eq!(
        fs::read(folder.path().join("state/calibration/calibration.json")).unwrap(),
        stored
    );
    let again = calibrated(folder.path(), &scenario, &[]);
    for key in ["camera", "projector", "models_from", "fingerprint"] {
        assert_eq!(
            first["calibration"][key], again["calibration"][key],
            "{key}"
        );
    }
}

/// Checks that each readable generation is complete, with its maps; returns the file fingerprint of
/// the newest.
fn whole(folder: &Path) -> String {
    let json = folder.join("state/calibration/calibration.json");
    let loaded = CalibrationPlace::at(&json)
        .load()
        .unwrap()
        .expect("a calibration");
    assert_eq!(loaded.fallback, None);
    let maps = loaded.file.reference.as_ref().expect("a plate");
    for map in [&maps.vertical, &maps.horizontal] {
        let bytes = fs::read(json.with_file_name(&map.file)).unwrap();
        let named = NamedMap::new(map.file.rsplit_once('-').unwrap().0, bytes);
        assert_eq!((&named.file, &named.sha256), (&map.file, &map.sha256));
    }
    loaded.file.checksum
}

#[test]
fn kill_9_while_it_is_written_leaves_the_old_calibration_or_the_new_one() {
    let folder = tempfile::tempdir().unwrap();
    calibrated(folder.path(), HEAD, &[]);
    let mut last = whole(folder.path());
    let place = folder.path().join("state/calibration");
    let names = || -> Vec<_> {
        let entries = fs::read_dir(&place).unwrap().flatten();
        let mut names: Vec<_> = entries
            .map(|entry| {
                (
                    entry.file_name(),
                    entry.metadata().ok().map(|found| found.len()),
                )
            })
            .collect();
        names.sort();
        names
    };
    let mut kept = 0;
    for changes in 1..=6 {
        // The noise differs each time, so every file changes.
        let scenario = format!("{HEAD}[noise]\nseed = {changes}\n");
        fs::write(folder.path().join("scenario.toml"), scenario).unwrap();
        let mut child = std::process::Command::new(FRINGED)
            .args(["calibrate", "--quiet", "--state"])
            .arg(folder.path().join("state"))
            .arg("--scenario")
            .arg(folder.path().join("scenario.toml"))
            .spawn()
            .unwrap();
        let (mut before, mut seen) = (names(), 0);
        while seen < changes && child.try_wait().unwrap().is_none() {
            let now = names();
            if now != before {
                (before, seen) = (now, seen + 1);
            }
            std::thread::yield_now();
        }
        // SIGKILL; the program may have ended already.
        let _ = child.kill();
        child.wait().unwrap();
        let now = whole(folder.path());
        kept += u32::from(now == last);
        last = now;
    }
    println!("6 kills while writing: {kept} left the old calibration, the others the new one");
    // Kills leave files behind. They are ignored and removed; here is every kind of them.
    for left in [
        "calibration.json.new",
        "calibration.json.previous.new",
        "reference_vertical-0123456789abcdef.npy.new",
        "reference_vertical-0123456789abcdef.npy",
    ] {
        // After a kill it may be a hard link to a valid file.
        let _ = fs::remove_file(place.join(left));
        fs::write(place.join(left), "half").unwrap();
    }
    assert_eq!(whole(folder.path()), last);
    calibrated(folder.path(), HEAD, &[]);
    whole(folder.path());
    assert!(names().len() <= 6, "{:?}", names());
}

#[test]
fn a_damaged_calibration_gives_way_to_the_one_before_and_is_never_guessed() {
    let folder = tempfile::tempdir().unwrap();
    calibrated(folder.path(), HEAD, &[]);
    let first = whole(folder.path());
    calibrated(folder.path(), &format!("{HEAD}[noise]\nseed = 9\n"), &[]);
    let json = folder.path().join("state/calibration/calibration.json");
    let text = fs::read_to_string(&json).unwrap();
    let load = |text: &str| {
        fs::write(&json, text).unwrap();
        CalibrationPlace::at(&json).load()
    };
    let digit = text.replacen("\"counts\": ", "\"counts\": 1", 1);
    let [older, newer] =
        [1, 3].map(|other| text.replacen("\"version\": 2", &format!("\"version\": {other}"), 1));
    let unknown = text.replacen("\"version\"", "\"vesion\": 1, \"version\"", 1);
    for (damaged, words) in [
        (&text[..text.len() / 2], "damaged"),
        ("", "damaged"),
        ("[]", "damaged"),
        (&*digit, "checksum"),
        (&*older, "version 1, this program reads 2: calibrate anew"),
        (&*newer, "version 3, this program reads 2: calibrate anew"),
        (&*unknown, "vesion"),
    ] {
        assert_ne!(damaged, text);
        let loaded = load(damaged).unwrap().unwrap();
        assert_eq!(loaded.file.checksum, first);
        let fallback = loaded.fallback.unwrap();
        assert!(
            fallback.contains(words) && fallback.contains("previous generation"),
            "{fallback}"
        );
    }
    fs::write(json.with_extension("json.previous"), "neither").unwrap();
    let problem = load(&digit).unwrap_err().to_string();
    assert!(
        problem.contains("calibrate anew") && problem.contains("calibration.json"),
        "{problem}"
    );
    // Calibrating again works without it.
    let report = calibrated(folder.path(), HEAD, &[]);
    let notes = report["notes"].to_string();
    assert!(notes.contains("left behind"), "{notes}");
    whole(folder.path());
}
