//! Exposure and gain on the page's API: what a step leaves behind that did not succeed, and which
//! noise a recipe is judged by.

use crate::page::Browser;
use crate::station_plc::{Daemon, Place, Plc, READY, SMALL_HEAD};
use crate::written::program;
use serde_json::{Value, json};
use std::fs;

const PASS: u16 = 1;
/// RECIPE_RESULT "made for another calibration, exposure or gain".
const OTHER_CALIBRATION: u16 = 3;
/// HEIGHT_NOISE, in words behind the beginning of the result.
const HEIGHT_NOISE: usize = 26;

/// A place whose head exposes for eight short refreshes.
fn place() -> Place {
    Place::taught_before(&format!(
        "refresh_hz = 240.0\n{SMALL_HEAD}[timing]\nexposure_refreshes = 8.0\n"
    ))
}

/// A station there, with its users.
fn station() -> (Place, Daemon, Browser, Plc) {
    let place = place();
    let daemon = Daemon::start(&place);
    let mut browser = Browser::new(&daemon);
    browser.sign_in(&daemon);
    let plc = Plc::connect(&daemon);
    (place, daemon, browser, plc)
}

fn camera(browser: &mut Browser) -> Value {
    browser.get("/api/head")["camera"].clone()
}

/// Asks for a step, and waits until it has ended.
fn step(browser: &mut Browser, name: &str, body: &Value) -> Value {
    let path = format!("/api/head/steps/{name}");
    let (status, answer) = browser.json("POST", &path, body);
    assert_eq!(status, 202, "{name} {body}: {answer}");
    browser.ended(name)
}

/// Teaches recipe 1 anew.
fn teach(browser: &mut Browser) {
    let before = browser.get("/api/recipes/1")["fingerprint"].clone();
    let again = json!({ "replace": true });
    let (status, answer) = browser.json("POST", "/api/recipes/1/teach", &again);
    assert_eq!(status, 202, "{answer}");
    browser.wait_for_another(before.as_str().unwrap());
}

/// The same light in one refresh and with gain, where the camera exposes for several refreshes
/// without.
fn shorter(camera: &Value) -> Value {
    let refresh = camera["refresh_us"].as_f64().unwrap();
    let refreshes = (camera["exposure_us"].as_f64().unwrap() / refresh).round();
    assert!(refreshes == 8.0 && camera["gain"] == 1.0, "{camera}");
    json!({ "exposure_us": refresh as u32, "gain": refreshes })
}

#[test]
fn a_step_exposure_that_is_stopped_refused_or_failed_takes_its_settings_back() {
    let (place, daemon, mut browser, mut plc) = station();
    assert_eq!(plc.measure(1)[8], PASS);
    let before = camera(&mut browser);
    let path = "/api/head/steps/exposure";
    let (status, answer) = browser.json("POST", path, &json!({ "exposure_us": 1 }));
    assert_eq!(status, 422, "{answer}");
    let words = answer["error"].as_str().unwrap();
    assert!(words.contains("whole refreshes: write "), "{words}");
    // Too dark, and far too bright.
    for (token, gain) in [(2, 0.01), (3, 64.0)] {
        let failed = step(
            &mut browser,
            "exposure",
            &json!({ "gain": gain, "keep": true }),
        );
        assert_eq!(failed["state"], "failed", "{failed}");
        assert_eq!(camera(&mut browser), before);
        assert_eq!(plc.measure(token)[8], PASS);
    }
    let body = json!({ "exposure_us": before["refresh_us"], "gain": 0.01, "keep": true });
    let (status, answer) = browser.json("POST", path, &body);
    assert_eq!(status, 202, "{answer}");
    let (status, answer) = browser.json("DELETE", path, &json!({}));
    assert_eq!(status, 202, "{answer}");
    browser.ended("exposure");
    assert_eq!(camera(&mut browser), before);
    assert_eq!(plc.measure(4)[8], PASS);
    assert_eq!(daemon.terminate().code(), Some(0));
    // Nothing of it comes back with the next start.
    let kept: Value =
        serde_json::from_slice(&fs::read(place.path("state/commissioning.json")).unwrap()).unwrap();
    assert!(kept["exposing"].is_null(), "{kept}");
    let daemon = Daemon::start(&place);
    assert_eq!(camera(&mut Browser::new(&daemon)), before);
    assert_eq!(Plc::connect(&daemon).measure(5)[8], PASS);
}

#[test]
fn a_recipe_is_not_used_at_another_gain_and_one_that_is_taught_there_has_the_noise_of_it() {
    let (_place, _daemon, mut browser, mut plc) = station();
    let noise = plc.measure(1)[HEIGHT_NOISE];
    let recipe = browser.get("/api/recipes/1");
    let before = camera(&mut browser);
    assert_eq!(recipe["exposing"]["gain"], before["gain"], "{recipe}");
    let done = step(&mut browser, "exposure", &shorter(&before));
    assert_eq!(done["state"], "done", "{done}");
    // No part is judged by the noise that the camera had.
    let status = plc.status();
    assert!(!status.has(READY), "{status:?}");
    let (status, answer) = browser.json("POST", "/api/recipes/1/load", &json!({}));
    assert_eq!(status, 202, "{answer}");
    plc.wait("refusal", |status| {
        status.recipe_result() == OTHER_CALIBRATION
    });
    let said = browser.get("/api/log").to_string();
    assert!(said.contains("gain 1, and the camera is set to"), "{said}");
    teach(&mut browser);
    let taught = browser.get("/api/recipes/1");
    let ratio = |key: &str| taught[key].as_f64().unwrap() / recipe[key].as_f64().unwrap();
    assert!(ratio("noise_counts") > 2.0, "{}", ratio("noise_counts"));
    let noisier = plc.measure(2)[HEIGHT_NOISE];
    // A longer sequence may make up for much of it.
    assert!(noisier > noise, "{noisier} after {noise}");
    // Back again it is this recipe that does not fit.
    let back = json!({ "exposure_us": before["exposure_us"], "gain": before["gain"] });
    let done = step(&mut browser, "exposure", &back);
    assert_eq!(done["state"], "done", "{done}");
    assert!(!plc.status().has(READY));
    teach(&mut browser);
    let again = plc.measure(3)[HEIGHT_NOISE];
    assert!(again.abs_diff(noise) <= noise / 4, "{again} after {noise}");
}

#[test]
fn a_calibrated_head_at_another_gain_is_not_ready_until_its_noise_is_measured_there() {
    let place = place();
    let config = place.path("fringed.toml");
    let config = config.to_str().unwrap();
    let calibrated = || {
        program()
            .run(&["calibrate", "--config", config])
            .succeeded()
    };
    calibrated();
    let daemon = Daemon::start(&place);
    let mut browser = Browser::new(&daemon);
    browser.sign_in(&daemon);
    let mut plc = Plc::connect(&daemon);
    assert_eq!(plc.measure(1)[8], PASS);
    let before = camera(&mut browser);
    let mut kept = shorter(&before);
    kept["keep"] = true.into();
    let done = step(&mut browser, "exposure", &kept);
    assert_eq!(done["state"], "done", "{done}");
    let head = browser.get("/api/head");
    let problem = head["problem"].to_string();
    assert!(problem.contains("its noise was measured at"), "{problem}");
    assert!(!plc.status().has(READY));
    // Nothing is taught by the noise of before either.
    let body = json!({ "replace": true });
    let (status, answer) = browser.json("POST", "/api/recipes/1/teach", &body);
    let words = answer["error"].to_string();
    assert!(
        status == 409 && words.contains("its noise was measured at"),
        "{status} {words}"
    );
    daemon.terminate();
    // The command line uses what was kept, too, and measures the noise there.
    let refused = program().run(&["teach", "--number", "2", "--config", config]);
    assert!(
        refused.code == 65 && refused.stderr.contains("its noise was measured at"),
        "{} {}",
        refused.code,
        refused.stderr
    );
    calibrated();
    let daemon = Daemon::start(&place);
    let mut browser = Browser::new(&daemon);
    let head = browser.get("/api/head");
    assert!(head["problem"].is_null(), "{head}");
    assert!(!Plc::connect(&daemon).status().has(READY));
}
