//! The command line: what each command prints, and its exit code if it fails.

use crate::station_plc::{Daemon, Place};
use crate::written::{FRINGED, laboratory, program};
use serde_json::Value;
use std::fs;
use std::net::TcpListener;
use std::path::Path;
use tests::program::{Program, Run};

/// A measured error may exceed the prediction by this factor: the prediction includes the noise,
/// but not that a pixel averages over a slope.
const OVER_PREDICTION: f64 = 1.2;

fn run(arguments: &[&str]) -> Run {
    program().run(arguments)
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// Checks the exit code, and that the message contains each of `words`.
fn check_refused(run: &Run, code: i32, words: &[&str]) {
    assert_eq!(run.code, code, "{}", run.stderr);
    for word in words {
        assert!(run.stderr.contains(word), "{word:?} in {}", run.stderr);
    }
    assert_eq!(run.stdout, "");
}

#[test]
fn the_demonstration_finds_exactly_the_defective_parts() {
    // Its own state folder, where another version of the program has taught the part.
    let folder = tempfile::tempdir().unwrap();
    let recipes = folder.path().join("fringed/demo/recipes");
    fs::create_dir_all(&recipes).unwrap();
    fs::write(recipes.join("0001.recipe"), "not of this version").unwrap();
    let home = format!("XDG_STATE_HOME={}", text(folder.path()));
    let address = "127.0.0.1:0";
    let run = Program::at("env").run(&[
        &home, FRINGED, "demo", "--exit", "--json", "--quiet", "--modbus", address, "--http",
        address,
    ]);
    assert_eq!(run.code, 0, "{}", run.stderr);
    let rows: Value = serde_json::from_str(&run.stdout).unwrap();
    let rows = rows.as_array().unwrap();
    let verdicts: Vec<_> = rows
        .iter()
        .map(|row| {
            (
                row["placed"].as_str().unwrap(),
                row["verdict"].as_str().unwrap(),
            )
        })
        .collect();
    assert_eq!(verdicts.len(), 10);
    let defective = verdicts.iter().filter(|(placed, _)| *placed != "good");
    assert_eq!(defective.count(), 3);
    for (placed, verdict) in verdicts {
        // A bent part was not moved: INVALID would make somebody place it again.
        let expected = if placed == "good" { "PASS" } else { "FAIL" };
        assert_eq!(verdict, expected, "{placed}");
    }
    let numbers: Vec<_> = rows
        .iter()
        .map(|row| row["seq"].as_u64().unwrap())
        .collect();
    assert_eq!(numbers, (1..=10).collect::<Vec<_>>());
}

#[test]
fn what_is_recorded_is_measured_with_the_predicted_error() {
    let place = Place::new();
    let (recording, out) = (place.path("recording"), place.path("out"));
    let config = place.path("fringed.toml");
    let recorded = run(&["record", text(&recording), "--config", text(&config)]).succeeded();
    assert!(recorded.stdout.contains("12 frames"), "{}", recorded.stdout);
    let measured = run(&["measure", text(&recording), "--out", text(&out), "--json"]).succeeded();
    let report: Value = serde_json::from_str(&measured.stdout).unwrap();
    let score = &report["score"];
    let (rms, predicted) = (
        score["rms_mm"].as_f64().unwrap(),
        report["sigma_mm"].as_f64().unwrap(),
    );
    assert!(
        rms <= OVER_PREDICTION * predicted,
        "{rms} against {predicted}"
    );
    assert_eq!(score["gross"], 0);
    assert!(score["scored"].as_u64().unwrap() > 5_000, "{score}");
    // A recording is never overwritten.
    let again = run(&["record", text(&recording), "--config", text(&config)]);
    check_refused(&again, 73, &["recording"]);
}

#[test]
fn the_register_map_is_the_same_as_csv_and_as_json() {
    let csv = run(&["registers"]).succeeded().stdout;
    let json = run(&["registers", "--json"]).succeeded().stdout;
    let json: Value = serde_json::from_str(&json).unwrap();
    let keys: Vec<&str> = csv.lines().next().unwrap().split(',').collect();
    let rows = json["registers"].as_array().unwrap();
    assert_eq!(rows.len(), csv.lines().count() - 1);
    for (line, row) in csv.lines().skip(1).zip(rows) {
        // The last column is quoted, and only it may contain commas.
        let cells: Vec<&str> = line.splitn(keys.len(), ',').collect();
        for (key, cell) in keys.iter().zip(cells) {
            let value = match &row[key] {
                Value::Bool(true) => "yes".into(),
                Value::Bool(false) => "later".into(),
                Value::String(text) => text.clone(),
                other => other.to_string(),
            };
            assert_eq!(
                value,
                cell.trim_matches('"').replace("\"\"", "\""),
                "{line}"
            );
        }
    }
}

#[test]
fn a_wrong_configuration_is_refused_by_key_and_a_missing_one_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("fringed.toml");
    let check = |content: &str| {
        fs::write(&file, content).unwrap();
        run(&["config", "check", text(&file)])
    };
    assert_eq!(check("threads = 2\n").succeeded().stdout.lines().count(), 1);
    for (content, word) in [
        ("threats = 2\n", "threats"),
        ("threads = 2000\n", "0 to 256"),
        ("[modbus]\nlisten = \"here\"\n", "listen"),
        ("[head]\nbackend = \"replay\"\n", "head.recordings"),
    ] {
        check_refused(&check(content), 78, &["fringed.toml", word]);
    }
    for (content, word) in [
        ("[head]\nscenario = \"none.toml\"\n", "none.toml"),
        (
            "[head]\nbackend = \"replay\"\nrecordings = [\"none\"]\n",
            "none",
        ),
    ] {
        check_refused(&check(content), 66, &[word]);
    }
    let missing = folder.path().join("missing.toml");
    for arguments in [
        ["config", "check", text(&missing)],
        ["serve", "--config", text(&missing)],
    ] {
        check_refused(&run(&arguments), 66, &["missing.toml"]);
    }
}

#[test]
fn a_broken_scenario_is_refused_by_key_by_every_command_that_opens_the_head() {
    let place = Place::new();
    let (config, recording) = (place.path("fringed.toml"), place.path("recording"));
    for (content, word) in [
        ("sub_rays = 99\n", "sub_rays"),
        ("[rig.camera]\nwidths = 5\n", "widths"),
        ("[part]\nkind = \"teapot\"\n", "teapot"),
        ("= 5\n", "TOML"),
    ] {
        fs::write(place.path("small.toml"), content).unwrap();
        for command in [
            vec!["config", "check", text(&config)],
            vec!["record", text(&recording), "--config", text(&config)],
            vec![
                "serve",
                "--config",
                text(&config),
                "--modbus",
                "127.0.0.1:0",
                "--http",
                "127.0.0.1:0",
            ],
        ] {
            check_refused(&run(&command), 78, &["small.toml", word]);
        }
    }
    assert!(!recording.exists());
}

#[test]
fn a_port_in_use_ends_the_start_and_is_named() {
    let place = Place::new();
    let config = place.path("fringed.toml");
    let taken = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = taken.local_addr().unwrap().to_string();
    for [modbus, http] in [[&*address, "127.0.0.1:0"], ["127.0.0.1:0", &*address]] {
        let run = run(&[
            "serve",
            "--config",
            text(&config),
            "--modbus",
            modbus,
            "--http",
            http,
        ]);
        check_refused(&run, 69, &[&address]);
    }
}

#[test]
fn a_state_folder_that_cannot_be_used_ends_the_start_and_is_named() {
    let place = Place::new();
    let (config, state) = (place.path("fringed.toml"), place.path("state"));
    let serve = || {
        run(&[
            "serve",
            "--config",
            text(&config),
            "--modbus",
            "127.0.0.1:0",
            "--http",
            "127.0.0.1:0",
        ])
    };
    fs::write(&state, "a file in its place").unwrap();
    check_refused(&serve(), 73, &[text(&state), "--state"]);
    fs::remove_file(&state).unwrap();
    let daemon = Daemon::start(&place);
    check_refused(&serve(), 73, &[text(&state), "another fringed"]);
    drop(daemon);
}

#[test]
fn what_cannot_be_asked_for_is_usage() {
    for arguments in [
        &["measures"][..],
        &["measure"],
        &["measure", "a-recording"],
        &["record", "a-recording", "--steps", "2"],
        &["serve", "--modbus", "here"],
        &["config", "check"],
        &["demo", "--parts", "3"],
    ] {
        check_refused(&run(arguments), 64, &[]);
    }
    for arguments in [["--help"], ["--version"]] {
        assert!(run(&arguments).succeeded().stdout.contains("fringed"));
    }
}

#[test]
fn an_option_that_means_nothing_to_a_command_is_refused_by_its_name() {
    for (arguments, option) in [
        (
            &["measure", "r", "--out", "x", "--modbus", "127.0.0.1:0"][..],
            "--modbus",
        ),
        (&["--http", "127.0.0.1:0", "doctor"], "--http"),
        (&["registers", "--quiet"], "--quiet"),
        (&["history", "--threads", "2"], "--threads"),
        (&["recipe", "delete", "2", "--json"], "--json"),
        (&["serve", "--json"], "--json"),
        (&["--json"], "--json"),
    ] {
        let run = run(arguments);
        check_refused(&run, 64, &["unexpected argument", option, "Usage: fringed"]);
    }
}

#[test]
fn options_are_read_in_front_of_the_command_and_behind_it() {
    let place = Place::new();
    let (config, state) = (place.path("fringed.toml"), place.path("elsewhere"));
    for arguments in [
        [
            "--config",
            text(&config),
            "--state",
            text(&state),
            "recipe",
            "list",
            "--json",
        ],
        [
            "--json",
            "recipe",
            "--config",
            text(&config),
            "list",
            "--state",
            text(&state),
        ],
        [
            "recipe",
            "list",
            "--json",
            "--state",
            text(&state),
            "--config",
            text(&config),
        ],
    ] {
        let listed = run(&arguments).succeeded().stdout;
        let listed: Value = serde_json::from_str(&listed).unwrap();
        assert_eq!(listed, serde_json::json!({ "recipes": [] }));
        fs::remove_dir_all(&state).unwrap();
    }
}

#[test]
fn json_is_one_document_also_where_something_is_wrong() {
    let place = Place::new();
    let config = place.path("fringed.toml");
    let document = |run: &Run| -> Value {
        serde_json::from_str(&run.stdout).unwrap_or_else(|error| panic!("{error}: {}", run.stdout))
    };
    let checked = run(&["config", "check", text(&config), "--json"]).succeeded();
    let expected = serde_json::json!({ "file": text(&config), "valid": true, "problem": null });
    assert_eq!(document(&checked), expected);
    assert!(document(&run(&["config", "keys", "--json"])).is_array());
    fs::write(&config, "threats = 2\n").unwrap();
    let wrong = run(&["config", "check", text(&config), "--json"]);
    assert_eq!(wrong.code, 78);
    let told = document(&wrong);
    assert_eq!(told["valid"], false);
    assert!(
        told["problem"].as_str().unwrap().contains("threats"),
        "{told}"
    );
    assert!(wrong.stderr.contains("threats"), "{}", wrong.stderr);
}

#[test]
fn the_completions_of_each_shell_know_every_command() {
    for program in [program(), laboratory()] {
        let help = program.run(&["--help"]).succeeded().stdout;
        let (_, commands) = help.split_once("\nCommands:\n").unwrap();
        let (commands, _) = commands.split_once("\n\n").unwrap();
        for shell in ["bash", "zsh", "fish"] {
            let script = program.run(&["completions", shell]).succeeded().stdout;
            for command in commands
                .lines()
                .filter_map(|line| line.split_whitespace().next())
            {
                assert!(script.contains(command), "{shell} does not know {command}");
            }
        }
    }
    check_refused(&run(&["completions", "dos"]), 64, &["zsh"]);
}

#[test]
fn benchmarks_and_experiments_are_commands_of_another_program() {
    for (arguments, remedy) in [
        (&["bench", "kernel", "--json"][..], "fringed-lab bench"),
        (&["--quiet", "bench"], "fringed-lab bench"),
        (
            &["experiment", "--part", "cone", "--out", "x"],
            "fringed-lab experiment",
        ),
        (&["help", "experiment"], "fringed-lab experiment"),
    ] {
        check_refused(&run(arguments), 64, &[remedy]);
    }
}

#[test]
fn the_workbench_is_of_another_program() {
    let help = run(&["--help"]).succeeded().stdout;
    for command in ["adapt", "capture", "import", "patterns"] {
        let remedy = format!("fringed-lab {command}");
        for arguments in [
            &[command][..],
            &[command, "--help"],
            &[command, "a", "b", "--no-such-option", "--steps=4"],
            &["--config", "c.toml", command, "a"],
            &["help", command],
        ] {
            check_refused(&run(arguments), 64, &[&remedy]);
        }
        let listed = |line: &str| line.trim_start().starts_with(&format!("{command} "));
        assert!(!help.lines().any(listed), "{help}");
        laboratory().run(&[command, "--help"]).succeeded();
    }
}

#[test]
fn a_pattern_is_not_written_under_the_name_of_a_picture() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("x.png");
    let run = laboratory().run(&[
        "adapt",
        "a-recording",
        "--method",
        "fringed",
        "--out",
        text(&out),
    ]);
    check_refused(&run, 64, &["x.png", ".npy"]);
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[test]
fn quiet_says_nothing() {
    let place = Place::new();
    let config = place.path("fringed.toml");
    let (recording, out) = (place.path("recording"), place.path("out"));
    let (config, recording, out) = (text(&config), text(&recording), text(&out));
    for arguments in [
        &["record", recording, "--config", config, "--quiet"][..],
        &["measure", recording, "--out", out, "--quiet"],
        &["config", "check", config, "--quiet"],
    ] {
        let run = run(arguments).succeeded();
        assert_eq!((run.stdout, run.stderr), (String::new(), String::new()));
    }
}
