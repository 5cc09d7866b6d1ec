//! Recipes that come from elsewhere: none takes the place of a released one unasked, and none takes
//! its part number.

use crate::page::{Browser, signed_in};
use crate::station_plc::{Daemon, ONLINE, Place, Plc};
use crate::written::program;
use appliance::recipe::file::archive;
use appliance::recipe::{RecipeFile, Store};
use serde_json::{Value, json};
use std::fs;
use tests::files;
use tests::program::Run;
use tests::until::{PATIENCE, until};

/// RECIPE_RESULT, and values of it.
const MADE_FOR_ANOTHER_HEAD: u16 = 3;
const UNFIT: u16 = 5;
/// CONTROL: RECIPE_LOAD; STATUS: RECIPE_LOADING; RECIPE_SELECT by PART_NUMBER.
const RECIPE_LOAD: u16 = 1 << 3;
const RECIPE_LOADING: u16 = 1 << 8;
const BY_PART_NUMBER: u16 = 0xFFFF;

/// Recipe 1 of this place with a change.
fn changed(place: &Place, change: impl Fn(&mut RecipeFile)) -> Vec<u8> {
    let (mut file, arrays) = files::recipe(&fs::read(place.recipe()).unwrap());
    change(&mut file);
    archive::pack(&file, &arrays).unwrap().0
}

/// A recipe 1 of another head, as it is called there.
fn foreign(place: &Place) -> Vec<u8> {
    changed(place, |file| {
        file.calibration = "f".repeat(64);
        file.name = "theirs".into();
    })
}

/// Sends a recipe file to the page.
fn import(browser: &mut Browser, query: &str, file: &[u8]) -> (u16, Value) {
    once_ready(browser, &format!("/api/recipes{query}"), file)
}

/// Brings back the generation before.
fn undo(browser: &mut Browser) -> (u16, Value) {
    once_ready(browser, "/api/recipes/1/undo", b"{}")
}

/// Posts something, again while the station is loading a recipe.
fn once_ready(browser: &mut Browser, path: &str, body: &[u8]) -> (u16, Value) {
    until("ready station", PATIENCE, || {
        let (status, answer) = browser.ask("POST", path, body);
        let answer: Value = serde_json::from_slice(&answer).unwrap();
        let words = answer["error"].as_str().unwrap_or_default();
        match words.ends_with("try again when it is ready") {
            true => Err(answer),
            false => Ok((status, answer)),
        }
    })
}

/// Runs the command `recipe` in this place.
fn recipe(place: &Place, arguments: &[&str]) -> Run {
    let config = place.path("fringed.toml");
    let mut all = vec!["recipe"];
    all.extend(arguments);
    all.extend(["--config", config.to_str().unwrap()]);
    program().run(&all)
}

#[test]
fn a_file_of_another_head_replaces_a_released_recipe_only_on_request_and_undo_brings_that_back() {
    let (place, _daemon, mut browser) = signed_in();
    let released = fs::read(place.recipe()).unwrap();
    let theirs = foreign(&place);

    let (status, answer) = import(&mut browser, "", &theirs);
    let words = answer["error"].as_str().unwrap();
    assert_eq!((status, &answer["taken"]), (409, &json!(1)), "{answer}");
    for needle in ["Part 1", "replace=true", "number 2, which is free"] {
        assert!(words.contains(needle), "{needle}: {words}");
    }
    assert_eq!(fs::read(place.recipe()).unwrap(), released);

    // As another recipe it does not take the part number by which the PLC selects the released one.
    let (status, answer) = import(&mut browser, "?number=2", &theirs);
    assert_eq!((status, &answer["number"]), (201, &json!(2)), "{answer}");
    let note = answer["note"].as_str().unwrap();
    for needle in ["recipe 1", "no part number", "was made for calibration"] {
        assert!(note.contains(needle), "{needle}: {note}");
    }
    let copy = browser.get("/api/recipes/2");
    assert_eq!(
        (&copy["name"], &copy["part_number"]),
        (&json!("theirs"), &json!(""))
    );
    assert_eq!(copy["fingerprint"], answer["fingerprint"]);
    assert_eq!(fs::read(place.recipe()).unwrap(), released);

    let (status, answer) = import(&mut browser, "?replace=true", &theirs);
    assert_eq!(status, 201, "{answer}");
    assert_eq!(fs::read(place.recipe()).unwrap(), theirs);
    // The same file again changes nothing: the released recipe stays the previous generation.
    assert_eq!(import(&mut browser, "", &theirs).0, 201);
    let (status, answer) = undo(&mut browser);
    assert_eq!(status, 200, "{answer}");
    assert_eq!(fs::read(place.recipe()).unwrap(), released);
    // What this head cannot use does not come back over what it can use.
    let (status, answer) = undo(&mut browser);
    assert_eq!(status, 422, "{answer}");
    assert_eq!(fs::read(place.recipe()).unwrap(), released);
    for refused in ["?number=0", "?number=10000"] {
        assert_eq!(import(&mut browser, refused, &theirs).0, 422, "{refused}");
    }
    assert_eq!(browser.ask("POST", "/api/recipes?other=1", &theirs).0, 400);
}

#[test]
fn the_command_import_asks_for_replace_or_a_number_and_what_was_replaced_comes_back() {
    let place = Place::taught();
    let released = fs::read(place.recipe()).unwrap();
    let other = changed(&place, |file| file.name = "other".into());
    let file = place.path("other.recipe");
    fs::write(&file, &other).unwrap();
    let file = file.to_str().unwrap();
    let refused = recipe(&place, &["import", file]);
    assert_eq!(refused.code, 73, "{}", refused.stderr);
    for needle in ["Part 1", "--replace", "number 2, which is free"] {
        assert!(refused.stderr.contains(needle), "{}", refused.stderr);
    }
    assert_eq!(fs::read(place.recipe()).unwrap(), released);
    let said = recipe(&place, &["import", file, "--number", "2"])
        .succeeded()
        .stdout;
    assert!(said.contains("no part number"), "{said}");
    assert_eq!(fs::read(place.recipe()).unwrap(), released);
    recipe(&place, &["import", file, "--replace"]).succeeded();
    assert_eq!(fs::read(place.recipe()).unwrap(), other);
    recipe(&place, &["undo", "1"]).succeeded();
    assert_eq!(fs::read(place.recipe()).unwrap(), released);
}

#[test]
fn no_two_recipes_get_the_same_part_number_and_a_plc_is_told_if_two_have_it() {
    let (place, daemon, mut browser) = signed_in();
    let named = |number: u16, part_number: &str| {
        changed(&place, |file| {
            (file.number, file.part_number) = (number, part_number.into());
        })
    };
    let taken = |(status, answer): (u16, Value)| {
        let words = answer["error"].as_str().unwrap_or_default();
        assert!(
            [409, 422].contains(&status) && words.contains("recipe 1 has the part number"),
            "{status} {answer}"
        );
    };
    // By import, by an edit, and by teaching under a number whose usual part number is in use.
    taken(import(&mut browser, "", &named(2, "PART-0001")));
    assert_eq!(import(&mut browser, "", &named(2, "SECOND")).0, 201);
    let second = browser.get("/api/recipes/2");
    let edit = json!({ "fingerprint": second["fingerprint"], "part_number": "PART-0001" });
    taken(browser.json("PUT", "/api/recipes/2", &edit));
    let first = browser.get("/api/recipes/1");
    let edit = json!({ "fingerprint": first["fingerprint"], "part_number": "PART-0003" });
    assert_eq!(browser.json("PUT", "/api/recipes/1", &edit).0, 200);
    browser.wait_for_another(first["fingerprint"].as_str().unwrap());
    taken(browser.json("POST", "/api/recipes/3/teach", &json!({})));

    // As somebody may have stored them in the folder: neither is selected.
    let store = Store::at(&place.path("state/recipes"));
    store.save(4, &named(4, "SECOND")).unwrap();
    let mut plc = Plc::connect(&daemon);
    let mut fields = vec![ONLINE | RECIPE_LOAD, 0, BY_PART_NUMBER, 0, 0, 0, 0, 0];
    let mut text = b"SECOND".to_vec();
    text.resize(32, 0);
    let pairs = text.chunks(2);
    fields.extend(pairs.map(|pair| u16::from_be_bytes([pair[0], pair[1]])));
    plc.write(0, &[ONLINE]);
    plc.write(0, &fields);
    let done = plc.wait("RECIPE_LOADING to fall", |status| {
        !status.has(RECIPE_LOADING)
    });
    assert_eq!(done.recipe_result(), UNFIT);
    let error = browser.get("/api/snapshot")["error"]["words"].clone();
    assert!(
        error.as_str().unwrap().contains("recipes [2, 4]"),
        "{error}"
    );
}

#[test]
fn a_recipe_of_another_head_is_said_to_be_that_and_only_a_damaged_one_is_damaged() {
    let place = Place::taught();
    let daemon = Daemon::start(&place);
    let store = Store::at(&place.path("state/recipes"));
    let put = |number: u16, change: fn(&mut RecipeFile)| {
        let bytes = changed(&place, |file| {
            (file.number, file.part_number) = (number, String::new());
            change(file);
        });
        store.save(number, &bytes).unwrap();
    };
    put(2, |file| file.calibration = "f".repeat(64));
    // No head measures 9 m above the plane.
    put(3, |file| file.range_mm = [-10.0, 9000.0]);
    put(4, |_| ());
    let damaged = place.path("state/recipes/0004.recipe");
    let mut bytes = fs::read(&damaged).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    fs::write(&damaged, bytes).unwrap();
    let mut plc = Plc::connect(&daemon);
    plc.write(0, &[ONLINE]);
    for (number, result) in [
        (2, MADE_FOR_ANOTHER_HEAD),
        (3, UNFIT),
        (4, 2),
        (5, 1),
        (1, 0),
    ] {
        plc.write(0, &[ONLINE | RECIPE_LOAD, 0, number]);
        plc.write(0, &[ONLINE]);
        let done = plc.wait("RECIPE_LOADING to fall", |status| {
            !status.has(RECIPE_LOADING)
        });
        assert_eq!(done.recipe_result(), result, "recipe {number}");
    }
}

#[test]
fn the_record_of_changes_says_which_limit_went_from_what_to_what() {
    let (_place, _daemon, mut browser) = signed_in();
    let before = browser.get("/api/recipes/1");
    let mut gauges = before["gauges"].clone();
    let high = gauges[0]["high"].as_f64().unwrap();
    gauges[0]["high"] = json!(0.375);
    (gauges[0]["slot"], gauges[1]["slot"]) = (json!(2), json!(1));
    let edit = json!({
        "fingerprint": before["fingerprint"], "gauges": gauges, "name": "bracket",
    });
    let (status, answer) = browser.json("PUT", "/api/recipes/1", &edit);
    assert_eq!(status, 200, "{answer}");
    // A PLC reads gauges by their slots.
    let note = answer["note"].as_str().unwrap();
    assert!(note.contains("\"deviation\" from 1 to 2"), "{note}");
    let change = browser.get("/api/changes")["changes"][0].clone();
    assert_eq!(
        (&change["action"], &change["outcome"]),
        (&json!("edit recipe"), &json!("done"))
    );
    let words = change["changed"].as_str().unwrap();
    for needle in [
        "name from \"Part 1\" to \"bracket\"",
        &format!("gauge \"deviation\" highest from {high} mm to 0.375 mm"),
        "slots of gauges",
    ] {
        assert!(words.contains(needle), "{needle}: {words}");
    }
    browser.wait_for_another(before["fingerprint"].as_str().unwrap());
    assert_eq!(undo(&mut browser).0, 200);
    let change = browser.get("/api/changes")["changes"][0].clone();
    let words = change["changed"].as_str().unwrap();
    let back = format!("gauge \"deviation\" highest from 0.375 mm to {high} mm");
    assert!(words.contains(&back), "{words}");
}
