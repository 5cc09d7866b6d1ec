//! Rules that are read from the project's files: which code may import which, how long files are,
//! what documents name. Each test fails with the text of its rule.

use std::fs;
use std::path::Path;
use tests::files;
use tests::imports::{circles, upwards};
use tests::shared::root;

/// Longest file, in lines without tests. Files have 100–300 lines and one concept each; at this
/// length a file clearly has two.
const MAX_LINES: usize = 450;

/// A source file: its path from the root, and its text.
struct Source {
    name: String,
    text: String,
}

/// All Rust files below a folder of the project; empty if there is no such folder.
fn sources(folder: &str) -> Vec<Source> {
    let mut all = Vec::new();
    collect(&root().join(folder), &mut all);
    // A module may be a file beside its folder.
    collect_file(&root().join(format!("{folder}.rs")), &mut all);
    all
}

fn collect(folder: &Path, all: &mut Vec<Source>) {
    for name in files::names(folder) {
        let path = folder.join(name);
        if path.is_dir() {
            collect(&path, all);
        } else {
            collect_file(&path, all);
        }
    }
}

fn collect_file(path: &Path, all: &mut Vec<Source>) {
    if path.extension().is_some_and(|e| e == "rs") && path.is_file() {
        let name = path.strip_prefix(root()).unwrap().display().to_string();
        let text = fs::read_to_string(path).unwrap();
        all.push(Source { name, text });
    }
}

/// The numbered lines of a text without comments.
fn code(text: &str) -> impl Iterator<Item = (usize, &str)> {
    (1..)
        .zip(text.lines())
        .map(|(line, text)| (line, text.split("//").next().unwrap_or_default()))
}

/// Whether a line of code contains a path that starts with `path`, as a word.
fn names(line: &str, path: &str) -> bool {
    line.match_indices(path).any(|(at, _)| {
        let before = line[..at].chars().next_back();
        !before.is_some_and(|c| c.is_alphanumeric() || c == '_' || c == ':')
    })
}

/// Fails with `rule` if the code of a file below `folder` contains one of `paths`.
fn forbid(rule: &str, folder: &str, paths: &[&str]) {
    let mut broken = Vec::new();
    for source in sources(folder) {
        for (line, text) in code(&source.text) {
            if let Some(path) = paths.iter().find(|path| names(text, path)) {
                broken.push(format!("{}:{line} names {path}", source.name));
            }
        }
    }
    assert!(broken.is_empty(), "{rule}\n{}", broken.join("\n"));
}

/// The names of a package's dependencies, without those of its tests.
fn dependencies(package: &str) -> Vec<String> {
    let text = fs::read_to_string(root().join(package).join("Cargo.toml")).unwrap();
    let mut inside = false;
    let mut found = Vec::new();
    for line in text.lines() {
        if line.starts_with('[') {
            inside = line == "[dependencies]" || line.starts_with("[target.");
        } else if inside && let Some((name, _)) = line.split_once(['.', '=', ' ']) {
            found.push(name.trim().to_owned());
        }
    }
    found
}

/// Fails with `rule` if a package depends on one of `packages`.
fn forbid_dependency(rule: &str, package: &str, packages: &[&str]) {
    let dependencies = dependencies(package);
    assert!(!dependencies.is_empty(), "{package} has no dependencies?");
    for other in packages {
        assert!(
            !dependencies.iter().any(|name| name == other),
            "{rule}\n{package}/Cargo.toml depends on {other}"
        );
    }
}

#[test]
fn algo_knows_neither_devices_nor_the_daemon_nor_the_outside_world() {
    let rule = "algo is a function of its input: no I/O, clock, threads of its own, environment, \
                randomness or global state, and it does not know hal, sim or appliance.";
    let outside = [
        "hal::",
        "sim::",
        "appliance::",
        "std::fs",
        "std::io",
        "std::net",
        "std::env",
        "std::process",
        "std::time",
        "std::thread",
        "std::sync",
        "println!",
        "eprintln!",
        "static mut",
        "OnceLock",
        "LazyLock",
        "thread_local!",
    ];
    forbid(rule, "algo/src", &outside);
    forbid_dependency(
        rule,
        "algo",
        &[
            "hal",
            "sim",
            "appliance",
            "tests",
            "rand_xoshiro",
            "getrandom",
        ],
    );
    let text = fs::read_to_string(root().join("algo/src/lib.rs")).unwrap();
    assert!(text.contains("#![no_std]"), "{rule}\nalgo must be no_std");
}

#[test]
fn hal_knows_neither_the_computation_nor_the_daemon() {
    let rule = "Two leaf crates that do not know each other: algo (pure computation) and hal \
                (devices). appliance joins them. The simulator knows hal, and hal does not know it.";
    forbid(rule, "hal/src", &["algo::", "appliance::", "sim::"]);
    forbid_dependency(rule, "hal", &["algo", "appliance", "sim", "tests"]);
}

#[test]
fn the_simulator_does_not_know_how_fringes_are_decoded() {
    let rule = "The simulator models light, not phase: it knows surfaces, optics and noise, never how \
                fringes are decoded, and imports nothing from algo or appliance.";
    forbid(rule, "hal/sim/src", &["algo", "appliance"]);
    forbid_dependency(rule, "hal/sim", &["algo", "appliance", "tests"]);
}

#[test]
fn the_oracle_shares_no_code_with_what_it_judges() {
    let rule = "The f64 textbook oracle judges algo without sharing its mistakes: it imports nothing \
                from algo or appliance, and nothing of the simulator.";
    let judged = ["algo::", "appliance::", "sim::", "libm::"];
    forbid(rule, "tests/scenes/src/oracle", &judged);
    forbid(rule, "tests/scenes/src/render", &judged);
}

#[test]
fn the_collector_of_a_plant_knows_formats_of_the_daemon_and_none_of_its_types() {
    let rule = "fringed-fleet reads what heads answer, as any other program would: it shares no type with \
                what measures, so that a plant's programs and its heads change at different times.";
    let measuring = ["appliance", "algo", "hal", "sim", "tests"];
    forbid(
        rule,
        "appliance/fleet/src",
        &measuring
            .map(|name| [name, "::"].concat())
            .each_ref()
            .map(String::as_str),
    );
    forbid_dependency(rule, "appliance/fleet", &measuring);
    forbid_dependency(rule, "appliance", &["fringed-fleet"]);
}

#[test]
fn modbus_and_web_see_only_the_snapshot() {
    let rule = "modbus and web see only Snapshot, never each other, never algo, hal or sim.";
    let ours = ["algo::", "hal::", "sim::"];
    for (folder, other) in [
        ("appliance/src/modbus", ["crate::web", "super::web"]),
        ("appliance/src/web", ["crate::modbus", "super::modbus"]),
    ] {
        forbid(rule, folder, &ours);
        forbid(rule, folder, &other);
    }
}

#[test]
fn the_stations_decisions_are_pure() {
    let rule = "The station's decisions are a pure state machine: (state, event, now) → (state, \
                effects). It gets time as an argument; threads and sockets only carry out effects.";
    let outside = [
        "std::fs",
        "std::net",
        "std::thread",
        "Instant::now",
        "SystemTime::now",
        "tokio::",
        "hal::",
        "sim::",
    ];
    // The handle connects the decisions to the clock and the sockets.
    let parts = files::names(&root().join("appliance/src/station"));
    for part in parts.iter().map(|name| name.trim_end_matches(".rs")) {
        if part != "handle" {
            forbid(rule, &format!("appliance/src/station/{part}"), &outside);
        }
    }
}

#[test]
fn imports_inside_algo_only_go_backwards_along_the_flow() {
    let rule = "Imports only go backwards along the flow: units, trust, math ← simd ← frame ← pattern, \
                phase ← geometry ← pipeline ← calibration, chain, flicker, inspect ← adaptive.";
    let order = [
        &["units", "trust", "math"][..],
        &["simd"],
        &["frame"],
        &["pattern", "phase"],
        &["geometry"],
        &["pipeline"],
        &["calibration", "chain", "flicker", "inspect"],
        &["adaptive"],
    ];
    only_backwards(rule, "algo/src", "crate", &order);
}

#[test]
fn the_stages_of_an_inspection_import_only_what_lies_before_them() {
    let rule = "algo/src/inspect/strips has a folder for each stage, in their order: golden ← measure \
                ← align ← pair ← accumulate ← readings ← production.";
    let order = [
        &["golden"][..],
        &["measure"],
        &["align"],
        &["pair"],
        &["accumulate"],
        &["readings"],
        &["production"],
    ];
    let strips = "crate::inspect::strips";
    only_backwards(rule, "algo/src/inspect/strips", strips, &order);
}

#[test]
fn the_folders_of_a_recipe_import_only_what_lies_before_them() {
    let rule = "appliance/src/recipe, in this order: file ← shown ← plan ← store ← teach ← edit.";
    let order = [
        &["file"][..],
        &["shown"],
        &["plan"],
        &["store"],
        &["teach"],
        &["edit"],
    ];
    only_backwards(rule, "appliance/src/recipe", "crate::recipe", &order);
}

/// Fails where a module below `folder`, whose path in the code is `path`, names one of a later line.
fn only_backwards(rule: &str, folder: &str, path: &str, order: &[&[&str]]) {
    for (at, here) in order.iter().enumerate() {
        let later: Vec<String> = order[at + 1..]
            .concat()
            .iter()
            .map(|module| format!("{path}::{module}"))
            .collect();
        for module in *here {
            let later: Vec<&str> = later.iter().map(String::as_str).collect();
            forbid(rule, &format!("{folder}/{module}"), &later);
        }
    }
}

#[test]
fn no_files_name_each_other_in_a_circle() {
    let rule = "No circles of files: what two files need of each other goes to a third (mostly a small one of \
                types and bounds), or a method to the file that calls it. What a mod.rs re-exports counts as \
                the file's that has it; what files name of a module above them does not count.";
    let mut found = Vec::new();
    for folder in [
        "algo/src",
        "hal/src",
        "hal/sim/src",
        "appliance/src",
        "appliance/fleet/src",
        "appliance/lab/src",
        "tests/scenes/src",
        "tests/src",
    ] {
        let circles = circles(&files_of(folder));
        found.extend(circles.iter().map(|circle| format!("{folder}:\n{circle}")));
    }
    assert!(found.is_empty(), "{rule}\n{}", found.join("\n\n"));
}

#[test]
fn no_file_of_inspect_names_an_item_of_a_module_that_it_lies_in() {
    let rule = "algo/src/inspect is stages with a plan of their own. A file names its siblings, what lies \
                in them, and other folders; never an item of a module that it lies in itself, whether \
                defined or only re-exported there, by super:: or by crate::. What several files share \
                has a file of its own; a mod.rs lists its parts and is the facade for those outside.";
    let broken = upwards(&files_of("algo/src"), "inspect");
    assert!(broken.is_empty(), "{rule}\n{}", broken.join("\n"));
}

/// The files of a crate without those of tests: their paths below its folder, and their texts.
pub fn files_of(folder: &str) -> Vec<(String, String)> {
    let own = sources(folder).into_iter();
    // A program beside a library is a crate of its own.
    let own = own.filter(|source| !is_of_tests(source) && !source.name.ends_with("/main.rs"));
    own.map(|source| (source.name[folder.len() + 1..].to_owned(), source.text))
        .collect()
}

/// Whether a file has nothing but tests.
fn is_of_tests(source: &Source) -> bool {
    source.name.ends_with("tests.rs") || source.name.contains("/tests/")
}

/// Number of lines before the tests of a file.
fn untested_lines(source: &Source) -> usize {
    if is_of_tests(source) {
        return 0;
    }
    let lines = source.text.lines();
    lines
        .take_while(|line| !line.starts_with("#[cfg(test)]"))
        .count()
}

#[test]
fn a_module_with_parts_is_a_folder_with_a_mod_rs() {
    let rule = "One module style: x/mod.rs, never x.rs beside x/.";
    for folder in ["algo", "appliance", "hal", "tests"] {
        for source in sources(folder) {
            let parts = root().join(source.name.trim_end_matches(".rs"));
            assert!(!parts.is_dir(), "{rule}\n{}", source.name);
        }
    }
}

#[test]
fn files_hold_one_concept_each_and_say_which() {
    let rule = format!("Files of 100–300 lines, one concept each; {MAX_LINES} is too much.");
    let headed = "Each file opens with a module doc whose first line says what it does.";
    let mut seen = 0;
    for folder in [
        "algo/src",
        "hal/src",
        "hal/sim/src",
        "appliance/src",
        "appliance/fleet/src",
        "appliance/lab/src",
        "tests/scenes/src",
        "tests/src",
        "tests/suite",
    ] {
        for source in sources(folder) {
            let lines = untested_lines(&source);
            assert!(lines <= MAX_LINES, "{rule}\n{} has {lines}", source.name);
            assert!(source.text.starts_with("//! "), "{headed}\n{}", source.name);
            seen += 1;
        }
    }
    assert!(seen > 50, "{seen} files");
}

#[test]
fn no_path_of_a_machine_stands_in_the_code() {
    let rule = "No machine paths in code: files are found from the workspace or from an option.";
    // In two parts, so this file does not break its own rule.
    let paths = [
        concat!("/wor", "k/"),
        concat!("/ho", "me/"),
        concat!("/Use", "rs/"),
    ];
    for folder in ["algo", "hal", "appliance", "tests"] {
        for source in sources(folder) {
            for path in paths {
                assert!(
                    !source.text.contains(path),
                    "{rule}\n{}: {path}",
                    source.name
                );
            }
        }
    }
}

#[test]
fn a_rule_that_is_broken_is_found() {
    assert!(names("use algo::units::Height;", "algo::"));
    assert!(names("    let z = algo::math::atan();", "algo::"));
    assert!(names("(hal::Frame, u8)", "hal::"));
    assert!(!names("use crate::algo::units;", "algo::"));
    assert!(!names("use shal::x;", "hal::"));
    let lines: Vec<_> = code("let a = 1; // algo::x\n/// hal::y\n").collect();
    assert!(
        lines
            .iter()
            .all(|(_, text)| !names(text, "algo::") && !names(text, "hal::"))
    );
    assert!(dependencies("appliance").contains(&"algo".to_owned()));
    assert!(sources("algo/src").len() > 15);
}

#[test]
fn documentation_has_examples_only_where_cargo_test_runs_them() {
    for source in ["appliance", "hal", "tests"].into_iter().flat_map(sources) {
        let comments = source
            .text
            .lines()
            .filter_map(|line| line.trim().strip_prefix("//"));
        let fences = comments
            .filter_map(|text| text.trim_start_matches(['/', '!', ' ']).strip_prefix("```"));
        for language in fences.step_by(2) {
            let name = &source.name;
            assert_eq!(
                language, "text",
                "{name}: its crate has `doctest = false` in Cargo.toml"
            );
        }
    }
}
