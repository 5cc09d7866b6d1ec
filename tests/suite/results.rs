//! Results for programs that collect them, from the shipped program.

use crate::history::reader;
use crate::page::Browser;
use crate::station_plc::{Daemon, Place, Plc, READY, long};
use appliance::history::{DATABASE, Entry, GaugeEntry, Writer};
use appliance::station::Verdict;
use serde_json::{Value, json};
use tests::until::{PATIENCE, until};

/// Numbers of results, as a loss of power leaves them: some are skipped.
fn kept() -> impl Iterator<Item = u32> {
    (3..=90).chain(128..=200)
}

fn entry(seq: u32) -> Entry {
    let unseen = GaugeEntry {
        slot: 2,
        name: "opening".into(),
        unit: "mm".into(),
        reason: Some("too dark".into()),
        ..GaugeEntry::default()
    };
    Entry {
        seq,
        fingerprint: "00c0ffee".into(),
        verdict: Verdict::Invalid,
        error_code: 904,
        gauges: vec![unseen],
        ..Entry::default()
    }
}

/// The lines of an answer, the header first.
fn lines(browser: &mut Browser, query: &str) -> Vec<Value> {
    let (status, body) = browser.ask("GET", &format!("/api/results{query}"), &[]);
    let body = String::from_utf8(body).unwrap();
    assert_eq!(status, 200, "{body}");
    let lines = body.lines().map(serde_json::from_str);
    lines.collect::<Result<_, _>>().unwrap()
}

fn seqs(lines: &[Value]) -> Vec<u32> {
    let seq = |line: &Value| line["seq"].as_u64().unwrap() as u32;
    lines[1..].iter().map(seq).collect()
}

#[test]
fn a_collector_gets_every_result_behind_the_last_that_it_has() {
    let place = Place::taught();
    let state = place.path("state");
    let (mut writer, _) = Writer::open(&state.join(DATABASE), 1000).unwrap();
    let entries: Vec<_> = kept().map(entry).collect();
    writer.store(entries.iter()).unwrap();
    drop(writer);

    let daemon = Daemon::start(&place);
    let mut plc = Plc::connect(&daemon);
    plc.wait("READY", |status| status.has(READY));
    let measured = long(&plc.measure(1), 0);
    assert!(measured > 200, "{measured}");
    let mut browser = Browser::new(&daemon);
    let all = until("measured result", PATIENCE, || {
        let all = lines(&mut browser, "");
        match all[0]["last"] == measured {
            true => Ok(all),
            false => Err(all[0].clone()),
        }
    });
    let serial = browser.get("/api/snapshot")["identity"]["serial"].clone();
    let id = reader(&place).id().unwrap();
    let header = json!({ "serial": serial, "history": id, "first": 3, "last": measured });
    assert_eq!(all[0], header);
    assert_eq!(seqs(&all), kept().chain([measured]).collect::<Vec<_>>());

    // What could not be measured, and when it was, is not known.
    let unseen = &all[1];
    assert_eq!(
        (&unseen["at_unix_ms"], &unseen["clock"]),
        (&Value::Null, &json!("none"))
    );
    assert_eq!(
        (&unseen["verdict"], &unseen["error_code"]),
        (&json!("INVALID"), &json!(904))
    );
    let gauge = json!({
        "slot": 2, "name": "opening", "unit": "mm", "value": null, "sigma": null, "u": null, "low": null, "high": null,
        "decision": 0, "reason": "too dark",
    });
    assert_eq!(unseen["gauges"], json!([gauge]));

    // The result of the station is the one of its history.
    let shown = browser.get("/api/history?limit=1")["results"][0].clone();
    let line = all.last().unwrap();
    for key in [
        "seq",
        "recipe",
        "fingerprint",
        "part_id",
        "press_stroke",
        "verdict",
        "flags",
        "exposure_us",
    ] {
        assert_eq!(line[key], shown[key], "{key}");
    }
    let us = |key: &str| shown[key].as_u64().unwrap();
    assert_eq!(line["processing_us"], us("total_us") - us("exposure_us"));
    assert_eq!(
        line["gauges"].as_array().unwrap().len(),
        shown["gauges"].as_array().unwrap().len()
    );
    assert_eq!(line["gauges"][0]["value"], shown["gauges"][0]["value"]);

    let some = lines(&mut browser, "?after=89&limit=3");
    assert_eq!((&some[0], seqs(&some)), (&header, vec![90, 128, 129]));
    assert_eq!(lines(&mut browser, &format!("?after={measured}")), [header]);
    let (status, _) = browser.ask("GET", "/api/results?after=x", &[]);
    assert_eq!(status, 400);
}
