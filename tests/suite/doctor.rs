//! `fringed doctor` on the simulated head: a head without faults passes, and of each single fault
//! only that fault is reported.

use crate::written::program;
use appliance::head::calibration::Calibration;
use appliance::head::doctor::{CheckVerdict, examine};
use hal::head::Timing;
use serde_json::Value;
use sim::Scenario;
use std::path::Path;
use tests::program::Run;
use tests::small_head::SMALL_HEAD as HEAD;

fn doctor(folder: &Path, scenario: &str) -> Run {
    let path = folder.join("scenario.toml");
    std::fs::write(&path, scenario).unwrap();
    program().run(&[
        "doctor",
        "--quiet",
        "--json",
        "--scenario",
        path.to_str().unwrap(),
    ])
}

/// The names of the checks with this verdict.
fn with(report: &Value, verdict: &str) -> Vec<String> {
    let steps = report["steps"].as_array().unwrap().iter();
    let steps = steps.filter(|step| step["verdict"] == verdict);
    steps
        .map(|step| step["step"].as_str().unwrap().to_owned())
        .collect()
}

fn step<'a>(report: &'a Value, name: &str) -> &'a Value {
    let mut steps = report["steps"].as_array().unwrap().iter();
    steps.find(|step| step["step"] == name).unwrap()
}

#[test]
fn a_head_that_is_well_passes_every_step_whatever_its_timing() {
    let folder = tempfile::tempdir().unwrap();
    for timing in [
        "",
        "[timing]\nflip_to_light_us = 16667\nexposure_refreshes = 1.0\nreadout_us = 16000\nstamp = \"exposure_end\"\n",
        "[timing]\nflip_to_light_us = 41234\nexposure_refreshes = 1.0\nreadout_us = 11000\ncamera_period_us = 33333\ncamera_phase_us = 5000\n",
        "[faults]\nflip_jitter_us = 50\nstamp_jitter_us = 50\ntrigger_jitter_us = 50\n",
    ] {
        let run = doctor(folder.path(), &format!("{HEAD}{timing}")).succeeded();
        let report: Value = serde_json::from_str(&run.stdout).unwrap();
        assert_eq!(report["healthy"], true, "{report:#}");
        assert_eq!(with(&report, "pass").len(), 15, "{report:#}");
    }
}

#[test]
fn each_single_fault_is_named_with_a_remedy_and_nothing_else_is() {
    let folder = tempfile::tempdir().unwrap();
    for (fault, named, word) in [
        ("[light]\ndiffuse = 0.0\n", "light", "lamp"),
        (
            "[timing]\nflip_to_light_us = 33334\ncalibrated_flip_to_light_us = 16667\n",
            "delay",
            "1.0 refreshes",
        ),
        (
            "[timing]\nflip_to_light_us = 16667\ncalibrated_flip_to_light_us = 33334\n",
            "delay",
            "-1.0 refreshes",
        ),
        ("[optics]\ngamma = 2.2\n", "response", "gamma"),
        ("[timing]\ncopy_us = 20000\n", "delivery", "dma_heap"),
        ("[optics]\ncontent_gain = 0.2\n", "content", "CAIC"),
        (
            "[light]\nambient = 0.2\ndiffuse = 0.6\n[unsteady]\nlamp_depth = 0.9\n[timing]\nexposure_refreshes = 1.0\n",
            "flicker",
            "50000 µs with mains of 50 Hz",
        ),
        ("[optics]\nprojector_blur_px = 4.0\n", "contrast", "focus"),
        ("[optics]\ngain = 3.0\n", "exposure", "gain"),
        ("[optics]\ngain = 0.15\n", "exposure", "aperture"),
        ("[faults]\nwire_open = true\n", "trigger", "wire"),
        // In the table of the camera, which comes last.
        ("knocked_deg = [0.05, 0.0, 0.0]\n", "geometry", "knocked"),
        (
            "[faults]\nlost_trigger = 0.3\nseed = 3\n",
            "trigger",
            "lost",
        ),
        (
            "[faults]\nlong_pulse = 0.3\nlong_pulse_us = 5000\nseed = 3\n",
            "trigger",
            "loads the computer",
        ),
        (
            "[timing]\nstart_up_us = 500000\nstays_on_s = 0\n",
            "start",
            "always-on",
        ),
        ("[faults]\ncompressed = true\n", "format", "R16"),
        (
            "[faults]\nlate_flip = 0.2\nlate_refreshes = 1\n",
            "cadence",
            "load",
        ),
        (
            "[timing]\nexposure_refreshes = 1.5\n",
            "mode",
            "whole refreshes",
        ),
    ] {
        let run = doctor(folder.path(), &format!("{HEAD}{fault}"));
        assert_eq!(run.code, 69, "{fault}: {}", run.stderr);
        let report: Value = serde_json::from_str(&run.stdout).unwrap();
        assert_eq!(with(&report, "fail"), [named], "{fault}: {report:#}");
        let remedy = step(&report, named)["remedy"].as_str().unwrap();
        assert!(remedy.contains(word), "{fault}: {remedy}");
        assert!(run.stderr.contains(named), "{}", run.stderr);
    }
}

#[test]
fn light_that_comes_late_after_the_mode_was_set_is_named_and_waited_for() {
    let folder = tempfile::tempdir().unwrap();
    let examined = |seconds: u32| {
        let keys = format!("{HEAD}[timing]\nfirst_light_us = {seconds}000000\n");
        let run = doctor(folder.path(), &keys);
        let report: Value = serde_json::from_str(&run.stdout).unwrap();
        (step(&report, "light").clone(), with(&report, "fail"))
    };
    let (light, failed) = examined(3);
    let waited = light["measured"]["first_light_s"].as_f64().unwrap();
    assert!((3.0..4.0).contains(&waited), "{light:#}");
    assert!(
        light["found"]
            .as_str()
            .unwrap()
            .contains(" s after its mode was set")
    );
    assert!(failed.is_empty(), "{failed:?}");
    // The next checks take two seconds, after which it has come.
    for (seconds, word) in [(17, "lock on"), (60, "lamp")] {
        let (light, failed) = examined(seconds);
        assert_eq!(failed, ["light"], "{light:#}");
        assert!(light["measured"]["first_light_s"].is_null(), "{light:#}");
        assert!(light["found"].as_str().unwrap().contains("within 15 s"));
        assert!(
            light["remedy"].as_str().unwrap().contains(word),
            "{light:#}"
        );
    }
}

#[test]
fn a_head_that_nobody_has_calibrated_fails_in_nothing_but_what_calibration_measures() {
    // As on a Raspberry Pi, stamps mark the start of the readout. Neither this nor the delay has
    // been measured yet.
    let timing = "[timing]\nflip_to_light_us = 33333\nstamp = \"exposure_end\"\nreadout_us = 16000\nexposure_refreshes = 1.0\n";
    let scenario = Scenario::from_toml(&format!("{HEAD}{timing}"), "here").unwrap();
    for calibrated in [false, true] {
        let (mut head, stage) = sim::head_with_progress(&scenario, &|_| ()).unwrap();
        head.set_timing(Timing::default());
        let known = Calibration::of_scenario(stage.scenario()).unwrap();
        let steps = examine(&mut head, &known, calibrated, &|_, _| ());
        let failed = steps
            .iter()
            .filter(|step| step.verdict == CheckVerdict::Fail);
        let failed: Vec<&str> = failed.map(|step| step.name).collect();
        // If the head is said to be calibrated with these values, its stamps are wrong.
        let wrong = if calibrated { "trigger" } else { "delay" };
        assert_eq!(failed, [wrong], "{steps:#?}");
    }
}

#[test]
fn the_doctor_measures_what_it_names() {
    let folder = tempfile::tempdir().unwrap();
    let faults = "[optics]\ngamma = 2.2\n[timing]\nflip_to_light_us = 41234\n";
    let run = doctor(folder.path(), &format!("{HEAD}{faults}"));
    let report: Value = serde_json::from_str(&run.stdout).unwrap();
    let number = |name: &str, key: &str| step(&report, name)["measured"][key].as_f64().unwrap();
    // Within the accuracy that the doctor reports.
    let off = number("delay", "off_ms").max(0.5);
    assert!(
        (number("delay", "delay_ms") - 41.234).abs() < off,
        "{report:#}"
    );
    assert!(
        (number("response", "gamma") - 2.2).abs() < 0.1,
        "{report:#}"
    );
    assert!((number("cadence", "period_ms") - 1000.0 / 60.0).abs() < 0.01);
}

#[test]
fn a_compressed_format_is_examined_and_not_measured_with() {
    let folder = tempfile::tempdir().unwrap();
    let scenario = folder.path().join("scenario.toml");
    std::fs::write(&scenario, format!("{HEAD}[faults]\ncompressed = true\n")).unwrap();
    let config = folder.path().join("fringed.toml");
    std::fs::write(
        &config,
        format!("[head]\nbackend = \"sim\"\nscenario = {scenario:?}\n"),
    )
    .unwrap();
    let run = program().run(&[
        "record",
        folder.path().join("out").to_str().unwrap(),
        "--config",
        config.to_str().unwrap(),
    ]);
    assert_eq!(run.code, 69, "{}", run.stderr);
    assert!(run.stderr.contains("compressed"), "{}", run.stderr);
}

#[test]
fn a_recording_cannot_be_examined() {
    let folder = tempfile::tempdir().unwrap();
    let config = folder.path().join("fringed.toml");
    std::fs::write(
        &config,
        "[head]\nbackend = \"replay\"\nrecordings = [\"somewhere\"]\n",
    )
    .unwrap();
    let run = program().run(&["doctor", "--config", config.to_str().unwrap()]);
    assert_eq!(run.code, 64, "{}", run.stderr);
    assert!(run.stderr.contains("--scenario"), "{}", run.stderr);
}
