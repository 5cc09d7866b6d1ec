//! Statistics of the shipped program, against what `study process` prints and against sums of their own.

use crate::page::Browser;
use crate::station_plc::{Daemon, Place};
use crate::studies::{stored, studies};
use appliance::history::{Entry, GaugeEntry, Writer};
use appliance::station::Verdict;
use serde_json::{Value, json};
use std::time::{Duration, Instant};
use tests::random::Random;

/// The parts of an answer.
fn parts(browser: &mut Browser, query: &str) -> Vec<Value> {
    let (status, body) = browser.ask("GET", &format!("/api/statistics?{query}"), &[]);
    let body = String::from_utf8(body).unwrap();
    assert_eq!(status, 200, "{query}: {body}");
    let parts: Vec<Value> = body
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    assert_eq!(parts.last().unwrap(), &json!({ "part": "end" }));
    parts
}

fn of<'a>(parts: &'a [Value], name: &str) -> Vec<&'a Value> {
    parts.iter().filter(|part| part["part"] == name).collect()
}

/// Without what only a list of values has.
fn figures(group: &Value) -> Value {
    let mut group = group.clone();
    for key in ["marks", "individuals", "moving_ranges"] {
        group.as_object_mut().unwrap().remove(key);
    }
    group
}

#[test]
fn statistics_are_the_numbers_of_study_process_and_of_sums_of_their_own() {
    let place = Place::taught();
    stored(&place, 3000, 3);
    let printed = studies(&place, &["process", "--recipe", "1"]);
    let daemon = Daemon::start(&place);
    let mut browser = Browser::new(&daemon);
    for axis in ["time", "stroke", "result"] {
        let parts = parts(&mut browser, &format!("recipe=1&axis={axis}&columns=64"));
        let results = of(&parts, "results")[0];
        // Every fifth has no time, every thirteenth is INVALID.
        assert_eq!(results["counts"]["invalid"], 230);
        assert_eq!(
            results["off_axis"],
            if axis == "time" { 600 } else { 0 },
            "{axis}"
        );
        let (gauges, marks) = (of(&parts, "gauge"), of(&parts, "marks"));
        assert_eq!((gauges.len(), marks.len()), (3, 3));
        for ((gauge, marks), process) in gauges.iter().zip(&marks).zip(&printed) {
            assert_eq!(gauge["name"], process["characteristic"]);
            assert_eq!(gauge["left_out"], process["left_out"]);
            let groups = gauge["groups"].as_array().unwrap();
            let expected = process["groups"].as_array().unwrap();
            assert_eq!(groups.len(), 2, "the limits changed once");
            for (group, expected) in groups.iter().zip(expected) {
                assert_eq!(group, &figures(expected));
                against_two_passes(group, expected);
            }
            let all = expected
                .iter()
                .flat_map(|group| group["marks"].as_array().unwrap());
            assert_eq!(marks["marks"], all.clone().count());
            assert_eq!(marks["first"]["seq"], all.clone().next().unwrap()["at"]);
            let values = expected
                .iter()
                .map(|group| group["n"].as_u64().unwrap())
                .sum::<u64>();
            let bars = marks["histogram"]["counts"].as_array().unwrap();
            let counted: u64 = bars.iter().map(|bar| bar.as_u64().unwrap()).sum();
            assert_eq!(counted, values);
            let columns = gauge["columns"].as_array().unwrap();
            let shown: u64 = columns
                .iter()
                .filter_map(|column| column["n"].as_u64())
                .sum();
            let expected = if axis == "time" {
                shown < values
            } else {
                shown == values
            };
            assert!(expected, "{axis}: {shown} of {values}");
        }
    }
}

/// Mean, s and mean moving range of the listed values.
#[track_caller]
fn against_two_passes(group: &Value, listed: &Value) {
    let values: Vec<f64> = listed["individuals"]
        .as_array()
        .unwrap()
        .iter()
        .map(|value| value.as_f64().unwrap())
        .collect();
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    let ranges: f64 = values
        .windows(2)
        .map(|pair| (pair[1] - pair[0]).abs())
        .sum();
    for (key, expected) in [
        ("mean", mean),
        ("s", (squares / (n - 1.0)).sqrt()),
        ("mean_range", ranges / (n - 1.0)),
    ] {
        let found = group[key].as_f64().unwrap();
        assert!(
            (found - expected).abs() <= 1e-9 * expected.abs(),
            "{key}: {found} instead of {expected}"
        );
    }
}

/// Over the turn of a year: 100 values about 5 mm, then 40 that drift; limits change at 60 and at 90, the recipe is taught again at 80,
/// every tenth is INVALID, and the clock is not synchronised from 30 to 39.
fn entry(seq: u32, random: &mut Random) -> Entry {
    const NEW_YEAR_US: u64 = 1_798_761_600_000_000;
    let drift = f64::from(seq.saturating_sub(100)) * 0.01;
    let value = 5.0 + (random.below(201) as f64 - 100.0) / 1e4 + drift;
    let invalid = seq.is_multiple_of(10);
    let gauge = GaugeEntry {
        slot: 7,
        name: "height".into(),
        unit: "mm".into(),
        value: (!invalid).then_some(value),
        low: Some(4.0),
        high: Some(match seq {
            ..60 => 6.0,
            60..90 => 6.5,
            _ => 7.0,
        }),
        decision: if invalid { 0 } else { 3 },
        ..GaugeEntry::default()
    };
    Entry {
        seq,
        time_utc_us: (!(30..40).contains(&seq))
            .then(|| NEW_YEAR_US + 60_000_000 * u64::from(seq) - 70 * 60_000_000),
        boot_id: "00000001".into(),
        recipe: 4,
        fingerprint: if seq < 80 { "0000aaaa" } else { "0000bbbb" }.into(),
        press_stroke: 1000 + 2 * seq,
        verdict: match invalid {
            true => Verdict::Invalid,
            false => Verdict::Pass,
        },
        reason: invalid.then(|| format!("{seq} % is too dark: clean the window")),
        gauges: vec![gauge],
        ..Entry::default()
    }
}

#[test]
fn changed_limits_another_version_invalid_and_undated_results_are_told() {
    let place = Place::taught();
    let state = place.path("state");
    let (mut writer, _) = Writer::open(&state.join("history.db"), 1000).unwrap();
    let mut random = Random::new(0x5EED_0056);
    let entries: Vec<Entry> = (1..=140).map(|seq| entry(seq, &mut random)).collect();
    writer.store(entries.iter()).unwrap();
    drop(writer);
    let daemon = Daemon::start(&place);
    let mut browser = Browser::new(&daemon);
    let parts_of = parts(&mut browser, "recipe=4&axis=stroke");
    let results = of(&parts_of, "results")[0];
    assert_eq!(results["counts"]["invalid"], 14);
    assert_eq!(
        results["reasons"],
        json!([{ "reason": "… % is too dark: clean the window", "n": 14 }])
    );
    assert_eq!(
        results["versions"],
        json!([{ "seq": 80, "x": 1160, "fingerprint": "0000bbbb" }])
    );
    let gauge = of(&parts_of, "gauge")[0];
    assert_eq!(gauge["slot"], 7);
    // Those at 60 and 90 are INVALID.
    assert_eq!(gauge["starts"], json!([1002, 1122, 1182]));
    let limits: Vec<_> = gauge["groups"]
        .as_array()
        .unwrap()
        .iter()
        .map(|group| group["high"].clone())
        .collect();
    assert_eq!(limits, [6.0, 6.5, 7.0]);
    let drift = &of(&parts_of, "marks")[0]["drift"];
    // The last group begins at 91; thirty values later it is known what was usual, which drifts already.
    assert!(drift["seq"].as_u64().unwrap() > 100, "{drift}");
    // Of a period those without a time are named.
    let since = entries[49].time_utc_us.unwrap();
    let parts_of = parts(&mut browser, &format!("recipe=4&since_us={since}"));
    let results = of(&parts_of, "results")[0];
    assert_eq!(results["undated"], 10);
    assert_eq!(results["from"], since);
    assert_eq!(results["counts"]["invalid"], 10);
    // The first column of the period holds its first value.
    let columns = of(&parts_of, "gauge")[0]["columns"].as_array().unwrap();
    assert_eq!(columns.len(), 120);
    assert_eq!(columns[1]["at"], json!([51, 51]));
}

#[test]
fn what_is_out_of_bounds_or_crossed_is_refused_with_the_keys_name() {
    let place = Place::taught();
    let daemon = Daemon::start(&place);
    let mut browser = Browser::new(&daemon);
    let mut random = Random::new(0x5EED_0057);
    for _ in 0..1000 {
        let number = random.below(usize::MAX / 2);
        let cases = [
            (
                "recipe",
                format!("recipe={}", 10_000 + number % 1_000_000_000_000),
            ),
            ("recipe", format!("recipe=-{number}")),
            ("recipe", "axis=time".into()),
            ("slot", format!("recipe=1&slot={}", 65 + number % 60_000)),
            ("slot", "recipe=1&slot=0".into()),
            ("axis", format!("recipe=1&axis={number}")),
            ("period", format!("recipe=1&period=p{number}")),
            (
                "period",
                format!("recipe=1&period=teach&since_us={}", number % 1_000_000),
            ),
            (
                "until_us",
                format!(
                    "recipe=1&since_us={number}&until_us={}",
                    number - number % 1000
                ),
            ),
            ("since_us", format!("recipe=1&since_us=-{number}")),
            ("columns", format!("recipe=1&columns={}", 1001 + number)),
        ];
        let (key, query) = &cases[random.below(cases.len())];
        let begun = Instant::now();
        let (status, body) = browser.ask("GET", &format!("/api/statistics?{query}"), &[]);
        let words = String::from_utf8_lossy(&body);
        assert!(
            status == 400 && words.contains(key),
            "{query}: {status} {words}"
        );
        // On a machine that is shared; most take some hundred µs.
        assert!(begun.elapsed() < Duration::from_secs(1), "{query}");
    }
}
