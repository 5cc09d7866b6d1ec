//! Two clients at the same time: no change of a recipe is lost whose answer was success, and none
//! of two that trigger is starved.

use crate::page::Browser;
use crate::station_plc::{Daemon, Place, Plc, READY};
use serde_json::{Value, json};
use std::sync::Barrier;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;
use tests::until::PATIENCE;

const ROUNDS: usize = 20;
const MANY_ROUNDS: usize = 100;
const DONE: u16 = 200;
const CONFLICT: u16 = 409;

/// Two signed-in clients.
fn two(daemon: &Daemon) -> [Browser; 2] {
    [(); 2].map(|()| {
        let mut browser = Browser::new(daemon);
        browser.sign_in(daemon);
        browser
    })
}

fn fingerprint(browser: &mut Browser) -> String {
    let recipe = browser.get("/api/recipes/1");
    recipe["fingerprint"].as_str().unwrap().to_owned()
}

fn rename(browser: &mut Browser, base: &str, name: &str) -> (u16, Value) {
    let edit = json!({ "fingerprint": base, "name": name });
    browser.json("PUT", "/api/recipes/1", &edit)
}

#[test]
fn of_two_edits_with_one_base_one_is_stored_and_the_other_is_told() {
    two_edits(ROUNDS);
}

#[test]
#[ignore = "takes a minute: `.ci/run full`"]
fn of_two_edits_at_once_none_is_lost_in_a_hundred_rounds() {
    two_edits(MANY_ROUNDS);
    an_edit_and_an_import(MANY_ROUNDS);
}

fn two_edits(rounds: usize) {
    let place = Place::taught();
    let daemon = Daemon::start(&place);
    let [mut first, mut second] = two(&daemon);
    let together = Barrier::new(2);
    for round in 0..rounds {
        let base = fingerprint(&mut first);
        let change = |browser: &mut Browser, who: &str| {
            let name = format!("{who} {round}");
            together.wait();
            (rename(browser, &base, &name), name)
        };
        let (one, other) = std::thread::scope(|scope| {
            let one = scope.spawn(|| change(&mut first, "first"));
            let other = change(&mut second, "second");
            (one.join().unwrap(), other)
        });
        let ((stored, name), refused) = match one.0.0 {
            DONE => (one, other.0),
            _ => (other, one.0),
        };
        assert_eq!((stored.0, refused.0), (DONE, CONFLICT), "round {round}");
        let words = refused.1["error"].as_str().unwrap();
        assert!(words.contains("repeat the change"), "{words}");
        let recipe = first.get("/api/recipes/1");
        assert_eq!(recipe["name"], name, "round {round}");
        assert_eq!(recipe["fingerprint"], stored.1["fingerprint"]);
    }
}

#[test]
fn an_edit_does_not_undo_an_import_that_came_while_it_was_made() {
    an_edit_and_an_import(ROUNDS / 2);
}

fn an_edit_and_an_import(rounds: usize) {
    let place = Place::taught();
    let daemon = Daemon::start(&place);
    let [mut editor, mut importer] = two(&daemon);
    let (status, imported) = editor.ask("GET", "/api/recipes/1/file", &[]);
    assert_eq!(status, DONE);
    let name = editor.get("/api/recipes/1")["name"].clone();
    let together = Barrier::new(2);
    let mut conflicts = 0;
    for round in 0..rounds {
        let base = fingerprint(&mut editor);
        assert_eq!(rename(&mut editor, &base, "before").0, DONE);
        let base = fingerprint(&mut editor);
        let edited = std::thread::scope(|scope| {
            let edit = scope.spawn(|| {
                together.wait();
                rename(&mut editor, &base, "edited").0
            });
            together.wait();
            let (status, answer) = importer.ask("POST", "/api/recipes?replace=true", &imported);
            assert_eq!(status, 201, "{}", String::from_utf8_lossy(&answer));
            edit.join().unwrap()
        });
        assert!([DONE, CONFLICT].contains(&edited), "{edited}");
        conflicts += usize::from(edited == CONFLICT);
        // In either order: an import replaces an edit, and an edit with another base does not
        // replace an import.
        assert_eq!(editor.get("/api/recipes/1")["name"], name, "round {round}");
    }
    println!("{conflicts} of {rounds} edits came too late");
}

/// Triggers until `ended`, asking for the status so many times in between; returns how many were
/// accepted. Tokens begin at `first`.
fn trigger(daemon: &Daemon, first: u16, asks: usize, ended: &AtomicBool) -> u32 {
    let mut plc = Plc::connect(daemon);
    let mut accepted = 0;
    let mut token = first;
    while !ended.load(Ordering::Relaxed) {
        if plc.write_and_read_status(1, &[token]).last_token() == token {
            accepted += 1;
            token += 1;
        }
        for _ in 0..asks {
            plc.status();
        }
    }
    accepted
}

#[test]
fn of_two_clients_that_trigger_without_a_pause_each_is_granted_in_turn() {
    /// Cycles of both, and the least of each.
    const CYCLES: u32 = 60;
    const LEAST: u32 = CYCLES / 3;
    let place = Place::taught();
    let daemon = Daemon::start(&place);
    let mut plc = Plc::connect(&daemon);
    let before = plc.wait("READY", |status| status.has(READY)).triggers();
    let ended = AtomicBool::new(false);
    let (fast, slow) = std::thread::scope(|scope| {
        let fast = scope.spawn(|| trigger(&daemon, 1, 0, &ended));
        let slow = scope.spawn(|| trigger(&daemon, 30_000, 8, &ended));
        let began = Instant::now();
        while plc.status().triggers() - before < CYCLES && began.elapsed() < PATIENCE {}
        ended.store(true, Ordering::Relaxed);
        (fast.join().unwrap(), slow.join().unwrap())
    });
    println!("{fast} of the fast client, {slow} of the slow one");
    assert!(fast >= LEAST && slow >= LEAST, "{fast} {slow}");
}
