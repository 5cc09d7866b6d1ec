//! From a bare simulated head to verdicts, over the page's API alone: gamma, blur, delay and
//! geometry are unknown to the station.

use crate::page::{Browser, step_of};
use crate::station_plc::{Daemon, Place};
use crate::technician::{BOARD, Technician};
use serde_json::{Value, json};
use sim::{Part, Placement, Scenario};
use std::io::{Read as _, Write as _};
use std::time::{Duration, Instant};
use tests::until::{PATIENCE, until};

/// The head: other angles and lenses than anything that the program knows, and all that is to be
/// measured on it.
const BARE: &str = "calibrated = false
sub_rays = 2
part = { kind = \"plane\" }
[rig.camera]
width = 512
height = 512
angle_deg = 20.7
distance_mm = 604.0
distortion = [-0.10, 0.12, 3e-4, -2e-4, 0.0]
[rig.projector]
angle_deg = -7.6
distance_mm = 597.0
distortion = [-0.04, 0.02, -2e-4, 3e-4, 0.0]
[light]
ambient = 0.01
diffuse = 0.15
[noise]
noise_counts = 2.0
[optics]
gamma = 1.7
projector_blur_px = 0.8
camera_blur_px = 0.4
[timing]
flip_to_light_us = 30000
readout_us = 6000
stamp = \"exposure_end\"
";
/// Poses of the simulated board that are taken before and after a restart; in the last one it lies
/// in z = 0.
const FIRST: [u32; 3] = [1, 3, 5];
const SECOND: [u32; 3] = [7, 9, 10];
/// Largest RMS deviation of heights from the truth, mm.
const MOST_RMS_MM: f64 = 0.05;
/// Pixels whose neighbours differ by more than this in height lie at an edge, mm.
const EDGE_MM: f64 = 0.5;

/// The heights of the last part, mm, NaN where there are none.
fn heights(technician: &Technician) -> Vec<f64> {
    let mut stream = technician.browser.begin("GET", "/api/picture/height", 0);
    stream.flush().unwrap();
    let mut answer = Vec::new();
    stream.read_to_end(&mut answer).unwrap();
    let end = answer.windows(4).position(|four| four == b"\r\n\r\n");
    let (head, words) = answer.split_at(end.unwrap() + 4);
    let head = String::from_utf8_lossy(head).into_owned();
    let map = head.lines().find_map(|line| line.strip_prefix("x-map: "));
    let map: Value = serde_json::from_str(map.unwrap()).unwrap();
    assert_eq!((&map["width"], &map["stride"]), (&json!(512), &json!(1)));
    let (low, step) = (map["low"].as_f64().unwrap(), map["step"].as_f64().unwrap());
    let height = |word: &[u8]| match u16::from_le_bytes([word[0], word[1]]) {
        u16::MAX => f64::NAN,
        word => low + step * f64::from(word),
    };
    words.chunks_exact(2).map(height).collect()
}

/// RMS deviation from the true heights of a part, mm, away from edges, and over how many pixels.
fn rms(measured: &[f64], part: &Part) -> (f64, usize) {
    let scenario = Scenario::from_toml(BARE, "bare.toml").unwrap();
    let (_, stage) = sim::head(&scenario).unwrap();
    stage.place(part, &Placement::default()).unwrap();
    let truth = stage.truth();
    let width = 512;
    assert_eq!(measured.len(), truth.height.len());
    let (mut squares, mut pixels) = (0.0, 0);
    let inside = measured.iter().enumerate().take(measured.len() - width - 1);
    for (at, height) in inside.skip(width + 1) {
        let around = [at - 1, at + 1, at - width, at + width, at];
        let flat = around.iter().all(|near| {
            truth.class[*near] == 2
                && f64::from((truth.height[*near] - truth.height[at]).abs()) < EDGE_MM
        });
        if flat && height.is_finite() {
            squares += (height - f64::from(truth.height[at])).powi(2);
            pixels += 1;
        }
    }
    ((squares / f64::from(pixels)).sqrt(), pixels as usize)
}

#[test]
fn a_bare_head_is_commissioned_over_the_page_and_then_judges_parts_right() {
    let place = Place::before(BARE);
    let daemon = Daemon::start(&place);
    let (_, rest) = daemon.log.split_once("shown this once: ").unwrap();
    let secret = rest.split(' ').next().unwrap().to_owned();

    // It says why it cannot measure, and what is still to be done.
    let mut anybody = Browser::new(&daemon);
    assert_eq!(
        anybody
            .json("POST", "/api/head/steps/devices", &json!({}))
            .0,
        401
    );
    assert_eq!(anybody.ask("GET", "/api/head/live?show=white", &[]).0, 401);
    let mut technician = Technician::sign_in(&daemon, &secret);
    let head = technician.head();
    assert_eq!(head["calibrated"], false, "{head}");
    assert!(head["problem"].as_str().unwrap().contains("not calibrated"));
    let steps = head["steps"].as_array().unwrap();
    assert!(
        steps.len() == 8 && steps.iter().all(|step| step["state"] == "open"),
        "{head}"
    );
    let refusal = technician.browser.get("/api/snapshot")["refusal"]["words"].clone();
    assert!(
        refusal.as_str().unwrap().contains("not calibrated"),
        "{refusal}"
    );

    technician.passes("devices", &json!({}));
    technician.passes("aim", &json!({}));
    let dark = technician.step("exposure", &json!({}));
    assert_eq!(dark["state"], "failed", "{dark}");
    assert!(
        dark["remedy"].as_str().unwrap().contains("expose more"),
        "{dark}"
    );
    assert!(technician.looks("white")["brightest"].as_f64().unwrap() < 0.25);
    let (status, answer) =
        technician
            .browser
            .json("POST", "/api/head/steps/exposure", &json!({ "gain": 100 }));
    assert!(
        status == 422 && answer["error"].as_str().unwrap().contains("gain"),
        "{answer}"
    );
    technician.passes("exposure", &json!({ "gain": 4.5, "keep": true }));
    assert!(technician.looks("white")["brightest"].as_f64().unwrap() > 0.5);
    for show in ["black", "focus", "cross", "volume"] {
        technician.looks(show);
    }
    for _ in 0..4 {
        technician.looks("fringes8");
        technician.looks("fringes12");
    }
    let figures = technician.looks("fringes12");
    let modulation = |pitch: &str| figures[pitch].as_f64().unwrap();
    let (fine, coarse) = (modulation("modulation_8"), modulation("modulation_12"));
    assert!(0.3 < fine && fine < coarse && coarse < 1.0, "{figures}");

    // A pose needs the times of the head.
    let early = json!({ "action": "pose", "board": BOARD });
    assert_eq!(technician.step("geometry", &early)["state"], "failed");
    let timing = technician.passes("timing", &json!({}));
    let delay = timing["figures"]["delay_ms"].as_f64().unwrap();
    assert!((delay - 30.0).abs() < 0.01, "{timing}");
    assert_eq!(timing["figures"]["stamp"], "exposure_end");

    // What is no board says so at once; what is kept of it can be taken back.
    let plate = technician.step("geometry", &early);
    assert_eq!(plate["state"], "failed", "{plate}");
    let pose = technician.head()["geometry"]["poses"][0].clone();
    assert_eq!(
        (&pose["number"], &pose["usable"]),
        (&json!(1), &json!(false))
    );
    technician.step("geometry", &json!({ "action": "forget", "pose": 1 }));
    let few = technician.step("geometry", &json!({ "action": "solve" }));
    assert_eq!(few["state"], "failed", "{few}");
    for number in FIRST {
        let pose = technician.pose(number);
        let corners = pose["corners"].as_u64().unwrap();
        assert!(pose["usable"] == true && corners >= 110, "{pose}");
    }

    // A restart in the middle keeps what was done.
    let before = technician.head();
    assert!(daemon.terminate().success());
    let daemon = Daemon::start(&place);
    let mut technician = Technician::sign_in(&daemon, &secret);
    let after = technician.head();
    assert_eq!(after["steps"], before["steps"]);
    assert_eq!(after["geometry"], before["geometry"]);
    assert_eq!(after["camera"]["gain"], 4.5);
    let (status, png) = technician
        .browser
        .ask("GET", "/api/head/poses/5/picture", &[]);
    assert!(status == 200 && png.starts_with(b"\x89PNG"));
    for number in SECOND {
        technician.pose(number);
    }
    let solved = technician.passes("geometry", &json!({ "action": "solve" }));
    let result = technician.head()["geometry"]["result"].clone();
    assert_eq!(result["scale"], "unchecked", "{solved} {result}");

    technician.lay(&json!({ "part": "plane" }));
    technician.passes("plane", &json!({}));
    let head = technician.head();
    assert!(
        head["calibrated"] == true && head["problem"].is_null(),
        "{head}"
    );
    assert_eq!(
        technician.browser.get("/api/snapshot")["calibration_valid"],
        true
    );

    let good = json!({ "part": { "kind": "sheet_metal" } });
    technician.lay(&good);
    let (status, answer) = technician
        .browser
        .json("POST", "/api/recipes/1/teach", &json!({}));
    assert_eq!(status, 202, "{answer}");
    technician.browser.ready();
    assert_eq!(step_of(&technician.head(), "teach")["state"], "done");
    assert_eq!(technician.browser.measure()["verdict"], "PASS");
    let (rms, pixels) = rms(&heights(&technician), &Part::SheetMetal(Default::default()));
    println!("heights are {rms:.4} mm RMS off the truth over {pixels} pixels; {result}");
    assert!(
        rms <= MOST_RMS_MM && pixels > 10_000,
        "{rms} mm over {pixels} pixels"
    );
    let dent = json!([{ "kind": "dent", "x": 0, "y": -8, "depth_mm": 1, "diameter_mm": 18 }]);
    technician.lay(&json!({ "part": { "kind": "sheet_metal", "defects": dent } }));
    assert_eq!(technician.browser.measure()["verdict"], "FAIL");

    // Live pictures leave the recipe's patterns where a trigger finds them.
    technician.looks("white");
    technician.lay(&good);
    assert_eq!(technician.browser.measure()["verdict"], "PASS");
    // The calibration outlives a restart, and with it the recipe.
    assert!(daemon.terminate().success());
    let daemon = Daemon::start(&place);
    let mut technician = Technician::sign_in(&daemon, &secret);
    technician.browser.ready();
    assert_eq!(technician.head()["calibrated"], true);
}

#[test]
fn a_step_ends_at_once_when_somebody_or_the_daemon_stops_it_and_leaves_what_was_found_before() {
    const AT_ONCE: Duration = Duration::from_secs(1);
    let place = Place::before(&BARE.replace("= 512", "= 256"));
    let daemon = Daemon::start(&place);
    let (_, rest) = daemon.log.split_once("shown this once: ").unwrap();
    let secret = rest.split(' ').next().unwrap().to_owned();
    let mut technician = Technician::sign_in(&daemon, &secret);
    technician.passes("exposure", &json!({ "gain": 4.5, "keep": true }));
    let begins = |technician: &mut Technician| {
        let path = "/api/head/steps/timing";
        let (status, answer) = technician.browser.json("POST", path, &json!({}));
        assert_eq!(status, 202, "{answer}");
        until("progress", PATIENCE, || {
            let running = technician.head()["running"].clone();
            match running["share"].as_f64().unwrap() > 0.0 {
                true => Ok(()),
                false => Err(running),
            }
        });
    };
    begins(&mut technician);
    let mut end = |name: &str| {
        let path = format!("/api/head/steps/{name}");
        technician.browser.ask("DELETE", &path, &[]).0
    };
    assert_eq!(end("aim"), 409, "another step");
    assert_eq!(end("timing"), 202);
    let head = until("end of the step", AT_ONCE, || {
        let head = technician.head();
        match head["running"].is_null() {
            true => Ok(head),
            false => Err(head),
        }
    });
    let states = ["exposure", "timing"].map(|name| step_of(&head, name)["state"].clone());
    assert_eq!(states, ["done", "open"]);
    begins(&mut technician);
    let stopped = Instant::now();
    assert!(daemon.terminate().success());
    assert!(stopped.elapsed() < AT_ONCE, "{:?}", stopped.elapsed());
    let daemon = Daemon::start(&place);
    let mut technician = Technician::sign_in(&daemon, &secret);
    assert_eq!(technician.head()["steps"], head["steps"]);
    technician.passes("timing", &json!({}));
}

/// The median of some times.
pub(crate) fn median(mut times: Vec<f64>) -> f64 {
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

#[test]
#[ignore = "measures times; run it alone: taskset -c 0 cargo test -p tests --test suite -- --ignored --nocapture commissioning::"]
fn a_cycle_is_hardly_later_while_somebody_looks_at_live_pictures() {
    let place = Place::before("[rig.camera]\nwidth = 512\nheight = 512\n");
    let daemon = Daemon::start(&place);
    let (_, rest) = daemon.log.split_once("shown this once: ").unwrap();
    let secret = rest.split(' ').next().unwrap().to_owned();
    let mut technician = Technician::sign_in(&daemon, &secret);
    technician.browser.ready();
    let cycles = |technician: &mut Technician, pause: u64| {
        let each = (0..40).map(|at| {
            // Triggers come at any time of a picture.
            std::thread::sleep(Duration::from_millis(pause + at * 7 % 50));
            technician.browser.measure()["total_us"].as_f64().unwrap() * 1e-3
        });
        median(each.collect())
    };
    let alone = cycles(&mut technician, 100);
    let (stop, stopped) = std::sync::mpsc::channel::<()>();
    let mut viewer = Technician::sign_in(&daemon, &secret);
    let looking = std::thread::spawn(move || {
        let (mut pictures, began) = (0_u32, Instant::now());
        while stopped.try_recv().is_err() {
            let (status, _) = viewer.browser.ask("GET", "/api/head/live?show=white", &[]);
            assert!(status == 200 || status == 409, "{status}");
            pictures += u32::from(status == 200);
            // The page shows it before it asks for the next one.
            std::thread::sleep(Duration::from_millis(100));
        }
        f64::from(pictures) / began.elapsed().as_secs_f64()
    });
    let watched = cycles(&mut technician, 100);
    stop.send(()).unwrap();
    let rate = looking.join().unwrap();
    let later = 100.0 * (watched / alone - 1.0);
    println!(
        "a cycle takes {alone:.2} ms, {watched:.2} ms while somebody looks ({later:+.1} %), at {rate:.1} pictures per second"
    );
    assert!(rate >= 2.0 && later <= 5.0);
}
