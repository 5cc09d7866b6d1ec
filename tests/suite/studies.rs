//! Studies by the shipped program, of files and of stored results.

use crate::history::reader;
use crate::station_plc::Place;
use crate::written::program;
use appliance::history::{Entry, GaugeEntry, Writer};
use appliance::station::Verdict;
use serde_json::{Value, json};
use std::fmt::Write as _;
use std::fs;
use std::time::Instant;
use tests::random::Random;

/// The figures that a study of a file prints as JSON.
pub(crate) fn studies(place: &Place, arguments: &[&str]) -> Vec<Value> {
    let state = place.path("state");
    let mut all = vec!["study"];
    all.extend(arguments);
    if arguments[0] == "process" {
        all.extend(["--state", state.to_str().unwrap()]);
    }
    all.push("--json");
    let run = program().run(&all).succeeded();
    let answer: Value = serde_json::from_str(&run.stdout).unwrap();
    answer["studies"].as_array().unwrap().clone()
}

/// A file with this content.
pub(crate) fn file(place: &Place, content: &str) -> String {
    let path = place.path("values.csv");
    fs::write(&path, content).unwrap();
    path.to_str().unwrap().to_owned()
}

#[track_caller]
fn close(found: &Value, expected: f64, share: f64) {
    let number = found.as_f64().unwrap_or_else(|| panic!("{found}"));
    let largest = number.abs().max(expected.abs());
    assert!(
        (number - expected).abs() <= share * largest,
        "{number} instead of {expected}"
    );
}

/// A ratio of whole numbers.
fn ratio(above: i128, below: i128) -> f64 {
    let whole = above.div_euclid(below);
    whole as f64 + above.rem_euclid(below) as f64 / below as f64
}

/// Sums of squares of a table in units of 1e-8, by whole numbers alone: parts, appraisers, their interaction, error.
fn exact(table: &[Vec<Vec<i128>>]) -> [f64; 4] {
    let (p, o, r) = (
        table.len() as i128,
        table[0].len() as i128,
        table[0][0].len() as i128,
    );
    let all = p * o * r;
    let values = || table.iter().flatten().flatten();
    let total: i128 = values().sum();
    let squares: i128 = values().map(|x| x * x).sum();
    let of_part: i128 = table
        .iter()
        .map(|part| part.iter().flatten().sum::<i128>().pow(2))
        .sum();
    let of_appraiser: i128 = (0..table[0].len())
        .map(|at| table.iter().flat_map(|part| &part[at]).sum::<i128>().pow(2))
        .sum();
    let of_cell: i128 = table
        .iter()
        .flatten()
        .map(|cell| cell.iter().sum::<i128>().pow(2))
        .sum();
    // Each is a whole number over the number of all values.
    let parts = of_part * p - total * total;
    let appraisers = of_appraiser * o - total * total;
    let cells = of_cell * p * o - total * total;
    [
        parts,
        appraisers,
        cells - parts - appraisers,
        squares * all - of_cell * p * o,
    ]
    .map(|sum| ratio(sum, all))
}

#[test]
fn sums_of_squares_are_those_of_exact_arithmetic() {
    let place = Place::new();
    let mut random = Random::new(0x5EED_0054);
    for round in 0..100 {
        let [p, o, r] = [
            2 + random.below(19),
            1 + random.below(5),
            2 + random.below(9),
        ];
        // Ten thousandths: values of 1 lie 10⁶ σ away in every other round.
        let offset = if round % 2 == 0 { 0 } else { 10_i128.pow(10) };
        let [of_part, of_both] = [[1, 30_000][round / 2 % 2], [1, 20_000][round / 4 % 2]];
        let mut some = |most: usize| random.below(2 * most + 1) as i128 - most as i128;
        let mut csv = "part,appraiser,trial,value\n".to_owned();
        let mut table = Vec::new();
        for part in 0..p {
            let here = offset + some(of_part);
            let mut cells = Vec::new();
            for appraiser in 0..o {
                let here = here + some(of_both);
                let cell: Vec<i128> = (0..r).map(|_| here + some(10_000)).collect();
                for (trial, value) in cell.iter().enumerate() {
                    let sign = if *value < 0 { "-" } else { "" };
                    let size = value.abs();
                    writeln!(
                        csv,
                        "{part},{appraiser},{trial},{sign}{}.{:04}",
                        size / 10_000,
                        size % 10_000
                    )
                    .unwrap();
                }
                cells.push(cell.iter().map(|value| value - offset).collect());
            }
            table.push(cells);
        }
        let found = &studies(&place, &["grr", &file(&place, &csv)])[0];
        let of = |source: &str| {
            &found["anova"]
                .as_array()
                .unwrap()
                .iter()
                .find(|row| row["source"] == source)
                .unwrap()["ss"]
        };
        let [parts, appraisers, both, error] = exact(&table).map(|squares| squares / 1e8);
        close(of("parts"), parts, 1e-11);
        close(of("repeatability"), error, 1e-11);
        if o > 1 {
            close(of("appraisers"), appraisers, 1e-11);
            close(of("parts × appraisers"), both, 1e-11);
        }
    }
}

/// So many results of recipe 1 with so many gauges, some of them INVALID or not measured, in the history of a place.
pub(crate) fn stored(place: &Place, results: u32, gauges: u16) {
    let state = place.path("state");
    fs::create_dir_all(&state).unwrap();
    let (mut writer, _) = Writer::open(&state.join("history.db"), 10_000_000).unwrap();
    let mut random = Random::new(0x5EED_0055);
    let entry = |seq: u32| {
        let gauge = |slot: u16, value: f64| GaugeEntry {
            slot,
            name: format!("hole {slot}"),
            unit: "mm".into(),
            value: Some(value),
            sigma: Some(0.002),
            uncertainty: Some(0.01),
            low: Some(9.8),
            // The limits change in the middle.
            high: Some(if seq > results / 2 { 10.2 } else { 10.3 }),
            decision: if seq.is_multiple_of(11) { 1 } else { 3 },
            ..GaugeEntry::default()
        };
        let mut value = || 10.0 + (random.below(2001) as f64 - 1000.0) / 1e4;
        Entry {
            seq,
            time_utc_us: (!seq.is_multiple_of(5))
                .then(|| 1_795_000_000_000_000 + 1_000_000 * u64::from(seq)),
            boot_id: "00000001".into(),
            recipe: 1,
            fingerprint: "0000abcd".into(),
            part_id: seq % 7,
            verdict: if seq.is_multiple_of(13) {
                Verdict::Invalid
            } else {
                Verdict::Pass
            },
            gauges: (1..=gauges).map(|slot| gauge(slot, value())).collect(),
            ..Entry::default()
        }
    };
    let all: Vec<Entry> = (1..=results).map(entry).collect();
    for some in all.chunks(1000) {
        writer.store(some.iter()).unwrap();
    }
}

#[test]
fn the_process_of_stored_results_is_that_of_their_csv() {
    let place = Place::new();
    stored(&place, 600, 2);
    let stored = studies(
        &place,
        &["process", "--recipe", "1", "--tests", "1,2,3,4,5,6,7,8"],
    );
    let state = place.path("state");
    let csv = program()
        .run(&["history", "--csv", "--state", state.to_str().unwrap()])
        .succeeded()
        .stdout;
    let read = studies(
        &place,
        &["process", &file(&place, &csv), "--tests", "1,2,3,4,5,6,7,8"],
    );
    assert_eq!(stored.len(), 2);
    for (stored, read) in stored.iter().zip(&read) {
        for key in ["characteristic", "unit"] {
            assert_eq!(stored[key], read[key]);
        }
        let [stored_groups, read_groups] =
            [stored, read].map(|study| study["groups"].as_array().unwrap().clone());
        assert_eq!((stored_groups.len(), read_groups.len()), (2, 2));
        for (stored, read) in stored_groups.iter().zip(&read_groups) {
            for key in ["n", "first", "last", "low", "high"] {
                assert_eq!(stored[key], read[key], "{key}");
            }
            for key in ["mean", "s", "mean_range"] {
                close(&stored[key], read[key].as_f64().unwrap(), 1e-12);
            }
            for key in ["pp", "ppk", "cp", "cpk"] {
                close(
                    &stored[key]["from"],
                    read[key]["from"].as_f64().unwrap(),
                    1e-9,
                );
            }
            let marks = |study: &Value| {
                study["marks"]
                    .as_array()
                    .unwrap()
                    .iter()
                    .map(|mark| (mark["test"].clone(), mark["at"].clone()))
                    .collect::<Vec<_>>()
            };
            assert_eq!(marks(stored), marks(read));
            assert!(!marks(stored).is_empty());
        }
        // Of 600, 46 are INVALID and 54 have no valid value, 4 of these both.
        assert_eq!(
            stored["left_out"],
            json!({ "invalid": 46, "not_measured": 50, "of_studies": 0 })
        );
    }
    let few = studies(
        &place,
        &[
            "process",
            "--recipe",
            "1",
            "--slot",
            "2",
            "--since",
            "2026-11-18T11:11:40Z",
        ],
    );
    assert_eq!(
        (few.len(), &few[0]["characteristic"]),
        (1, &"hole 2".into())
    );
    assert!(few[0]["groups"][0]["n"].as_u64() < stored[0]["groups"][0]["n"].as_u64());
}

#[test]
fn what_a_study_cannot_be_made_of_is_refused_with_the_remedy() {
    let place = Place::new();
    let values = file(&place, "part,value\n1,2\n1,two\n");
    let gauges = place.path("gauges.csv");
    fs::write(&gauges, "characteristic,value\na,1\nb,2\n").unwrap();
    let cg = ["--reference", "1", "--tolerance", "1"];
    for (arguments, code, words) in [
        (vec!["grr", &values], 65, "line 3: \"two\" is not a number"),
        (vec!["grr", "/nowhere.csv"], 66, "name a CSV file"),
        (
            vec!["cg", gauges.to_str().unwrap(), cg[0], cg[1], cg[2], cg[3]],
            65,
            "name one with --characteristic: a, b",
        ),
        (
            vec![
                "cg",
                gauges.to_str().unwrap(),
                "--characteristic",
                "c",
                cg[0],
                cg[1],
                cg[2],
                cg[3],
            ],
            65,
            "name one of: a, b",
        ),
        (
            vec!["cg", &values, "--reference", "1", "--tolerance", "0"],
            64,
            "--tolerance",
        ),
        (vec!["process"], 64, "--recipe"),
        (
            vec!["process", &values, "--recipe", "1"],
            64,
            "cannot be used with",
        ),
    ] {
        let run = program().run(&[vec!["study"], arguments.clone()].concat());
        assert_eq!(run.code, code, "{arguments:?}: {}", run.stderr);
        assert!(run.stderr.contains(words), "{arguments:?}: {}", run.stderr);
    }
}

#[test]
#[ignore = "seconds: `.ci/run full` does it"]
fn a_process_of_a_hundred_thousand_results_takes_seconds() {
    let place = Place::new();
    stored(&place, 100_000, 8);
    let begun = Instant::now();
    let found = studies(&place, &["process", "--recipe", "1"]);
    println!(
        "process of 100,000 results with 8 gauges: {:?}",
        begun.elapsed()
    );
    assert_eq!(found.len(), 8);
    assert!(reader(&place).id().is_ok());
}
