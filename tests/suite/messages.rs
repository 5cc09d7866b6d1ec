//! What a stranger types first: each command does what the documentation says, or says what to
//! write instead.

use crate::station_plc::Place;
use crate::written::program;
use std::fs;
use std::path::Path;
use tests::program::Run;

/// Runs a command in this place.
fn run(place: &Place, arguments: &[&str]) -> Run {
    let config = place.path("fringed.toml");
    let mut all = arguments.to_vec();
    all.extend(["--config", config.to_str().unwrap()]);
    program().run(&all)
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

#[test]
fn what_is_recorded_with_a_recipe_is_measured_with_it() {
    let place = Place::new();
    run(&place, &["teach", "--number", "2"]).succeeded();
    let [file, recording, result] = ["2.recipe", "part-2", "result"].map(|name| place.path(name));
    run(&place, &["recipe", "export", "2", text(&file)]).succeeded();
    let refused = run(
        &place,
        &["record", "other", "--recipe", text(&file), "--levels", "2"],
    );
    assert_eq!(refused.code, 64, "{}", refused.stderr);
    run(
        &place,
        &["record", text(&recording), "--recipe", text(&file)],
    )
    .succeeded();
    let measured = program()
        .run(&[
            "measure",
            text(&recording),
            "--recipe",
            text(&file),
            "--out",
            text(&result),
        ])
        .succeeded();
    let heights = tests::files::array(&result.join("height.npy"));
    let known = heights.elements.iter().filter(|mm| mm.is_finite()).count();
    assert!(known > 1000, "{known}\n{}", measured.stdout);
}

#[test]
fn the_part_that_is_taught_is_chosen_on_the_command_line() {
    let place = Place::new();
    run(&place, &["teach", "--number", "3", "--part", "flowerpot"]).succeeded();
    let file = place.path("state/recipes/0003.recipe");
    let (_, flowerpot) = tests::files::recipe(&fs::read(&file).unwrap());
    run(&place, &["teach", "--number", "3", "--replace"]).succeeded();
    let (_, other) = tests::files::recipe(&fs::read(&file).unwrap());
    let resolved = |heights: &[f32]| heights.iter().filter(|mm| mm.is_finite()).count();
    assert_ne!(
        resolved(&flowerpot.golden_height),
        resolved(&other.golden_height)
    );
}

#[test]
fn an_address_without_a_port_is_refused_with_what_to_write() {
    let place = Place::new();
    let config = place.path("fringed.toml");
    let text = fs::read_to_string(&config).unwrap();
    for (section, key) in [
        ("modbus", "127.0.0.1"),
        ("http", "0.0.0.0"),
        ("http", "plc"),
    ] {
        fs::write(&config, format!("{text}[{section}]\nlisten = {key:?}\n")).unwrap();
        let run = program().run(&["serve", "--config", config.to_str().unwrap()]);
        assert_eq!(run.code, 78, "{}", run.stderr);
        for needle in [key, "write both, as 127.0.0.1:8080"] {
            assert!(run.stderr.contains(needle), "{}", run.stderr);
        }
        assert!(
            !run.stderr.contains("invalid socket address"),
            "{}",
            run.stderr
        );
    }
}
