//! The frames of the reference head, 1456 × 1088 pixels, by the shipped programs: taught, edited,
//! tried and judged like small ones, telling how far each piece of work is.

use crate::page::Browser;
use crate::station_plc::{Daemon, Place, Plc};
use crate::technician::Technician;
use crate::written::{laboratory, program};
use serde_json::{Value, json};
use std::fs;
use std::time::{Duration, Instant};
use tests::until::{PATIENCE, until};

const PASS: u16 = 1;
/// The camera of the reference head (docs/hardware.md), with a quarter of the rays of each pixel.
const CAMERA: &str = "sub_rays = 2\n\n[rig.camera]\nwidth = 1456\nheight = 1088\n";
/// Gauges and contours of a recipe that has as many as it may, and a dozen.
const GAUGES: usize = 64;
const CONTOURS: usize = 12;
/// Work that is silent for this long is a fault.
const SILENCE: Duration = Duration::from_secs(30);
/// Work is never silent for as much as one part in so many of it, on any computer.
const SIGNS: u32 = 4;

/// A head of full size in front of a part.
fn scene(part: &str) -> String {
    format!("{CAMERA}\n[part]\nkind = {part:?}\n")
}

/// What a station told while it worked.
struct Told {
    shares: Vec<f64>,
    stages: Vec<String>,
    longest: Duration,
    whole: Duration,
}

/// Follows a station until it is ready with another recipe than `before`: it is never in fault, and
/// what `key` of the snapshot tells never goes back.
fn follow(browser: &mut Browser, key: &str, before: &Value) -> Told {
    let (mut shares, mut stages) = (Vec::new(), Vec::new());
    let began = Instant::now();
    let (mut longest, mut since) = (Duration::ZERO, began);
    until("other recipe", 8 * PATIENCE, || {
        let snapshot = browser.get("/api/snapshot");
        assert_ne!(snapshot["state"], "fault", "{snapshot}");
        if let Some(share) = snapshot[key]["fraction"].as_f64() {
            let words = snapshot[key]["words"].as_str().unwrap().to_owned();
            if shares.last() != Some(&share) || stages.last() != Some(&words) {
                longest = longest.max(since.elapsed());
                since = Instant::now();
                shares.push(share);
            }
            if stages.last() != Some(&words) {
                stages.push(words);
            }
        }
        match snapshot["ready"] == true && snapshot["recipe"] != *before {
            true => Ok(()),
            false => Err(snapshot),
        }
    });
    assert!(shares.is_sorted(), "{shares:?}");
    assert!(longest < SILENCE, "{longest:?}");
    Told {
        shares,
        stages,
        longest,
        whole: began.elapsed(),
    }
}

/// A list with as many gauges as a recipe may have, some of them of contours: the holes of a plate,
/// each several times.
fn long_list(recipe: &Value) -> Value {
    let mut edit = json!({ "datums": recipe["datums"] });
    for key in ["fingerprint", "features", "gauges"] {
        edit[key] = recipe[key].clone();
    }
    let features = edit["features"].as_array().unwrap().iter();
    let holes: Vec<Value> = features
        .filter(|of| of["kind"] == "circle")
        .cloned()
        .collect();
    assert!(!holes.is_empty(), "{recipe}");
    let names = (0..CONTOURS).map(|at| format!("hole {}", at + 100));
    let names: Vec<String> = names.collect();
    for (at, name) in names.iter().enumerate() {
        let mut hole = holes[at % holes.len()].clone();
        hole["name"] = json!(name);
        hole["rim_mm"] = json!(0.0);
        edit["features"].as_array_mut().unwrap().push(hole);
    }
    let gauges = edit["gauges"].as_array_mut().unwrap();
    let taken: Vec<u64> = gauges
        .iter()
        .map(|of| of["slot"].as_u64().unwrap())
        .collect();
    let free = (1..=GAUGES as u64).filter(|slot| !taken.contains(slot));
    for (at, slot) in free.enumerate() {
        gauges.push(match names.get(at) {
            Some(name) => json!({
                "slot": slot, "name": format!("diameter {slot}"), "kind": "diameter", "of": [name],
                "golden": true, "plus": 0.1, "minus": 0.1,
            }),
            None => json!({
                "slot": slot, "name": format!("seen {slot}"), "kind": "coverage", "of": ["frame"],
                "low": 0.05,
            }),
        });
    }
    assert_eq!(gauges.len(), GAUGES);
    edit
}

#[test]
fn a_plate_is_taught_and_tried_edited_loaded_undone_and_judged_by_sixty_four_gauges() {
    let half = "sub_rays = 2\n\n[rig.camera]\nwidth = 728\nheight = 544\n";
    goes_all_ways(&format!("{half}\n[part]\nkind = \"plate\"\n"), 7 << 20);
}

#[test]
#[ignore = "takes a minute: `.ci/run full`"]
fn a_plate_of_full_size_is_taught_and_tried_edited_loaded_undone_and_judged() {
    goes_all_ways(&scene("plate"), 30 << 20);
}

/// A plate in front of this scene is taught, and its recipe, of so many bytes or more, goes all ways.
fn goes_all_ways(scene: &str, bytes: usize) {
    let place = Place::before(scene);
    let daemon = Daemon::start(&place);
    let mut browser = Browser::new(&daemon);
    browser.sign_in(&daemon);
    let mut plc = Plc::connect(&daemon);
    assert_eq!(plc.measure(1)[8], PASS);

    // Taught again, followed by the page.
    let before = browser.get("/api/snapshot")["recipe"].clone();
    let (status, answer) = browser.json("POST", "/api/recipes/2/teach", &json!({}));
    assert_eq!(status, 202, "{answer}");
    let told = follow(&mut browser, "teach", &before);
    println!(
        "taught in {:?}: {} signs of progress, {:?} apart at most; {:?}",
        told.whole,
        told.shares.len(),
        told.longest,
        told.stages
    );
    assert!(SIGNS * told.longest < told.whole && told.stages.len() > 5);

    let recipe = browser.get("/api/recipes/2");
    let edit = long_list(&recipe);
    let (status, tried) = browser.json("POST", "/api/recipes/2/try", &edit);
    assert_eq!((status, &tried["problems"]), (200, &json!([])), "{tried}");
    let (status, answer) = browser.json("PUT", "/api/recipes/2", &edit);
    assert_eq!(status, 200, "{answer}");
    let stored = browser.get("/api/recipes/2");
    assert_eq!(stored["gauges"].as_array().unwrap().len(), GAUGES);
    browser.wait_for_another(recipe["fingerprint"].as_str().unwrap());
    let result = browser.measure();
    assert_eq!(result["verdict"], "PASS", "{result}");
    assert_eq!(result["gauges"].as_array().unwrap().len(), GAUGES);
    for layer in ["height", "deviation", "modulation"] {
        let path = format!("/api/picture/{layer}");
        let (status, picture) = browser.ask("GET", &path, &[]);
        assert!(status == 200 && !picture.is_empty(), "{path}: {status}");
    }

    // The version before comes back, and is loaded, too.
    let before = browser.get("/api/snapshot")["recipe"].clone();
    let (status, answer) = browser.json("POST", "/api/recipes/2/undo", &json!({}));
    assert!(status < 300, "{status}: {answer}");
    follow(&mut browser, "load", &before);
    assert_eq!(browser.measure()["verdict"], "PASS");
    let (_, file) = browser.ask("GET", "/api/recipes/2/file", &[]);
    assert!(file.len() > bytes, "{}", file.len());
}

#[test]
#[ignore = "takes minutes: `.ci/run full`"]
fn every_other_path_of_a_head_of_full_size_ends_as_that_of_a_small_one() {
    let place = Place::before(&scene("sheet_metal"));
    let path = |name: &str| place.path(name).to_str().unwrap().to_owned();
    let (config, state) = (path("fringed.toml"), path("state"));
    let timed = |words: &[&str]| {
        let began = Instant::now();
        let run = program().run(words).succeeded();
        println!(
            "{:6.1} s  fringed {}",
            began.elapsed().as_secs_f64(),
            words[0]
        );
        run
    };
    let at = ["--config", &*config];
    let stored = [&at[..], &["--state", &*state]].concat();
    timed(&[&["teach", "--number", "1"], &stored[..]].concat());
    timed(&[&["doctor"], &at[..]].concat());
    let file = path("one.recipe");
    timed(&[&["recipe", "export", "1", &*file], &stored[..]].concat());
    timed(&[&["recipe", "delete", "1"], &stored[..]].concat());
    timed(&[&["recipe", "import", &*file], &stored[..]].concat());
    // A recording of the recipe's frames is judged, one of many frames measured, and its pictures
    // are imported.
    let recorded = path("recorded");
    timed(&[&["record", &*recorded, "--recipe", &*file], &at[..]].concat());
    let judged = timed(&["replay", &recorded, "--recipe", &file]);
    assert!(judged.stdout.contains("PASS"), "{}", judged.stdout);
    let (many, pictures) = (path("many"), path("many/frames"));
    let steps = ["--fringes", "64", "--steps", "8"];
    timed(&[&["record", &*many], &steps[..], &at[..]].concat());
    let imported = path("imported");
    let projector = [
        "--projector",
        "1024x768",
        "--fringes",
        "1,8,64",
        "--steps",
        "8",
    ];
    let import = [&["import", &*pictures, "--out", &*imported], &projector[..]].concat();
    laboratory().run(&import).succeeded();
    for recording in [&recorded, &many, &imported] {
        let out = format!("{recording}-measured");
        timed(&["measure", recording, "--out", &out]);
        assert!(fs::metadata(format!("{out}/report.json")).is_ok());
    }
    let daemon = Daemon::start(&place);
    let mut plc = Plc::connect(&daemon);
    assert_eq!(plc.measure(1)[8], PASS);
}

/// Sections of a joint.
const SECTIONS: usize = 16;

#[test]
#[ignore = "takes minutes: `.ci/run full`"]
fn sixteen_sections_of_a_joint_are_tried_stored_judged_and_shown_in_space() {
    let place = Place::before(&scene("joint"));
    let daemon = Daemon::start(&place);
    let mut browser = Browser::new(&daemon);
    browser.sign_in(&daemon);
    let recipe = browser.get("/api/recipes/1");
    let mut edit = json!({ "datums": recipe["datums"], "fingerprint": recipe["fingerprint"] });
    let mut features = recipe["features"].as_array().unwrap().clone();
    let mut gauges = Vec::new();
    for at in 0..SECTIONS {
        let (name, row) = (format!("joint {at}"), 350 + 25 * at);
        features.push(json!({
            "name": name, "kind": "section", "from": [588, row], "to": [868, row], "width_mm": 2.0,
            "left": [2.0, 12.0], "right": [28.0, 36.0],
        }));
        for kind in ["gap", "flush"] {
            gauges.push(json!({
                "slot": gauges.len() + 1, "name": format!("{kind} {at}"), "kind": kind, "of": [name],
                "golden": true, "plus": 0.5, "minus": 0.5,
            }));
        }
    }
    (edit["features"], edit["gauges"]) = (features.into(), gauges.into());
    let (status, tried) = browser.json("POST", "/api/recipes/1/try", &edit);
    assert_eq!((status, &tried["problems"]), (200, &json!([])), "{tried}");
    let (status, answer) = browser.json("PUT", "/api/recipes/1", &edit);
    assert_eq!(status, 200, "{answer}");
    browser.wait_for_another(recipe["fingerprint"].as_str().unwrap());
    let result = browser.measure();
    assert_eq!(result["verdict"], "PASS", "{result}");
    assert_eq!(result["gauges"].as_array().unwrap().len(), 2 * SECTIONS);
    let (status, surface) = browser.ask("GET", "/api/picture/surface?level=0", &[]);
    // Five words of each pixel.
    assert_eq!((status, surface.len()), (200, 5 * 2 * 1456 * 1088));
}

#[test]
#[ignore = "takes minutes: `.ci/run full`"]
fn a_bare_head_is_commissioned_with_ten_poses_teaches_and_watches_for_drift() {
    let rig = "angle_deg = 20.7\n[rig.projector]\nangle_deg = -7.6\n";
    let place = Place::before(&format!("calibrated = false\n{CAMERA}{rig}"));
    let daemon = Daemon::start(&place);
    let (_, rest) = daemon.log.split_once("shown this once: ").unwrap();
    let mut technician = Technician::sign_in(&daemon, rest.split(' ').next().unwrap());
    technician.lay(&json!({ "part": "plane" }));
    for step in ["devices", "aim", "exposure", "timing"] {
        technician.passes(step, &json!({}));
    }
    for number in 1..=10 {
        let pose = technician.pose(number);
        assert_eq!(pose["usable"], true, "{pose}");
    }
    technician.passes("geometry", &json!({ "action": "solve" }));
    technician.lay(&json!({ "part": "plane" }));
    technician.passes("plane", &json!({}));
    technician.lay(&json!({ "part": "sheet_metal" }));
    let (status, answer) = (technician.browser).json("POST", "/api/recipes/1/teach", &json!({}));
    assert_eq!(status, 202, "{answer}");
    follow(&mut technician.browser, "teach", &Value::Null);
    assert_eq!(technician.browser.measure()["verdict"], "PASS");
    let drift = technician.head()["drift"].clone();
    assert_eq!(
        (&drift["drifted"], &drift["remedy"]),
        (&json!(false), &Value::Null),
        "{drift}"
    );
}
