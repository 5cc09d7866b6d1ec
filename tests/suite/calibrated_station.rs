//! The station uses the stored calibration: CALIBRATION_VALID, recipes of another calibration, no
//! guessed values.

use crate::station_plc::{Daemon, Place, Plc, READY, RECIPE_OK, trigger};
use crate::written::program;
use std::fs;

/// Bit 15 of STATUS, and the RECIPE_RESULT "made for another calibration".
const CALIBRATION_VALID: u16 = 1 << 15;
const OTHER_CALIBRATION: u16 = 3;
const PASS: u16 = 1;
const FAIL: u16 = 2;

#[test]
fn the_station_measures_by_the_stored_calibration_and_by_no_other() {
    let place = Place::new();
    let program = program();
    let config = place.path("fringed.toml");
    let scenario = place.path("small.toml");
    let head = fs::read_to_string(&scenario).unwrap();
    let light = |gamma: f64, seed: u32| {
        let more = format!(
            "\n[optics]\ngamma = {gamma}\n[timing]\nflip_to_light_us = 30000\ncalibrated_flip_to_light_us = 0\n[noise]\nseed = {seed}\n"
        );
        fs::write(&scenario, format!("{head}{more}")).unwrap();
    };
    let calibrate = || {
        let run = program.run(&["calibrate", "--json", "--config", config.to_str().unwrap()]);
        let report: serde_json::Value = serde_json::from_str(&run.succeeded().stdout).unwrap();
        report["calibration"]["fingerprint"]
            .as_str()
            .unwrap()
            .to_owned()
    };
    // The head's response is not linear, and its configured delay is wrong: only the calibration
    // has the right values.
    light(1.8, 1);
    let first = calibrate();
    let passes = |daemon: &Daemon| {
        let mut plc = Plc::connect(daemon);
        let before = plc.wait("READY", |status| {
            status.has(READY | RECIPE_OK | CALIBRATION_VALID)
        });
        plc.write(1, &trigger(7));
        let done = plc.wait("result", |status| status.seq() != before.seq());
        let words = plc.read(200, 120).unwrap();
        assert_eq!((words[2], words[8]), (7, PASS), "error {}", words[9]);
        assert_eq!(done.seq(), before.seq() + 1);
    };
    passes(&Daemon::start(&place));
    // The same head, calibrated again with other noise: its recipe stays valid.
    light(1.8, 2);
    assert_eq!(calibrate(), first);
    passes(&Daemon::start(&place));
    // The recording of a failed part is kept. It has no calibration, so it is judged again with
    // that of its recipe.
    let good = fs::read_to_string(&scenario).unwrap();
    let dent = "[part]\nkind = \"sheet_metal\"\ndefects = [{ kind = \"dent\", x = 0.0, y = -8.0, depth_mm = 1.5, diameter_mm = 20.0 }]\n";
    fs::write(&scenario, format!("{good}{dent}")).unwrap();
    let daemon = Daemon::start(&place);
    let mut plc = Plc::connect(&daemon);
    assert_eq!(plc.measure(8)[8], FAIL);
    daemon.terminate();
    let kept = fs::read_dir(place.path("state/recordings")).unwrap();
    let kept: Vec<_> = kept.map(|entry| entry.unwrap().path()).collect();
    assert_eq!(kept.len(), 1);
    program
        .run(&[
            "replay",
            kept[0].to_str().unwrap(),
            "--config",
            config.to_str().unwrap(),
        ])
        .succeeded();
    // With another projector the recipe is refused with the reason.
    light(1.5, 2);
    let second = calibrate();
    assert_ne!(second, first);
    let refused = |valid: bool, words: &[&str]| {
        let daemon = Daemon::start(&place);
        let mut plc = Plc::connect(&daemon);
        let status = plc.wait("RECIPE_RESULT", |status| {
            status.recipe_result() == OTHER_CALIBRATION
        });
        assert!(!status.has(READY) && !status.has(RECIPE_OK));
        assert_eq!(status.has(CALIBRATION_VALID), valid);
        for word in words {
            assert!(daemon.log.contains(word), "{word}: {}", daemon.log);
        }
    };
    refused(true, &["made for calibration", &first[..8], &second[..8]]);
    // Damaged, and there is no previous generation.
    let json = place.path("state/calibration/calibration.json");
    fs::remove_file(json.with_extension("json.previous")).unwrap();
    let text = fs::read_to_string(&json).unwrap();
    fs::write(
        &json,
        text.replacen("\"exposure_start\"", "\"exposure_end\"", 1),
    )
    .unwrap();
    refused(false, &["calibration.json", "checksum", "calibrate anew"]);
    // A calibration of another head.
    fs::write(&json, &text).unwrap();
    fs::write(&scenario, head.replace("width = 160", "width = 168")).unwrap();
    refused(false, &["of another head", "calibrate anew"]);
}
