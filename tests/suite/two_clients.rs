//! Two clients change the same recipe at the same time: no change is lost whose answer was success.

use crate::page::Browser;
use crate::station_plc::{Daemon, Place};
use serde_json::{Value, json};
use std::sync::Barrier;

const ROUNDS: usize = 60;
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
    let place = Place::new();
    let daemon = Daemon::start(&place);
    let [mut first, mut second] = two(&daemon);
    let together = Barrier::new(2);
    for round in 0..ROUNDS {
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
    let place = Place::new();
    let daemon = Daemon::start(&place);
    let [mut editor, mut importer] = two(&daemon);
    let (status, imported) = editor.ask("GET", "/api/recipes/1/file", &[]);
    assert_eq!(status, DONE);
    let name = editor.get("/api/recipes/1")["name"].clone();
    let together = Barrier::new(2);
    let mut conflicts = 0;
    for round in 0..ROUNDS / 2 {
        let base = fingerprint(&mut editor);
        assert_eq!(rename(&mut editor, &base, "before").0, DONE);
        let base = fingerprint(&mut editor);
        let edited = std::thread::scope(|scope| {
            let edit = scope.spawn(|| {
                together.wait();
                rename(&mut editor, &base, "edited").0
            });
            together.wait();
            let (status, answer) = importer.ask("POST", "/api/recipes", &imported);
            assert_eq!(status, 201, "{}", String::from_utf8_lossy(&answer));
            edit.join().unwrap()
        });
        assert!([DONE, CONFLICT].contains(&edited), "{edited}");
        conflicts += usize::from(edited == CONFLICT);
        // In either order: an import replaces an edit, and an edit with another base does not replace an import.
        assert_eq!(editor.get("/api/recipes/1")["name"], name, "round {round}");
    }
    println!("{conflicts} of {} edits came too late", ROUNDS / 2);
}
