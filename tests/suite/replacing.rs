//! Replacing, undoing and deleting recipes on the real program: no work of a technician is lost.

use crate::page::{Browser, signed_in};
use crate::station_plc::{Daemon, ONLINE, Place, Plc, READY};
use crate::written::program;
use serde_json::{Value, json};
use std::fs;
use std::time::Instant;
use tests::program::Run;
use tests::until::PATIENCE;

/// VERDICT of [`Plc::measure`], which returns the registers from 200 on: register 208.
const VERDICT: usize = 8;
const PASS: u16 = 1;
const FAIL: u16 = 2;
/// CONTROL: ONLINE and TEACH.
const TEACH: u16 = ONLINE | 1 << 7;

/// Runs the command `recipe` or `teach` in this place.
fn run(place: &Place, arguments: &[&str]) -> Run {
    let config = place.path("fringed.toml");
    let mut all = arguments.to_vec();
    all.extend(["--config", config.to_str().unwrap()]);
    program().run(&all)
}

/// The entry of recipe `number` in the list of recipes.
fn listed(browser: &mut Browser, number: u16) -> Value {
    let all = browser.get("/api/recipes");
    let rows = all["recipes"].as_array().unwrap().iter();
    let mut rows = rows.filter(|row| row["number"] == number);
    rows.next().cloned().unwrap_or(Value::Null)
}

fn fingerprint(recipe: &Value) -> String {
    recipe["fingerprint"].as_str().unwrap().to_owned()
}

/// Gives recipe 1 names, a region and a limit that a good part violates; returns the changed
/// recipe.
fn edit(browser: &mut Browser) -> Value {
    let before = browser.get("/api/recipes/1");
    let (mut features, mut gauges) = (before["features"].clone(), before["gauges"].clone());
    let corners = json!([[40.0, 40.0], [90.0, 40.0], [90.0, 90.0]]);
    let added = json!({ "name": "rim", "kind": "surface", "region": corners });
    features.as_array_mut().unwrap().push(added);
    (gauges[0]["low"], gauges[0]["high"]) = (json!(0.2), json!(0.3));
    let edit = json!({
        "fingerprint": before["fingerprint"], "name": "bracket", "part_number": "BR-1", "features": features, "gauges": gauges,
    });
    let (status, answer) = browser.json("PUT", "/api/recipes/1", &edit);
    assert_eq!(status, 200, "{answer}");
    assert_eq!(answer["loading"], true, "{answer}");
    browser.wait_for_another(&fingerprint(&before));
    browser.get("/api/recipes/1")
}

#[test]
fn a_number_that_is_taken_is_taught_only_with_replace_and_what_was_edited_stays_on_request() {
    let (_place, daemon, mut browser) = signed_in();
    let edited = edit(&mut browser);
    assert_eq!(browser.get("/api/recipes")["free"], 2);
    let teach =
        |browser: &mut Browser, body: Value| browser.json("POST", "/api/recipes/1/teach", &body);

    let (status, body) = browser.ask("POST", "/api/recipes/1/teach", &[]);
    let words = String::from_utf8(body).unwrap();
    assert_eq!(status, 409, "{words}");
    let features = edited["features"].as_array().unwrap().len();
    for needle in [
        "bracket",
        "replace",
        "number 2",
        &format!("{features} features"),
    ] {
        assert!(words.contains(needle), "{needle}: {words}");
    }
    assert_eq!(teach(&mut browser, json!({ "keep_gauges": true })).0, 422);
    assert_eq!(teach(&mut browser, json!({ "keep": true })).0, 400);
    assert_eq!(browser.get("/api/recipes/1"), edited);

    let keep = json!({ "replace": true, "keep_gauges": true });
    assert_eq!(teach(&mut browser, keep).0, 202);
    let kept = browser.wait_for_another(&fingerprint(&edited));
    let recipe = browser.get("/api/recipes/1");
    for key in ["name", "part_number", "features", "gauges", "min_coverage"] {
        assert_eq!(recipe[key], edited[key], "{key}");
    }
    assert_eq!(
        listed(&mut browser, 1)["before"]["fingerprint"],
        edited["fingerprint"]
    );
    let mut plc = Plc::connect(&daemon);
    assert_eq!(plc.measure(1)[VERDICT], FAIL, "the limit that was edited");

    assert_eq!(teach(&mut browser, json!({ "replace": true })).0, 202);
    browser.wait_for_another(&kept);
    let recipe = browser.get("/api/recipes/1");
    assert_eq!(
        (&recipe["name"], &recipe["part_number"]),
        (&json!("bracket"), &json!("BR-1"))
    );
    assert_ne!(recipe["gauges"], edited["gauges"]);
}

#[test]
fn undo_brings_back_the_previous_generation_into_the_running_station_and_undo_again_takes_it_back()
{
    let (_place, daemon, mut browser) = signed_in();
    let (status, answer) = browser.json("POST", "/api/recipes/1/undo", &json!({}));
    assert!(
        status == 404
            && answer["error"]
                .as_str()
                .unwrap()
                .contains("no previous generation"),
        "{answer}"
    );
    let first = browser.get("/api/recipes/1");
    let second = edit(&mut browser);
    let mut plc = Plc::connect(&daemon);
    for (now, then) in [(&first, &second), (&second, &first)] {
        let (status, answer) = browser.json("POST", "/api/recipes/1/undo", &json!({}));
        assert_eq!(status, 200, "{answer}");
        assert_eq!(answer["fingerprint"], now["fingerprint"]);
        assert_eq!(
            (&answer["active"], &answer["loading"]),
            (&json!(true), &json!(true))
        );
        // The stored recipe, the active one, and what the PLC reads are the same again.
        browser.wait_for_another(&fingerprint(then));
        assert_eq!(browser.get("/api/recipes/1"), *now);
        assert_eq!(
            listed(&mut browser, 1)["before"]["fingerprint"],
            then["fingerprint"]
        );
        let crc = format!(
            "{:08x}",
            plc.wait("READY", |status| status.has(READY)).crc()
        );
        assert!(fingerprint(now).starts_with(&crc), "{crc}");
    }
    // After the second undo the edited limit holds again.
    assert_eq!(plc.measure(1)[VERDICT], FAIL);
    let changes = browser.get("/api/changes");
    assert_eq!(changes["changes"][0]["action"], "undo recipe");
}

#[test]
fn a_recipe_is_deleted_on_the_page_unless_it_is_active_and_comes_back() {
    let place = Place::taught();
    let daemon = Daemon::start(&place);
    let mut browser = Browser::new(&daemon);
    assert_eq!(browser.ask("DELETE", "/api/recipes/1", &[]).0, 401);
    browser.sign_in(&daemon);
    let (status, answer) = browser.json("DELETE", "/api/recipes/1", &json!({}));
    assert!(
        status == 409 && answer["error"].as_str().unwrap().contains("load another"),
        "{answer}"
    );
    let before = fingerprint(&browser.get("/api/recipes/1"));
    assert_eq!(
        browser.json("POST", "/api/recipes/2/teach", &json!({})).0,
        202
    );
    browser.wait_for_another(&before);
    let file = fs::read(place.recipe()).unwrap();
    assert_eq!(browser.ask("DELETE", "/api/recipes/1", &[]).0, 200);
    assert!(!place.recipe().exists());
    let all = browser.get("/api/recipes");
    assert_eq!(
        (&all["recipes"][0]["number"], &all["deleted"][0]["number"]),
        (&json!(2), &json!(1))
    );
    // The number of a deleted recipe is not proposed for teaching, so that undo can bring the
    // recipe back.
    assert_eq!(all["free"], 3);
    assert_eq!(browser.ask("DELETE", "/api/recipes/1", &[]).0, 404);
    assert_eq!(browser.ask("POST", "/api/recipes/1/undo", &[]).0, 200);
    assert_eq!(fs::read(place.recipe()).unwrap(), file);
    let changes = browser.get("/api/changes");
    let of = |at: usize| changes["changes"][at]["action"].clone();
    assert_eq!(
        (of(0), of(1)),
        (json!("undo recipe"), json!("delete recipe"))
    );
}

#[test]
fn the_plc_teaches_by_number_and_neither_names_nor_the_previous_generation_are_lost() {
    let place = Place::taught();
    let config = place.path("fringed.toml");
    let text = fs::read_to_string(&config).unwrap();
    fs::write(&config, format!("{text}[station]\nteach_allowed = true\n")).unwrap();
    let daemon = Daemon::start(&place);
    let mut browser = Browser::new(&daemon);
    browser.sign_in(&daemon);
    let edited = edit(&mut browser);
    let mut plc = Plc::connect(&daemon);
    // RECIPE_SELECT, then the edge.
    plc.write(2, &[1]);
    plc.write(0, &[ONLINE]);
    plc.write(0, &[TEACH]);
    browser.wait_for_another(&fingerprint(&edited));
    let row = listed(&mut browser, 1);
    assert_eq!(
        (&row["name"], &row["part_number"]),
        (&json!("bracket"), &json!("BR-1"))
    );
    assert_eq!(row["before"]["fingerprint"], edited["fingerprint"]);
}

#[test]
fn no_command_takes_a_recipe_from_under_a_station_and_each_says_how_it_is_done() {
    let place = Place::taught();
    let daemon = Daemon::start(&place);
    let taught = fs::read(place.recipe()).unwrap();
    for (command, code, page) in [
        (&["recipe", "delete", "1"][..], 69, "*Delete*"),
        (&["recipe", "undo", "1"][..], 69, "*Undo*"),
        (&["teach", "--number", "2"][..], 73, "*Teach*"),
    ] {
        let began = Instant::now();
        let run = run(&place, command);
        assert_eq!(run.code, code, "{command:?}: {}", run.stderr);
        assert!(
            run.stderr.contains(page) && run.stderr.contains("page"),
            "{}",
            run.stderr
        );
        assert!(began.elapsed() < PATIENCE);
    }
    assert_eq!(fs::read(place.recipe()).unwrap(), taught);
    assert_eq!(Plc::connect(&daemon).measure(1)[VERDICT], PASS);

    assert_eq!(daemon.terminate().code(), Some(0));
    let said = run(&place, &["recipe", "delete", "1"]).succeeded().stdout;
    assert!(said.contains("recipe undo 1"), "{said}");
    assert!(!place.recipe().exists());
    run(&place, &["recipe", "undo", "1"]).succeeded();
    assert_eq!(fs::read(place.recipe()).unwrap(), taught);
    assert_eq!(run(&place, &["recipe", "undo", "1"]).code, 66);
}

#[test]
fn the_command_teach_replaces_a_recipe_only_with_replace() {
    let place = Place::new();
    run(
        &place,
        &[
            "teach",
            "--number",
            "1",
            "--name",
            "bracket",
            "--tolerance",
            "0.5",
        ],
    )
    .succeeded();
    let first = fs::read(place.recipe()).unwrap();
    let refused = run(&place, &["teach", "--number", "1"]);
    assert_eq!(refused.code, 73, "{}", refused.stderr);
    for needle in ["bracket", "--replace", "number 2"] {
        assert!(
            refused.stderr.contains(needle),
            "{needle}: {}",
            refused.stderr
        );
    }
    assert_eq!(
        run(&place, &["teach", "--number", "1", "--keep-gauges"]).code,
        64
    );
    let missing = run(
        &place,
        &["teach", "--number", "2", "--replace", "--keep-gauges"],
    );
    assert_eq!(missing.code, 66, "{}", missing.stderr);
    assert_eq!(fs::read(place.recipe()).unwrap(), first);

    let keep = [
        "teach",
        "--number",
        "1",
        "--replace",
        "--keep-gauges",
        "--part-number",
        "BR-1",
    ];
    run(&place, &keep).succeeded();
    let list = run(&place, &["recipe", "list", "--json"])
        .succeeded()
        .stdout;
    let list: Value = serde_json::from_str(&list).unwrap();
    let row = &list["recipes"][0];
    assert_eq!(
        (&row["name"], &row["part_number"]),
        (&json!("bracket"), &json!("BR-1"))
    );
    assert_eq!(row["previous"], true);
    run(&place, &["recipe", "undo", "1"]).succeeded();
    assert_eq!(fs::read(place.recipe()).unwrap(), first);
}
