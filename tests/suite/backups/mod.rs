//! Backups and the way back, on the real program: consistent beside edits, restored whole or not at
//! all, and nothing of a hostile archive.

mod hostile;
mod killed;
mod power;

use crate::history::recording;
use crate::page::Browser;
use crate::station_plc::{Daemon, Place};
use crate::written::program;
use appliance::backup::checking::{CheckedBackup, check};
use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet};
use std::fs::{self, File};
use std::io;
use std::time::{Duration, Instant};
use tests::files;
use tests::small_head::tiny_head;
use tests::until::{PATIENCE, until};

/// Of every part the frames are kept.
const KEEP_ALL: &str = "[history]\ngood_every = 1\n";

/// A station with few pixels that keeps the frames of every part.
fn place() -> Place {
    place_before(&tiny_head(48, 36))
}

fn place_before(scene: &str) -> Place {
    let place = Place::before(scene);
    let config = fs::read_to_string(place.path("fringed.toml")).unwrap();
    fs::write(place.path("fringed.toml"), config + KEEP_ALL).unwrap();
    place
}

fn started(place: &Place) -> (Daemon, Browser) {
    entered(place, Daemon::start(place))
}

/// Signs in at a station that has started.
fn entered(place: &Place, daemon: Daemon) -> (Daemon, Browser) {
    let mut browser = Browser::new(&daemon);
    match daemon.log.contains("shown this once") {
        true => {
            browser.sign_in(&daemon);
            let (_, rest) = daemon.log.split_once("shown this once: ").unwrap();
            let secret = rest.split(' ').next().unwrap();
            fs::write(place.path("secret"), secret).unwrap();
        }
        false => {
            let secret = fs::read_to_string(place.path("secret")).unwrap();
            let body = json!({ "secret": secret });
            let (status, answer) = browser.json("POST", "/api/session", &body);
            assert_eq!(status, 200, "{answer}");
        }
    }
    browser.ready();
    (daemon, browser)
}

fn backup(browser: &mut Browser, more: &str) -> Vec<u8> {
    let (status, zip) = browser.ask("GET", &format!("/api/backup.zip{more}"), &[]);
    assert_eq!(status, 200, "{}", String::from_utf8_lossy(&zip));
    zip
}

fn checked(zip: &[u8]) -> (tempfile::TempDir, io::Result<CheckedBackup>) {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("backup.zip");
    fs::write(&file, zip).unwrap();
    let checked = check(File::open(&file).unwrap(), &folder.path().join("into"));
    (folder, checked)
}

/// Measures a part, and waits until its result is in the history; its SEQ.
fn measured(browser: &mut Browser) -> u64 {
    let seq = browser.measure()["seq"].as_u64().unwrap();
    until("stored result", PATIENCE, || {
        let (_, results) = collected(browser, seq as u32 - 1);
        results.first().cloned().ok_or(())
    });
    seq
}

/// Sends a backup and orders a choice of it; the plan.
#[track_caller]
fn ordered(browser: &mut Browser, zip: &[u8], choice: &Value) -> Value {
    let (status, answer) = browser.ask("POST", "/api/restore", zip);
    let plan: Value = serde_json::from_slice(&answer).unwrap();
    assert_eq!(status, 200, "{plan}");
    let (status, answer) = browser.json("PUT", "/api/restore", choice);
    assert_eq!(status, 200, "{answer}");
    plan["checked"].clone()
}

/// The header and the results of a station as a collector gets them behind `after`.
fn collected(browser: &mut Browser, after: u32) -> (Value, Vec<Value>) {
    let (status, answer) = browser.ask("GET", &format!("/api/results?after={after}"), &[]);
    assert_eq!(status, 200);
    let mut lines = answer
        .split(|byte| *byte == b'\n')
        .filter(|line| !line.is_empty());
    let mut read = || {
        lines
            .next()
            .map(|line| serde_json::from_slice(line).unwrap())
    };
    let header = read().unwrap();
    (header, std::iter::from_fn(read).collect())
}

fn seqs(results: &[Value]) -> Vec<u64> {
    results
        .iter()
        .map(|result| result["seq"].as_u64().unwrap())
        .collect()
}

#[test]
fn a_backup_is_whole_beside_cycles_and_edits_and_has_each_recipe_before_or_after() {
    let place = place();
    let (daemon, mut browser) = started(&place);
    let recipe = browser.get("/api/recipes/1");
    let (mut versions, mut fingerprint) = (BTreeSet::new(), recipe["fingerprint"].clone());
    versions.insert(fingerprint.as_str().unwrap().to_owned());
    let mut backups = Vec::new();
    let other = || {
        let mut other = Browser::new(&daemon);
        other.cookie.clone_from(&browser.cookie);
        other
    };
    let (mut cycler, mut taker) = (other(), other());
    std::thread::scope(|scope| {
        let cycling = scope.spawn(move || {
            let began = Instant::now();
            let mut cycles = 0;
            while began.elapsed() < Duration::from_secs(4) {
                let (status, _) = cycler.json("POST", "/api/trigger", &json!({}));
                cycles += u32::from(status == 202);
            }
            cycles
        });
        let taking = scope.spawn(move || {
            (0..8)
                .map(|_| backup(&mut taker, "?users=true"))
                .collect::<Vec<_>>()
        });
        let mut edits = 0;
        while !taking.is_finished() {
            let edit = json!({ "fingerprint": fingerprint, "name": format!("name {edits}") });
            let (status, answer) = browser.json("PUT", "/api/recipes/1", &edit);
            assert_eq!(status, 200, "{answer}");
            fingerprint = answer["fingerprint"].clone();
            versions.insert(fingerprint.as_str().unwrap().to_owned());
            edits += 1;
        }
        assert!(edits > 3, "{edits}");
        backups = taking.join().unwrap();
        assert!(cycling.join().unwrap() > 20);
    });
    let mut results = 0;
    for zip in &backups {
        let (folder, checked) = checked(zip);
        let checked = checked.unwrap();
        let history = checked.history.unwrap();
        assert!(history.results >= results);
        results = history.results;
        let recipe = fs::read(folder.path().join("into/recipes/0001.recipe")).unwrap();
        let (file, _) = files::recipe(&recipe);
        assert!(versions.contains(&file.fingerprint), "{}", file.fingerprint);
        let counter = fs::read_to_string(folder.path().join("into/result-seq")).unwrap();
        let used: u32 = counter.split(' ').next().unwrap().parse().unwrap();
        assert!(history.last.is_none_or(|last| last <= used));
        let names: BTreeSet<&str> = checked
            .manifest
            .members
            .iter()
            .map(|member| &*member.name)
            .collect();
        for name in ["fringed.toml", "access/changes.jsonl", "history.db"] {
            assert!(names.contains(name), "{names:?}");
        }
        assert!(!names.contains("access/secret") && !names.contains("serial"));
    }
    assert!(results > 0);
    // Nothing of it stays behind.
    assert_eq!(
        files::names(&place.path("state/restore")),
        Vec::<String>::new()
    );
    // The command makes the same beside the station, and checks it.
    let (file, config) = (place.path("b.zip"), place.path("fringed.toml"));
    let arguments = [
        "backup",
        file.to_str().unwrap(),
        "--config",
        config.to_str().unwrap(),
    ];
    program().run(&arguments).succeeded();
    let said = program()
        .run(&["backup", "--check", file.to_str().unwrap()])
        .succeeded()
        .stdout;
    assert!(said.contains("is whole"), "{said}");
}

#[test]
fn a_restored_device_judges_twelve_parts_bit_by_bit_and_a_collector_loses_and_doubles_nothing() {
    let place = place();
    let (daemon, mut browser) = started(&place);
    for _ in 0..12 {
        let seq = measured(&mut browser);
        // The frames of a part that comes while others are written are not kept.
        recording(&place, seq as u32);
    }
    let before = browser.get("/api/recipes/1")["fingerprint"].clone();
    // A collector's rows by history and SEQ, as docs/api.md has the rule.
    let mut rows: BTreeMap<String, BTreeSet<u64>> = BTreeMap::new();
    let mut collect = |browser: &mut Browser| {
        let (header, _) = collected(browser, 0);
        let id = header["history"].as_str().unwrap().to_owned();
        let end = |id: &str| {
            rows.get(id)
                .and_then(|seqs| seqs.last().copied())
                .unwrap_or(0)
        };
        let earlier = header["earlier"].as_array().cloned().unwrap_or_default();
        let known = earlier.iter().map(|earlier| {
            let last = earlier["last"].as_u64().unwrap();
            end(earlier["history"].as_str().unwrap()).min(last)
        });
        let after = known.chain([end(&id)]).max().unwrap();
        let (_, results) = collected(browser, after as u32);
        rows.entry(id).or_default().extend(seqs(&results));
        rows.clone()
    };
    collect(&mut browser);
    let zip = backup(&mut browser, "?recordings=true");
    // More parts, another version of the recipe: what the restore takes back.
    let edit = json!({ "fingerprint": before, "name": "another" });
    assert_eq!(browser.json("PUT", "/api/recipes/1", &edit).0, 200);
    browser.ready();
    measured(&mut browser);
    collect(&mut browser);
    let later = measured(&mut browser);
    let plan = ordered(&mut browser, &zip, &json!({ "what": "everything" }));
    assert_eq!(
        (&plan["same_device"], &plan["recipes"][0]["present"]),
        (&json!(true), &json!("other"))
    );
    assert_eq!(plan["history"]["results"], 12);
    let serial = fs::read_to_string(place.path("state/serial")).unwrap();
    daemon.kill();
    let (daemon, mut browser) = started(&place);
    assert_eq!(
        fs::read_to_string(place.path("state/serial")).unwrap(),
        serial
    );
    assert_eq!(browser.get("/api/recipes/1")["fingerprint"], before);
    let next = measured(&mut browser);
    assert!(next > later, "{next} {later}");
    collect(&mut browser);
    // The frames that came back are judged as they were, to the bit.
    let recordings = files::names(&place.path("state/recordings"));
    let kept = recordings
        .iter()
        .filter(|name| !name.starts_with('.') && !name.starts_with(&format!("{next:010}")));
    let kept: Vec<&String> = kept.collect();
    assert_eq!(kept.len(), 12);
    let config = place.path("fringed.toml");
    for name in kept {
        let recording = place.path(&format!("state/recordings/{name}"));
        let arguments = [
            "replay",
            recording.to_str().unwrap(),
            "--config",
            config.to_str().unwrap(),
            "--json",
        ];
        let answer: Value =
            serde_json::from_str(&program().run(&arguments).succeeded().stdout).unwrap();
        // It says where the two differ, by another exit code.
        assert_eq!(answer["recipe"]["same"], true, "{answer}");
        assert!(answer["stored"].is_object(), "{answer}");
    }
    // Undone, what came between is there again.
    let (status, answer) = browser.json("POST", "/api/restore/undo", &json!({}));
    assert_eq!((status, &answer["ordered"]["what"]), (200, &json!("undo")));
    assert!(daemon.terminate().success());
    let (_daemon, mut browser) = started(&place);
    assert_eq!(browser.get("/api/recipes/1")["name"], "another");
    let last = measured(&mut browser);
    assert!(last > next);
    let rows = collect(&mut browser);
    let all: Vec<u64> = rows.values().flatten().copied().collect();
    let once: BTreeSet<u64> = all.iter().copied().collect();
    assert_eq!(all.len(), once.len(), "{rows:?}");
    let wanted: BTreeSet<u64> = (1..=later).chain([next, last]).collect();
    assert_eq!(once, wanted);
}

#[test]
fn another_device_takes_recipes_but_no_results_unless_it_replaces_the_first_and_another_head_is_refused()
 {
    let first = place();
    let (_daemon, mut browser) = started(&first);
    measured(&mut browser);
    let fingerprint = browser.get("/api/recipes/1")["fingerprint"].clone();
    let body = json!({ "role": "operator", "secret": "135790" });
    assert_eq!(browser.json("PUT", "/api/users/anna", &body).0, 200);
    let zip = backup(&mut browser, "?users=true");
    let serial_of = |place: &Place| fs::read_to_string(place.path("state/serial")).unwrap();
    for replaces in [false, true] {
        let second = place();
        let (daemon, mut browser) = started(&second);
        let own = serial_of(&second);
        let choice = json!({ "what": "everything", "users": true, "replaces_device": replaces });
        let plan = ordered(&mut browser, &zip, &choice);
        assert_eq!(
            (&plan["same_device"], &plan["serial"]),
            (&json!(false), &json!(serial_of(&first).trim()))
        );
        assert_eq!(
            plan["users"][0],
            json!({ "name": "anna", "role": "operator", "present_role": null })
        );
        assert!(daemon.terminate().success());
        let (_daemon, mut browser) = started(&second);
        assert_eq!(browser.get("/api/recipes/1")["fingerprint"], fingerprint);
        let users = browser.get("/api/users");
        assert_eq!(users["users"][1]["name"], "anna");
        let next = measured(&mut browser);
        let (header, results) = collected(&mut browser, 0);
        match replaces {
            true => {
                assert_eq!(serial_of(&second), serial_of(&first));
                // How far the first one went is not known.
                assert!(next > 1 << 23, "{next}");
                assert_eq!(
                    (results.len(), &header["earlier"][0]["last"]),
                    (2, &json!(1))
                );
            }
            false => {
                assert_eq!(serial_of(&second), own);
                assert_eq!(
                    (seqs(&results), &header["earlier"]),
                    (vec![1], &Value::Null)
                );
            }
        }
    }
    // Another camera.
    let other = place_before(&tiny_head(64, 48));
    let (_daemon, mut browser) = started(&other);
    let (status, answer) = browser.ask("POST", "/api/restore", &zip);
    let answer: Value = serde_json::from_slice(&answer).unwrap();
    assert_eq!(status, 200, "{answer}");
    let problem = answer["checked"]["recipes"][0]["problem"].as_str().unwrap();
    assert!(problem.contains("teach it again"), "{problem}");
    let calibration = browser.json("PUT", "/api/restore", &json!({ "what": "calibration" }));
    assert_eq!(calibration.0, 422, "{calibration:?}");
    let (status, answer) = browser.json("DELETE", "/api/restore", &json!({}));
    assert_eq!((status, &answer["checked"]), (200, &Value::Null));
}

#[test]
fn a_calibration_comes_back_alone_and_is_refused_on_another_head_by_name() {
    let calibrated = |size: u32| {
        let place = place_before(&format!("[rig.camera]\nwidth = {size}\nheight = {size}\n"));
        let (config, state) = (place.path("fringed.toml"), place.path("state"));
        let [config, state] = [&config, &state].map(|path| path.to_str().unwrap());
        let arguments = ["calibrate", "--config", config, "--state", state];
        program().run(&arguments).succeeded();
        place
    };
    let first = calibrated(160);
    let (daemon, mut browser) = started(&first);
    let seq = measured(&mut browser);
    recording(&first, seq as u32);
    let zip = backup(&mut browser, "");
    let other = calibrated(200);
    let (_daemon, mut elsewhere) = started(&other);
    let (status, _) = elsewhere.ask("POST", "/api/restore", &zip);
    assert_eq!(status, 200);
    for what in ["calibration", "everything"] {
        let (status, answer) = elsewhere.json("PUT", "/api/restore", &json!({ "what": what }));
        let words = answer["error"].as_str().unwrap();
        assert!(
            status == 422 && words.contains("of another head: it is for a camera of 160×160"),
            "{answer}"
        );
    }
    let fingerprint = |place: &Place| -> Value {
        let text = fs::read(place.path("state/calibration/calibration.json")).unwrap();
        serde_json::from_slice::<Value>(&text).unwrap()["fingerprint"].clone()
    };
    let before = fingerprint(&first);
    ordered(&mut browser, &zip, &json!({ "what": "calibration" }));
    assert!(daemon.terminate().success());
    let (daemon, mut browser) = started(&first);
    assert_eq!(fingerprint(&first), before);
    assert_eq!(browser.get("/api/restore")["before"]["what"], "calibration");
    // A backup without recordings leaves those of this device beside its results.
    ordered(&mut browser, &zip, &json!({ "what": "everything" }));
    assert!(daemon.terminate().success());
    let (_daemon, mut browser) = started(&first);
    assert_eq!(browser.measure()["verdict"], "PASS");
    let kept = browser.get(&format!("/api/history/{seq}"));
    assert!(kept["result"]["recording"].is_string(), "{kept}");
}
