//! The way of a user: the shipped program, a part as taught by default, and gauges set by file.

use crate::station_plc::Place;
use crate::written::program;
use serde_json::Value;
use std::fs;

/// The path of a file in a place.
fn at(place: &Place, name: &str) -> String {
    place.path(name).to_str().unwrap().to_owned()
}

/// A head with all pixels of the default one, in front of which this part lies.
fn whole_head(part: &str) -> Place {
    Place::before(part)
}

/// Teaches the part that the head of a place sees, with default settings.
fn taught(place: &Place, more: &[&str]) -> String {
    let (recipe, config) = (at(place, "1.recipe"), at(place, "fringed.toml"));
    let words = [
        "teach", "--number", "1", "--config", &config, "--out", &recipe,
    ];
    program().run(&[&words, more].concat()).succeeded();
    recipe
}

/// What is judged of what the head sees.
fn judged(place: &Place, recipe: &str, name: &str, more: &[&str]) -> Value {
    let (folder, config) = (at(place, name), at(place, "fringed.toml"));
    let words = ["record", &folder, "--recipe", recipe, "--config", &config];
    program().run(&[&words, more].concat()).succeeded();
    let state = at(place, "empty");
    let words = [
        "replay", &folder, "--recipe", recipe, "--state", &state, "--json",
    ];
    let answer = program().run(&words).succeeded().stdout;
    serde_json::from_str::<Value>(&answer).unwrap()["replayed"].clone()
}

/// The state of each circle.
fn circles(judged: &Value) -> Vec<&str> {
    let features = judged["features"].as_array().unwrap().iter();
    let circles = features.filter(|of| of["kind"] == "circle");
    circles.map(|of| of["state"].as_str().unwrap()).collect()
}

#[test]
fn holes_of_the_stock_part_are_circles_by_default_and_a_closed_one_is_absent() {
    let place = whole_head("");
    let recipe = taught(&place, &["--part", "sheet_metal"]);
    let lies = ["--shift", "0.3,-0.4,0.2", "--rotate", "0.2"];
    let good = judged(&place, &recipe, "good", &lies);
    assert_eq!(good["verdict"], "PASS", "{good}");
    assert_eq!(circles(&good), ["found"; 3]);
    let defect = ["--part", "sheet_metal", "--defect", "missing_hole:1"];
    let closed = judged(&place, &recipe, "closed", &[&defect[..], &lies].concat());
    assert_eq!(closed["verdict"], "FAIL", "{closed}");
    let mut states = circles(&closed);
    states.sort_unstable();
    assert_eq!(states, ["absent", "found", "found"]);
    let gauges = closed["gauges"].as_array().unwrap();
    let found = gauges.iter().filter(|of| of["kind"] == "found");
    assert_eq!(
        found.filter(|of| of["value"] == 0.0).count(),
        1,
        "{gauges:?}"
    );
}

#[test]
fn gauges_of_a_plate_that_are_set_by_file_read_what_the_plate_has() {
    let place = whole_head("[part]\nkind = \"plate\"\n");
    let recipe = taught(&place, &["--tolerance", "5"]);
    let text = program().run(&["recipe", "gauges", &recipe, "--get"]);
    let text = text.succeeded().stdout;
    // The large hole is the second largest opening, the small ones follow.
    let (_, from) = text.split_once("name = \"opening 2\"").unwrap();
    assert!(from.starts_with("\nkind = \"circle\""), "{text}");
    let more = r#"
[[gauge]]
slot = 20
name = "diameter"
kind = "diameter"
of = ["opening 2"]
golden = true
plus = 0.05
minus = 0.05

[[gauge]]
slot = 64
name = "apart"
kind = "distance"
of = ["opening 3", "opening 4"]
nominal = 80.0
plus = 0.05
minus = 0.05
"#;
    let file = at(&place, "gauges.toml");
    // Where nobody says that the rims are sharp, limits of 0.05 mm are too close.
    let sharp = text.replace("kind = \"circle\"", "kind = \"circle\"\nrim_mm = 0.0");
    fs::write(&file, sharp + more).unwrap();
    program()
        .run(&["recipe", "gauges", &recipe, "--set", &file])
        .succeeded();
    let lies = [
        "--shift",
        "0.8,-0.6,0.3",
        "--tilt",
        "0.5,-0.7",
        "--rotate",
        "0.8",
    ];
    let found = judged(&place, &recipe, "displaced", &lies);
    assert_eq!(found["verdict"], "PASS", "{found}");
    let value = |slot: u64| {
        let gauges = found["gauges"].as_array().unwrap();
        let gauge = gauges.iter().find(|of| of["slot"] == slot).unwrap();
        gauge["value"].as_f64().unwrap()
    };
    assert!((value(20) - 22.0).abs() < 0.01, "{}", value(20));
    assert!((value(64) - 80.0).abs() < 0.01, "{}", value(64));
}
