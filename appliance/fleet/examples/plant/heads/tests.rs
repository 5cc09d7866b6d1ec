//! The simulated heads as a collector sees them.

use super::answers::answer;
use super::{FAULT_PERIOD_MS, Fault, Options, Plant, now_ms};
use hyper::body::Body as _;
use serde_json::Value;
use std::collections::BTreeSet;
use std::future::poll_fn;
use std::pin::pin;
use std::sync::Arc;

const HEADS: u32 = 40;

/// A plant whose heads have made `results` each.
fn plant(results: u32, faults: &[Fault]) -> Arc<Plant> {
    Plant::new(Options {
        heads: HEADS,
        rate: 10.0,
        listen: String::new(),
        seed: 7,
        faults: faults.to_vec(),
        gauges: 8,
        backlog: results,
        results,
        kept: u32::MAX,
    })
}

/// What a path below `/h/` answers, and whether it ended well.
fn get(plant: &Arc<Plant>, path: &str) -> (u16, String, bool) {
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .unwrap();
    runtime.block_on(async {
        let uri = format!("/h/{path}").parse().unwrap();
        let response = answer(plant, &uri).await.unwrap();
        let status = response.status().as_u16();
        let mut body = pin!(response.into_body());
        let (mut text, mut ended) = (Vec::new(), false);
        while let Some(frame) = poll_fn(|context| body.as_mut().poll_frame(context)).await {
            let Ok(frame) = frame else {
                ended = true;
                break;
            };
            text.extend(frame.into_data().unwrap());
            // What is endless is seen by then.
            if text.len() > 8 << 20 {
                break;
            }
        }
        (status, String::from_utf8(text).unwrap(), !ended)
    })
}

/// The header and the results behind `after`.
fn results(plant: &Arc<Plant>, head: u32, query: &str) -> (Value, Vec<Value>) {
    let (status, text, whole) = get(plant, &format!("{head:04}/api/results?{query}"));
    assert!(status == 200 && whole && text.ends_with('\n'));
    let mut lines = text.lines().map(|line| serde_json::from_str(line).unwrap());
    (lines.next().unwrap(), lines.collect())
}

fn seqs(rows: &[Value]) -> Vec<u64> {
    rows.iter()
        .map(|row| row["seq"].as_u64().unwrap())
        .collect()
}

#[test]
fn pages_of_results_are_the_whole_and_each_of_them_is_one_line_of_json() {
    let plant = plant(2_500, &[]);
    let (header, whole) = results(&plant, 3, "after=0&limit=10000");
    assert_eq!(header["first"], 1);
    assert_eq!(header["last"], 2_500);
    assert_eq!(seqs(&whole), (1..=2_500).collect::<Vec<_>>());
    let mut paged = Vec::new();
    while let (_, page) = results(&plant, 3, &format!("after={}&limit=700", paged.len()))
        && !page.is_empty()
    {
        assert!(page.len() <= 700);
        paged.extend(page);
    }
    assert_eq!(paged, whole);
    for row in &whole {
        assert_eq!(row["serial"], header["serial"]);
        assert_eq!(row["history"], header["history"]);
        let failed = row["error_code"] != 0;
        assert_eq!(
            row["gauges"].as_array().unwrap().len(),
            if failed { 0 } else { 8 }
        );
    }
}

#[test]
fn verdicts_follow_from_the_decisions_and_decisions_from_values_and_limits() {
    let plant = plant(5_000, &[]);
    let mut verdicts = [0; 3];
    for head in [3, 6, 7] {
        for row in results(&plant, head, "after=0").1 {
            let gauges = row["gauges"].as_array().unwrap();
            let (mut unseen, mut failed) = (gauges.is_empty(), false);
            for gauge in gauges {
                let bits = gauge["decision"].as_u64().unwrap();
                let Some(value) = gauge["value"].as_f64() else {
                    assert_eq!(bits, 0);
                    assert!(gauge["reason"].is_string());
                    unseen = true;
                    continue;
                };
                let below = gauge["low"].as_f64().is_some_and(|low| value < low);
                let above = gauge["high"].as_f64().is_some_and(|high| value > high);
                assert_eq!(
                    bits & 15,
                    2 + u64::from(!below && !above) + 4 * u64::from(below) + 8 * u64::from(above)
                );
                failed |= below || above;
            }
            let expected = usize::from(failed) + 2 * usize::from(unseen && !failed);
            let expected = if unseen { 2 } else { expected };
            assert_eq!(row["verdict"], ["PASS", "FAIL", "INVALID"][expected]);
            verdicts[expected] += 1;
        }
    }
    // Head 6 makes scrap: its first gauge is 1.3 spreads below its limit, give or take the drift.
    let [pass, fail, invalid] = verdicts;
    assert!(
        pass > 12_000 && (300..1_500).contains(&fail) && (10..100).contains(&invalid),
        "{verdicts:?}"
    );
}

#[test]
fn the_csv_has_the_same_results_newest_first() {
    let plant = plant(1_500, &[]);
    let (_, rows) = results(&plant, 4, "after=0");
    let (_, text, _) = get(&plant, "0004/api/history.csv?limit=1000");
    let mut lines = text.split_terminator("\r\n");
    let header = lines.next().unwrap();
    assert!(header.contains(",bend [°],bend sigma,") && header.contains(",\"step, left [mm]\","));
    assert!(header.contains(",\"rim \"\"A\"\"\","));
    let lines: Vec<_> = lines.collect();
    assert_eq!(lines.len(), 1_000);
    for (line, row) in lines.iter().zip(rows.iter().rev()) {
        let cells: Vec<_> = line.split(',').collect();
        assert_eq!(cells[0], row["seq"].to_string());
        assert_eq!(cells[7], row["verdict"].as_str().unwrap());
        let value = row["gauges"][0]["value"].as_f64();
        assert_eq!(cells[21].parse().ok(), value);
    }
}

#[test]
fn a_head_that_was_off_skips_the_results_that_were_due_and_keeps_its_history() {
    let plant = plant(1_000, &[Fault::Restart]);
    let head = plant.head(1, plant.start_ms + FAULT_PERIOD_MS - 1).unwrap();
    let all: Vec<_> = head.results(1).collect();
    // All but six of 47 seconds at ten a second.
    assert!((405..=415).contains(&all.len()), "{}", all.len());
    let later = plant.head(1, plant.start_ms + 2 * FAULT_PERIOD_MS).unwrap();
    assert_eq!(later.history(), head.history());
    assert_eq!(later.results(1).take(all.len()).collect::<Vec<_>>(), all);
    assert_eq!(
        later.newest().filter(|&seq| seq <= head.last()).count(),
        all.len()
    );
}

#[test]
fn a_history_that_is_made_anew_has_another_id_and_counts_from_1() {
    let plant = plant(1_000, &[Fault::Renew]);
    let seen: Vec<_> = (0..4)
        .map(|times| {
            plant
                .head(1, plant.start_ms + times * FAULT_PERIOD_MS)
                .unwrap()
        })
        .collect();
    for pair in seen.windows(2) {
        assert_ne!(pair[0].history(), pair[1].history());
        assert_eq!(pair[1].results(1).next(), Some(1));
        assert!(pair[1].last() <= 10 * FAULT_PERIOD_MS as u32 / 1000);
    }
}

#[test]
fn a_history_that_keeps_few_results_says_which_is_the_oldest() {
    let mut plant = Arc::into_inner(plant(1_000, &[])).unwrap();
    plant.options.kept = 50;
    let (header, rows) = results(&Arc::new(plant), 9, "after=10");
    assert_eq!(header["first"], 951);
    assert_eq!(seqs(&rows), (951..=1_000).collect::<Vec<_>>());
}

#[test]
fn what_is_hostile_is_hostile_while_the_fault_lasts() {
    let kinds = [
        Fault::Cut,
        Fault::Endless,
        Fault::Line,
        Fault::Serial,
        Fault::Falling,
        Fault::Nan,
        Fault::Redirect,
    ];
    // The start is chosen so that every fault has begun at least once.
    for fault in kinds {
        let mut plant = plant(1_000, &[fault]);
        // The time at which the first head begins to fail is found by moving the start.
        let now = now_ms();
        let failing = |since: &u64| {
            let probe = plant.head(1, plant.start_ms + since);
            probe.is_some_and(|head| head.ails.is_some())
        };
        let since = (0..2 * FAULT_PERIOD_MS)
            .step_by(1_000)
            .find(failing)
            .unwrap()
            + 1_000;
        Arc::get_mut(&mut plant).unwrap().start_ms = now - since;
        let head = plant.head(1, now_ms()).unwrap();
        assert_eq!(head.ails, Some(fault));
        let (status, text, whole) = get(&plant, "0001/api/results?after=5");
        let lines: Vec<_> = text.lines().collect();
        match fault {
            Fault::Cut => assert!(!whole && text.len() < 1_000),
            Fault::Endless => assert!(lines.len() > 5_000),
            Fault::Line => assert!(lines.len() == 2 && lines[1].len() > 4 << 20),
            Fault::Serial => assert!(!text.contains(&head.serial())),
            Fault::Falling => assert!(lines.len() == 4 && lines[1].contains(r#""seq":8,"#)),
            Fault::Nan => assert!(serde_json::from_str::<Value>(lines[1]).is_err()),
            _ => assert_eq!(status, 307),
        }
        assert_eq!(get(&plant, "0002/api/results?after=5").0, 200);
    }
}

#[test]
fn metrics_count_every_result_once() {
    let plant = plant(3_000, &[]);
    for _ in 0..2 {
        let (_, text, _) = get(&plant, "0006/metrics");
        assert!(text.ends_with("# EOF\n"));
        let counts = text
            .lines()
            .filter(|line| line.starts_with("fringed_results_total"));
        let sum: u32 = counts
            .map(|line| line.rsplit(' ').next().unwrap().parse::<u32>().unwrap())
            .sum();
        assert_eq!(sum, 3_000);
    }
    let (status, _, _) = get(&plant, &format!("{:04}/metrics", HEADS + 1));
    assert_eq!(status, 404);
}

/// What begins with `fringed_` in a text.
fn metrics_in(text: &str) -> BTreeSet<&str> {
    let at = text.match_indices("fringed_").map(|(at, _)| &text[at..]);
    at.map(|rest| {
        rest.split(|c: char| !c.is_ascii_lowercase() && c != '_')
            .next()
            .unwrap()
    })
    .collect()
}

#[test]
fn every_metric_that_a_plant_looks_at_is_one_of_the_daemons() {
    let daemons = include_str!("../../../../src/web/metrics.rs");
    // A counter is written with the name of its family; its samples end with _total.
    let quoted = |name: &str| daemons.contains(&format!("\"{name}\""));
    let known = |name: &str| quoted(name) || name.strip_suffix("_total").is_some_and(quoted);
    let plant = plant(10, &[]);
    let (_, simulated, _) = get(&plant, "0003/metrics");
    let texts = [
        &*simulated,
        include_str!("../../../../../docs/fleet/health.json"),
        include_str!("../../../../../docs/fleet/alerts.yml"),
    ];
    for text in texts {
        let names = metrics_in(text);
        assert!(names.len() > 5);
        let unknown: Vec<_> = names.iter().filter(|name| !known(name)).collect();
        assert!(unknown.is_empty(), "{unknown:?} of {names:?}");
    }
    // What dashboards and alerts ask for has a simulated head, too, but for what only devices have.
    let asked = texts[1..].iter().flat_map(|text| metrics_in(text));
    let simulated = metrics_in(&simulated);
    let missing: BTreeSet<_> = asked.filter(|name| !simulated.contains(name)).collect();
    assert_eq!(missing, BTreeSet::from(["fringed_power"]));
}
