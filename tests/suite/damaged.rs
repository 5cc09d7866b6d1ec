//! Files of the state folder that are damaged, endless or gone, a full disk, and requests that are
//! refused: the station says so, and serves.

use crate::page::{Browser, signed_in};
use crate::station_plc::{Daemon, Place, Plc, READY, RECIPE_OK, SMALL_HEAD, long};
use serde_json::json;
use std::fs;
use std::io::{Read as _, Write as _};
use std::os::unix::fs::symlink;

const PASS: u16 = 1;

#[test]
fn a_damaged_counter_or_secret_is_put_aside_and_the_station_starts_and_says_what_is_lost() {
    let place = Place::taught();
    let daemon = Daemon::start(&place);
    let shown = {
        let mut plc = Plc::connect(&daemon);
        (1..=5).map(|token| long(&plc.measure(token), 0)).max()
    };
    assert_eq!(daemon.terminate().code(), Some(0));
    for damaged in [&b"4x\n"[..], b"", b"\xff\xff\xff\xff"] {
        for name in ["result-seq", "access/secret"] {
            fs::write(place.path("state").join(name), damaged).unwrap();
        }
        let daemon = Daemon::start(&place);
        for words in [
            "put aside as result-seq.damaged",
            "RESULT_SEQ goes on with ",
            "put aside as secret.damaged",
            "shown this once: ",
        ] {
            assert!(daemon.log.contains(words), "{words}: {}", daemon.log);
        }
        for name in ["result-seq.damaged", "access/secret.damaged"] {
            let kept = fs::read(place.path("state").join(name)).unwrap();
            assert_eq!(kept, damaged, "{name}");
        }
        let words = Plc::connect(&daemon).measure(6);
        assert_eq!(words[8], PASS);
        assert!(Some(long(&words, 0)) > shown, "a number came twice");
        // The new secret opens.
        Browser::new(&daemon).sign_in(&daemon);
    }
}

#[test]
fn a_state_file_that_never_ends_does_not_keep_the_station_from_starting() {
    let place = Place::taught();
    let names = [
        "commissioning.json",
        "drift.json",
        "boots",
        "serial",
        "result-seq",
        "access/secret",
    ];
    assert_eq!(Daemon::start(&place).terminate().code(), Some(0));
    let serial = fs::read_to_string(place.path("state/serial")).unwrap();
    for endless in [true, false] {
        for name in names {
            let path = place.path("state").join(name);
            // Not every file has been written yet.
            let _ = fs::remove_file(&path);
            match endless {
                true => symlink("/dev/zero", &path).unwrap(),
                false => {
                    let (kind, mode) = (rustix::fs::FileType::Fifo, rustix::fs::Mode::RWXU);
                    rustix::fs::mknodat(rustix::fs::CWD, &path, kind, mode, 0).unwrap();
                }
            }
        }
        let daemon = Daemon::start(&place);
        assert!(daemon.log.contains("it is not a file"), "{}", daemon.log);
        assert_eq!(Plc::connect(&daemon).measure(1)[8], PASS);
        assert_eq!(daemon.terminate().code(), Some(0));
    }
    let _ = fs::remove_file(format!("/dev/shm/fringed-{}", serial.trim()));
}

#[test]
fn a_refused_upload_is_answered_with_the_reason_however_long_it_is() {
    let place = Place::taught();
    let daemon = Daemon::start(&place);
    let mut browser = Browser::new(&daemon);
    let megabyte = vec![0; 1 << 20];
    for (signed_in, length, status, words) in [
        (false, 32_u64 << 20, "401", "sign in first"),
        (true, 300 << 20, "413", "too long"),
    ] {
        if signed_in {
            browser.sign_in(&daemon);
        }
        let mut stream = browser.begin("POST", "/api/recipes", length as usize);
        // As a browser, which sends all of it before it looks at the answer.
        for _ in 0..length >> 20 {
            stream.write_all(&megabyte).unwrap();
        }
        let mut answer = String::new();
        stream.read_to_string(&mut answer).unwrap();
        let begin = format!("HTTP/1.1 {status}");
        assert!(
            answer.starts_with(&begin) && answer.contains(words),
            "{answer}"
        );
    }
}

#[test]
fn an_edit_on_a_full_disk_is_answered_as_a_full_disk() {
    let (place, _daemon, mut browser) = signed_in();
    let recipe = browser.get("/api/recipes/1");
    // In place of the file under which the new version is written.
    symlink("/dev/full", place.path("state/recipes/0001.recipe.new")).unwrap();
    let edit = json!({ "fingerprint": recipe["fingerprint"], "gauges": recipe["gauges"], "name": "another" });
    let (status, answer) = browser.json("PUT", "/api/recipes/1", &edit);
    let words = answer["error"].as_str().unwrap();
    assert!(
        status == 507 && words.contains("free space"),
        "{status} {words}"
    );
    let after = browser.get("/api/recipes/1");
    assert_eq!(after, recipe);
}

#[test]
fn teaching_and_lengths_that_cannot_be_are_refused_at_once() {
    let place = Place::before(&format!("calibrated = false\n{SMALL_HEAD}"));
    let daemon = Daemon::start(&place);
    let mut browser = Browser::new(&daemon);
    browser.sign_in(&daemon);
    let (status, answer) = browser.json("POST", "/api/recipes/1/teach", &json!({}));
    let words = answer["error"].as_str().unwrap();
    assert!(
        status == 409 && words.contains("calibrate"),
        "{status} {words}"
    );
    for length in [1e-320, 0.0, -1.0, 1e6] {
        let solve = json!({ "action": "solve", "check_length_mm": length });
        let (status, answer) = browser.json("POST", "/api/head/steps/geometry", &solve);
        let words = answer["error"].as_str().unwrap();
        assert!(
            status == 422 && words.contains("check_length_mm"),
            "{length}: {status} {words}"
        );
    }
    let plc = Plc::connect(&daemon).status();
    assert!(!plc.has(READY) && !plc.has(RECIPE_OK));
}
