//! The other commands, and how all of them end.

use super::program::*;
use serde_json::Value;
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

/// Every file below a folder, with its content.
fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut all = BTreeMap::new();
    for part in ["recipes", "calibrations", "configurations", "heads"] {
        for entry in fs::read_dir(folder.join(part)).unwrap() {
            let entry = entry.unwrap();
            let name = format!("{part}/{}", entry.file_name().to_string_lossy());
            all.insert(name, fs::read(entry.path()).unwrap());
        }
    }
    all
}

#[test]
fn status_has_a_line_per_head() {
    let plant = Plant::of(3, &["--rate", "10", "--backlog", "30", "--results", "40"]);
    let nobody = "http://127.0.0.1:9/h/0099";
    let place = Place::new(&[&plant.heads(), nobody], "");
    let store = place.store();
    let _collector = place.collect(&store, &[]);
    let json = || {
        let output = ended(&["status", "--store", &store, "--json"]);
        serde_json::from_slice::<Vec<Value>>(&output.stdout).unwrap_or_default()
    };
    let is_known = |line: &Value| line["recipe"] == 1 && line["worst_gauge"]["cpk"].is_f64();
    wait("three heads", || {
        json().iter().filter(|line| is_known(line)).count() == 3
    });
    let lines = json();
    assert_eq!(lines.len(), 4);
    let head = lines
        .iter()
        .find(|line| line["serial"] == "SIM00002")
        .unwrap();
    assert_eq!(
        (&head["reachable"], &head["line"]),
        (&true.into(), &"one".into())
    );
    assert!(
        head["yield"].as_f64().unwrap() > 0.5 && head["drift_px"].is_f64(),
        "{head}"
    );
    assert!(
        head["seconds_since_result"].as_u64().unwrap() < 60,
        "{head}"
    );
    let silent = lines.iter().find(|line| line["url"] == nobody).unwrap();
    assert_eq!(silent["reachable"], false);

    let table = ended(&["status", "--store", &store]);
    let table = String::from_utf8(table.stdout).unwrap();
    assert_eq!(table.lines().count(), 5, "{table}");
    assert!(
        table.contains("SIM00003") && table.contains("no: connect"),
        "{table}"
    );
}

#[test]
fn a_backup_has_each_file_once_and_a_second_run_writes_none() {
    let plant = Plant::of(5, &[]);
    let folder = tempfile::tempdir().unwrap();
    let backup = || {
        let folder = folder.path().to_str().unwrap();
        let output = ended(&["backup", folder, "--heads", &plant.heads(), "--json"]);
        assert!(output.status.success(), "{output:?}");
        serde_json::from_slice::<Value>(&output.stdout).unwrap()
    };
    let first = backup();
    let written = files(folder.path());
    assert_eq!(first["files_written"], written.len());
    let of = |part: &str| written.keys().filter(|name| name.starts_with(part)).count();
    // The same two recipes are on all heads that have them; the other files are each head's own.
    assert_eq!((of("recipes"), of("heads")), (2, 5));
    assert_eq!((of("calibrations"), of("configurations")), (5, 5));
    let head: Value = serde_json::from_slice(&written["heads/SIM00004.json"]).unwrap();
    for recipe in head["recipes"].as_array().unwrap() {
        let name = format!("recipes/{}.recipe", recipe["fingerprint"].as_str().unwrap());
        assert!(written[&name].starts_with(b"PK"), "{name}");
    }
    let name = format!(
        "configurations/{}.toml",
        head["configuration"].as_str().unwrap()
    );
    assert!(String::from_utf8_lossy(&written[&name]).contains("Head 4"));

    assert_eq!(backup()["files_written"], 0);
    fs::remove_file(folder.path().join(&name)).unwrap();
    assert_eq!(backup()["files_written"], 1);
    assert_eq!(files(folder.path()), written);
}

#[test]
fn a_schema_makes_the_tables_and_views_that_it_names() {
    let output = ended(&["schema", "--store", "sqlite"]);
    let connection = rusqlite::Connection::open_in_memory().unwrap();
    connection
        .execute_batch(&String::from_utf8(output.stdout).unwrap())
        .unwrap();
    let names = "SELECT group_concat(name, ' ') FROM (SELECT name FROM sqlite_schema WHERE sql IS NOT NULL ORDER BY name)";
    let names: String = connection.query_row(names, (), |row| row.get(0)).unwrap();
    let expected = "gap gap_once gauge_day gauge_hour gauge_once head head_once result result_at result_head result_once yield_day yield_hour";
    assert_eq!(names, expected);
    let cluster = String::from_utf8(ended(&["schema", "--store", "cluster"]).stdout).unwrap();
    assert!(cluster.contains("Distributed(plant, plant, result_local, cityHash64(serial))"));
}

#[test]
fn a_command_that_cannot_be_carried_out_says_why_and_ends_with_its_code() {
    let place = Place::new(&["http://127.0.0.1:9"], "");
    let (config, nothing) = (place.file("fleet.toml"), place.file("none.toml"));
    fs::write(place.path("wrong.toml"), "poll = 1\n").unwrap();
    let wrong = place.file("wrong.toml");
    let folder = place.file("backup");
    let cases: [(&[&str], i32, &str); 8] = [
        (&["collect", "--part", "3/2"], 64, "2/3"),
        (&["collect", "--heads", "http://a"], 64, "no store is named"),
        (
            &["collect", "--store", "sqlite:x", "--config", &wrong],
            78,
            "poll",
        ),
        (&["collect", "--config", &nothing], 66, "none.toml"),
        (
            &["collect", "--config", &config, "--store", "mysql://a/b"],
            64,
            "mysql",
        ),
        (
            &["status", "--store", "http://127.0.0.1:9/plant"],
            69,
            "connect",
        ),
        (
            &["status", "--store", &place.store()],
            66,
            "run fringed-fleet collect",
        ),
        (
            &["backup", &folder, "--config", &config],
            69,
            "1 heads could not be asked",
        ),
    ];
    for (arguments, code, words) in cases {
        let output = ended(arguments);
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(code), "{arguments:?}: {said}");
        assert!(said.contains(words), "{arguments:?}: {said}");
    }
}
