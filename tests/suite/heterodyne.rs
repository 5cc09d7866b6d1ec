//! A recipe from a golden recording whose levels are unwrapped by beats: it is imported, and judges
//! recordings.

use crate::page::Browser;
use crate::station_plc::{Daemon, Place};
use crate::written::{laboratory, program};
use hal::replay::recorder;
use serde_json::{Value, json};
use std::fs;
use tests::render::{Scene, levels};
use tests::{files, shared};

/// The result of a trigger on the page.
fn judged(daemon: &Daemon) -> Value {
    let mut browser = Browser::new(daemon);
    browser.sign_in(daemon);
    browser.ready();
    browser.measure()
}

/// Teaches the recording `r` of a place, imports the recipe into a station that plays it, and
/// judges it.
fn taught_and_judged(place: &Place) {
    let at = |name: &str| place.path(name).to_str().unwrap().to_owned();
    let config = "state = \"state\"\n[head]\nbackend = \"replay\"\nrecordings = [\"r\"]\n";
    fs::write(place.path("fringed.toml"), config).unwrap();
    let (recipe, recording, config) = (at("1.recipe"), at("r"), at("fringed.toml"));
    let teach = [
        "teach", "--number", "1", "--golden", &recording, "--out", &recipe,
    ];
    let run = program().run(&teach).succeeded();
    assert!(run.stdout.contains("by beats"), "{}", run.stdout);
    let import = ["recipe", "import", &recipe, "--config", &config];
    program().run(&import).succeeded();
    let measure = [
        "measure",
        &recording,
        "--recipe",
        &recipe,
        "--out",
        &at("m"),
    ];
    program().run(&measure).succeeded();
    assert_eq!(files::report(&place.path("m"))["kind"], "heterodyne");
    let daemon = Daemon::start(place);
    let result = judged(&daemon);
    assert_eq!(result["verdict"], "PASS", "{result}");
}

#[test]
fn a_golden_of_heterodyne_levels_becomes_a_recipe_that_is_imported_and_judges() {
    let place = Place::new();
    let scene = Scene {
        patches: false,
        noise: 0.005,
        ..Scene::new(35.0, levels(&[29.5 / 35.0, 32.0 / 35.0, 1.0], 4))
    };
    let mut recording = scene.record();
    recording.noise_counts = Some(1.0);
    recorder::write(&recording, &place.path("r")).unwrap();
    taught_and_judged(&place);
}

/// Levels of 59, 64 and 70 fringes (`52-heterodyne-golden`).
#[test]
fn the_case_of_a_heterodyne_golden_is_taught_imported_and_judged() {
    let Some(case) = shared::case("52-heterodyne-golden") else {
        return;
    };
    let place = Place::new();
    let text = |name: &str| case.join(name).to_str().unwrap().to_owned();
    let recording = place.path("r").to_str().unwrap().to_owned();
    let mut import = ["import".to_owned(), text("good"), "--out".into(), recording].to_vec();
    let options = "--projector 640x400 --fringes 59,64,70 --steps 4 --unit mm";
    import.extend(options.split(' ').map(str::to_owned));
    for (option, file) in [
        ("--camera-model", "camera.yml"),
        ("--projector-model", "projector.yml"),
    ] {
        import.extend([option.to_owned(), text(file)]);
    }
    laboratory().run(&import).succeeded();
    let manifest = place.path("r/recording.json");
    let mut known: Value = serde_json::from_slice(&fs::read(&manifest).unwrap()).unwrap();
    known["camera"]["noise_counts"] = json!(1.0);
    fs::write(&manifest, known.to_string()).unwrap();
    taught_and_judged(&place);
}
