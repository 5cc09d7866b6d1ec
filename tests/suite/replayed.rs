//! Any recording is judged by a recipe, as a station judges a part; what does not fit is refused by
//! name.

use crate::history::{place_with_a_dent, recording};
use crate::station_plc::{Daemon, Place, Plc, long};
use crate::written::program;
use serde_json::Value;
use std::fs;
use std::path::Path;
use tests::program::Run;

/// A dent in the sheet, deeper than the limit.
const DENT: [&str; 4] = ["--part", "sheet_metal", "--defect", "dent:0,-8,0.9,14"];

/// The path of a file in a place.
fn at(place: &Place, name: &str) -> String {
    place.path(name).to_str().unwrap().to_owned()
}

/// Records what the head of a place sees.
fn record(place: &Place, name: &str, more: &[&str]) {
    let (folder, config) = (at(place, name), at(place, "fringed.toml"));
    let words = [&["record", &folder, "--config", &config], more].concat();
    program().run(&words).succeeded();
}

fn replay(recording: &str, more: &[&str]) -> Run {
    program().run(&[&["replay", recording], more].concat())
}

/// Changes the list of frames of a recording.
fn change_frames(recording: &Path, change: impl Fn(&mut Vec<Value>)) {
    let manifest = recording.join("recording.json");
    let mut file: Value = serde_json::from_slice(&fs::read(&manifest).unwrap()).unwrap();
    change(file["frames"].as_array_mut().unwrap());
    fs::write(&manifest, file.to_string()).unwrap();
}

#[test]
fn any_recording_is_judged_by_a_recipe_of_its_pattern_and_another_one_is_refused_by_name() {
    let place = Place::new();
    let state = at(&place, "empty");
    let (golden, recipe) = (at(&place, "golden"), at(&place, "1.recipe"));
    record(&place, "golden", &["--part", "sheet_metal"]);
    let teach = [
        "teach", "--number", "1", "--golden", &golden, "--out", &recipe,
    ];
    program().run(&teach).succeeded();
    let judged = |name: &str| {
        let run = replay(
            &at(&place, name),
            &["--recipe", &recipe, "--state", &state, "--json"],
        );
        let answer: Value = serde_json::from_str(&run.succeeded().stdout).unwrap();
        assert_eq!(answer["stored"], Value::Null);
        answer["replayed"].clone()
    };

    // Of the default sequence, which taught it, and of what the recipe projects.
    record(&place, "dented", &DENT);
    let projected = [&DENT[..], &["--recipe", &recipe]].concat();
    record(&place, "projected", &projected);
    assert_eq!(judged("golden")["verdict"], "PASS");
    for name in ["dented", "projected"] {
        let result = judged(name);
        assert_eq!(result["verdict"], "FAIL", "{result}");
        for gauge in result["gauges"].as_array().unwrap() {
            assert!(
                gauge["value"].is_number() && gauge["reason"].is_null(),
                "{gauge}"
            );
        }
    }

    // Frames of other levels are left out.
    change_frames(&place.path("dented"), |frames| {
        let coarsest = frames[0]["ratio"].clone();
        let mut others = frames.clone();
        others.retain(|frame| frame["ratio"] == coarsest);
        for other in &mut others {
            other["ratio"] = 0.5.into();
        }
        frames.splice(0..0, others);
    });
    assert_eq!(judged("dented")["verdict"], "FAIL");
    let refused = |name: &str, words: &[&str]| {
        let run = replay(&at(&place, name), &["--recipe", &recipe, "--state", &state]);
        assert_eq!(run.code, 65, "{}{}", run.stdout, run.stderr);
        for wanted in words {
            assert!(run.stderr.contains(wanted), "{wanted}: {}", run.stderr);
        }
    };
    change_frames(&place.path("dented"), |frames| {
        frames.retain(|frame| frame["ratio"].as_f64() != Some(1.0));
    });
    refused("dented", &["has no sequence with these frames", "record"]);
    record(&place, "coarser", &["--fringes", "20"]);
    refused(
        "coarser",
        &["20 vertical", "name the recipe of this pattern"],
    );
    let manifest = place.path("golden/recording.json");
    let text = fs::read_to_string(&manifest).unwrap();
    let mut file: Value = serde_json::from_str(&text).unwrap();
    file["camera"].as_object_mut().unwrap().remove("model");
    fs::write(&manifest, file.to_string()).unwrap();
    refused("golden", &["no camera model"]);
    // Without a recipe there is nothing to judge by.
    let run = replay(&at(&place, "coarser"), &[]);
    assert_eq!(run.code, 65);
    assert!(run.stderr.contains("--recipe"), "{}", run.stderr);
}

#[test]
fn a_kept_part_has_the_stations_values_bit_by_bit_whoever_names_its_recipe() {
    let place = place_with_a_dent();
    let daemon = Daemon::start(&place);
    let words = Plc::connect(&daemon).measure(9);
    let folder = recording(&place, long(&words, 0));
    daemon.terminate();
    let own = folder.join("recipe.recipe");
    let (folder, own) = (folder.to_str().unwrap(), own.to_str().unwrap());
    for more in [&["--json"][..], &["--json", "--recipe", own]] {
        let run = replay(folder, more).succeeded();
        let answer: Value = serde_json::from_str(&run.stdout).unwrap();
        let [replayed, stored] = ["replayed", "stored"].map(|key| {
            let gauges = answer[key]["gauges"].as_array().unwrap().clone();
            assert!(!gauges.is_empty());
            gauges
        });
        for (replayed, stored) in replayed.iter().zip(&stored) {
            for (key, value) in stored.as_object().unwrap() {
                assert_eq!(replayed[key], *value, "{key} of {stored}");
            }
            assert!(replayed["kind"].is_string(), "{replayed}");
        }
        let features = answer["replayed"]["features"].as_array().unwrap();
        assert!(
            features.iter().all(|of| of["state"] == "found"),
            "{features:?}"
        );
    }
}
