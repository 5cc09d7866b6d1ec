//! Bad input gives a clear error, and no file is lost.
//!
//! Exit codes: 64 usage, 65 wrong content, 66 missing input, 73 output cannot be created.

use crate::written::{Written, geometric, program};
use hal::replay::Recording;
use hal::replay::recording::PatternSpec;
use serde_json::{Value, json};
use std::fs;
use tests::files;
use tests::program::Run;
use tests::render::{Scene, levels};

/// A recording of a few pixels, as it is never measured.
fn tiny() -> Recording {
    Scene {
        size: 16,
        projector: (32, 24),
        patches: false,
        ..geometric()
    }
    .record()
}

/// Damages a tiny recording, measures it, and expects exit code 65 and a message that contains
/// `words`.
fn refused(recording: &Recording, damage: impl FnOnce(&Written), words: &[&str]) {
    let written = Written::new(recording);
    damage(&written);
    check(&written, &written.measure(&[]), 65, words);
}

fn check(written: &Written, run: &Run, code: i32, words: &[&str]) {
    assert_eq!(run.code, code, "{words:?}: {}", run.stderr);
    for word in words {
        assert!(run.stderr.contains(word), "no {word:?} in: {}", run.stderr);
    }
    assert_eq!(run.stdout, "", "{words:?}");
    assert!(files::names(&written.out()).is_empty(), "{words:?}");
}

/// Changes the manifest and expects a refusal.
fn refused_manifest(change: impl FnOnce(&mut Value), words: &[&str]) {
    let words: Vec<&str> = ["recording.json"].iter().chain(words).copied().collect();
    refused(&tiny(), |written| written.edit(change), &words);
}

#[test]
fn an_undamaged_tiny_recording_is_measured() {
    Written::new(&tiny()).measure(&[]).succeeded();
}

#[test]
fn a_missing_frame_is_refused_by_name() {
    refused(
        &tiny(),
        |written| fs::remove_file(written.recording().join("frames/004.png")).unwrap(),
        &["frames/004.png", "missing"],
    );
}

#[test]
fn a_frame_cut_off_anywhere_is_refused_by_name() {
    let whole = {
        let written = Written::new(&tiny());
        fs::read(written.recording().join("frames/007.png")).unwrap()
    };
    for length in [
        0,
        1,
        8,
        20,
        40,
        whole.len() / 2,
        whole.len() - 13,
        whole.len() - 1,
    ] {
        refused(
            &tiny(),
            |written| {
                let path = written.recording().join("frames/007.png");
                fs::write(path, &whole[..length]).unwrap();
            },
            &["frames/007.png"],
        );
    }
}

#[test]
fn a_frame_of_another_size_or_depth_is_refused_with_both() {
    let larger = Scene {
        size: 17,
        ..geometric()
    };
    let deeper = Scene {
        size: 16,
        bit_depth: 12,
        ..geometric()
    };
    for (other, words) in [
        (larger, ["frames/002.png", "16×16", "17×17"]),
        (deeper, ["frames/002.png", "8 bit", "16 bit"]),
    ] {
        let other = Written::new(&other.record());
        let from = other.recording().join("frames/002.png");
        refused(
            &tiny(),
            |written| {
                fs::copy(from, written.recording().join("frames/002.png")).unwrap();
            },
            &words,
        );
    }
    refused_manifest(|m| m["camera"]["bit_depth"] = json!(7), &["bit_depth"]);
    refused_manifest(|m| m["camera"]["bit_depth"] = json!(17), &["bit_depth"]);
    // 12-bit samples where the manifest says 10.
    let deep = Scene {
        size: 16,
        bit_depth: 12,
        ..geometric()
    };
    refused(
        &deep.record(),
        |written| written.edit(|m| m["camera"]["bit_depth"] = json!(10)),
        &["frames/", "1023"],
    );
}

#[test]
fn unequal_too_few_or_repeated_shifts_are_refused() {
    refused_manifest(|m| m["frames"][5]["shift_turns"] = json!(0.3), &["shift"]);
    refused_manifest(|m| m["frames"][5]["shift_turns"] = json!(0.0), &["shift"]);
    refused_manifest(
        |m| m["frames"].as_array_mut().unwrap().truncate(10),
        &["at least 3"],
    );
    refused_manifest(|m| m["frames"] = json!([]), &["frames"]);
    refused_manifest(|m| m["frames"][1]["ratio"] = json!(0.01921), &["ratio"]);
    refused_manifest(|m| m["frames"][1]["ratio"] = json!(-0.5), &["ratio"]);
}

#[test]
fn ratios_that_have_no_absolute_phase_are_named_with_what_to_add() {
    let written = Written::new(&tiny());
    written.edit(|m| {
        for frame in &mut m["frames"].as_array_mut().unwrap()[..4] {
            frame["ratio"] = json!(0.043);
        }
        // With models they are unwrapped about the reference map.
        for device in ["camera", "projector"] {
            m[device].as_object_mut().unwrap().remove("model");
        }
    });
    written.measure(&[]).succeeded();
    let report = fs::read_to_string(written.out().join("report.json")).unwrap();
    let report: Value = serde_json::from_str(&report).unwrap();
    let words = report["no_phase"].as_str().unwrap();
    for word in ["0.043", "0.138", "add a coarser level"] {
        assert!(words.contains(word), "{words}");
    }
}

#[test]
fn unknown_keys_are_refused_by_name_wherever_they_stand() {
    refused_manifest(|m| m["colour"] = json!(1), &["colour"]);
    refused_manifest(|m| m["camera"]["lens"] = json!("f/2"), &["lens"]);
    refused_manifest(|m| m["camera"]["model"]["skew"] = json!(0), &["skew"]);
    refused_manifest(|m| m["projector"]["gamma"] = json!(2.2), &["gamma"]);
    refused_manifest(|m| m["pattern"]["pitch"] = json!(8), &["pitch"]);
    refused_manifest(|m| m["frames"][3]["gain"] = json!(1), &["gain"]);
}

#[test]
fn missing_keys_and_wrong_types_are_refused_by_name() {
    let remove = |key: &'static str| {
        move |m: &mut Value| {
            m.as_object_mut().unwrap().remove(key);
        }
    };
    for key in [
        "format",
        "version",
        "camera",
        "projector",
        "pattern",
        "frames",
    ] {
        refused_manifest(remove(key), &[key]);
    }
    refused_manifest(|m| m["camera"]["width"] = json!("wide"), &["wide"]);
    refused_manifest(|m| m["pattern"]["kind"] = json!("diagonal"), &["diagonal"]);
    refused_manifest(|m| m["pattern"]["fringes"] = json!(0), &["fringes"]);
    refused_manifest(|m| m["range_mm"] = json!([10, -10]), &["range_mm"]);
    refused(
        &tiny(),
        |written| fs::write(written.manifest(), "{\"format\": ").unwrap(),
        &["recording.json", "JSON"],
    );
}

#[test]
fn a_newer_version_is_called_that() {
    refused_manifest(
        |m| {
            m["version"] = json!(4);
            m["something_new"] = json!(true);
        },
        &["version 4", "newer", "update"],
    );
    refused_manifest(
        |m| m["format"] = json!("fringed-recipe"),
        &["fringed-recipe"],
    );
}

#[test]
fn numbers_that_are_none_are_refused() {
    for text in ["1e999", "-1e999", "NaN", "Infinity", "null"] {
        for key in ["fx", "cy"] {
            refused(
                &tiny(),
                |written| {
                    written.edit(|m| m["camera"]["model"][key] = json!(123_454_321));
                    written.replace("123454321", text);
                },
                &["recording.json"],
            );
        }
    }
}

/// Changes the model of a device and expects a refusal.
fn refused_model(device: &str, change: impl Fn(&mut Value), words: &[&str]) {
    let words: Vec<&str> = [device].iter().chain(words).copied().collect();
    refused_manifest(|m| change(&mut m[device]["model"]), &words);
}

#[test]
fn absurd_models_are_refused_by_device_and_number() {
    for device in ["camera", "projector"] {
        refused_model(device, |m| m["fx"] = json!(-1000.0), &["focal"]);
        refused_model(device, |m| m["fy"] = json!(0.0), &["focal"]);
        refused_model(device, |m| m["rotation"][0] = json!(0.5), &["rotation"]);
        let mirror = |m: &mut Value| {
            for i in 0..9 {
                let r = m["rotation"][i].as_f64().unwrap();
                m["rotation"][i] = json!(-r);
            }
        };
        refused_model(device, mirror, &["rotation"]);
        refused_model(
            device,
            |m| m["distortion"][0] = json!(-20.0),
            &["distortion"],
        );
        refused_model(device, |m| m["cx"] = json!(1e7), &["principal point"]);
        // Below the plane, and above it but looking up.
        let below = |m: &mut Value| m["translation_mm"] = json!([0.0, 0.0, -600.0]);
        refused_model(device, below, &["above the plane"]);
        let upwards = |m: &mut Value| {
            m["rotation"] = json!([1, 0, 0, 0, 1, 0, 0, 0, 1]);
            m["translation_mm"] = json!([0, 0, -600]);
        };
        refused_model(device, upwards, &["above the plane"]);
    }
    let same_place = |m: &mut Value| {
        m["projector"]["model"]["translation_mm"] = m["camera"]["model"]["translation_mm"].clone();
        m["projector"]["model"]["rotation"] = m["camera"]["model"]["rotation"].clone();
    };
    refused_manifest(same_place, &["baseline"]);
    let through_the_camera = |m: &mut Value| m["range_mm"] = json!([-10.0, 900.0]);
    refused_manifest(through_the_camera, &["range"]);
}

#[test]
fn a_broken_pattern_or_truth_is_refused_by_name() {
    let spec = PatternSpec::File {
        rows: 24,
        columns: 32,
        turns: (0..24 * 32).map(|at| f64::from(at % 32)).collect(),
    };
    let scene = Scene {
        size: 16,
        projector: (32, 24),
        patterns: vec![spec],
        ..Scene::new(0.0, levels(&[0.03, 0.2, 1.0], 4))
    };
    let recording = scene.record();
    let cut = |name: &'static str| {
        move |written: &Written| {
            let path = written.recording().join(name);
            let bytes = fs::read(&path).unwrap();
            fs::write(path, &bytes[..bytes.len() - 3]).unwrap();
        }
    };
    for name in ["pattern/phase.npy", "truth/height.npy", "truth/class.npy"] {
        refused(&recording, cut(name), &[name]);
    }
    let not_finite = |written: &Written| {
        let path = written.recording().join("pattern/phase.npy");
        let mut bytes = fs::read(&path).unwrap();
        let at = bytes.len() - 8 * 100;
        bytes[at..at + 8].copy_from_slice(&f64::NAN.to_le_bytes());
        fs::write(path, bytes).unwrap();
    };
    refused(&recording, not_finite, &["pattern/phase.npy", "row"]);
    refused(
        &recording,
        |written| fs::remove_file(written.recording().join("pattern/phase.npy")).unwrap(),
        &["pattern/phase.npy", "missing"],
    );
}

#[test]
fn files_outside_the_folder_are_refused() {
    for file in ["../secret.png", "/etc/hostname", "frames/../../x.png"] {
        refused_manifest(|m| m["frames"][0]["file"] = json!(file), &[file]);
    }
}

#[test]
fn a_recording_that_is_not_there_is_code_66() {
    let written = Written::new(&tiny());
    let absent = written.recording().join("no-such-folder");
    let run = program().measure(&absent, &written.out(), &[]);
    check(&written, &run, 66, &["no-such-folder"]);
    fs::remove_file(written.manifest()).unwrap();
    check(&written, &written.measure(&[]), 66, &["recording.json"]);
}

#[test]
fn wrong_arguments_are_code_64_and_help_is_code_0() {
    for arguments in [
        &["measure"][..],
        &["measure", "somewhere"],
        &["measure", "somewhere", "--out"],
        &["measure", "somewhere", "--out", "x", "--threads", "many"],
        &["measure", "somewhere", "--out", "x", "--frobnicate"],
        &["frobnicate"],
    ] {
        let run = program().run(arguments);
        assert_eq!(run.code, 64, "{arguments:?}: {}", run.stderr);
        assert!(run.stderr.contains("Usage") || run.stderr.contains("help"));
    }
    assert_eq!(program().run(&["measure", "--help"]).code, 0);
    assert_eq!(program().run(&["--version"]).code, 0);
}

#[test]
fn an_output_folder_that_cannot_be_made_is_code_73_and_nothing_is_lost() {
    let written = Written::new(&tiny());
    let in_the_way = written.out();
    fs::write(&in_the_way, "a file of mine").unwrap();
    for out in [in_the_way.clone(), in_the_way.join("below")] {
        let run = program().measure(&written.recording(), &out, &[]);
        check(&written, &run, 73, &[in_the_way.to_str().unwrap()]);
        assert_eq!(fs::read(&in_the_way).unwrap(), b"a file of mine");
    }
}

#[test]
fn a_result_that_cannot_be_written_is_code_73_by_name() {
    let written = Written::new(&tiny());
    // A folder with the name of a result: no user can replace it by a file.
    fs::create_dir_all(written.out().join("phase.npy/mine")).unwrap();
    let run = written.measure(&[]);
    assert_eq!(run.code, 73, "{}", run.stderr);
    assert!(run.stderr.contains("phase.npy"), "{}", run.stderr);
    assert!(written.out().join("phase.npy/mine").is_dir());
}

#[test]
fn a_result_that_cannot_be_written_leaves_no_temporary_file() {
    let written = Written::new(&tiny());
    fs::create_dir_all(written.out().join("phase.npy/mine")).unwrap();
    assert_eq!(written.measure(&[]).code, 73);
    assert_eq!(files::names(&written.out()), ["phase.npy"]);
}
