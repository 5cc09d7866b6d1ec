//! Results for programs that collect them.

use super::*;
use crate::history::{DATABASE, Entry, GaugeEntry, Writer};
use std::path::Path;

fn writer(state: &Path, limit: u64) -> Writer {
    Writer::open(&state.join(DATABASE), limit).unwrap().0
}

fn entry(seq: u32) -> Entry {
    let gauge = |slot, value, decision| GaugeEntry {
        slot,
        name: format!("gauge {slot}"),
        unit: "mm".into(),
        value,
        decision,
        ..GaugeEntry::default()
    };
    Entry {
        seq,
        time_utc_us: Some(1_000_000 * u64::from(seq) + 999).filter(|_| seq.is_multiple_of(2)),
        boot_id: "0000000a".into(),
        uptime_s: seq,
        fingerprint: "00c0ffee".into(),
        verdict: Verdict::Pass,
        coverage_permille: 987,
        exposure_us: 400,
        total_us: 1000,
        gauges: vec![
            gauge(1, Some(0.1 + 0.2), 3),
            gauge(2, None, 0),
            // A number was found that is not valid.
            gauge(5, Some(7.0), 0),
        ],
        ..Entry::default()
    }
}

/// The lines of an answer, the header first.
async fn lines(served: &Served, query: &str) -> Vec<Value> {
    let answer = served.get(&format!("/api/results{query}")).await;
    assert_eq!(answer.status, 200, "{answer:?}");
    assert_eq!(answer.header("content-type"), Some("application/x-ndjson"));
    let body = whole(&answer.body);
    let lines = body.lines().map(serde_json::from_str);
    lines.collect::<Result<_, _>>().unwrap()
}

/// A body that came in chunks (RFC 9112, 7.1).
fn whole(body: &str) -> String {
    let (mut all, mut rest) = (String::new(), body);
    while let Some((length, chunk)) = rest.split_once("\r\n") {
        let length = usize::from_str_radix(length, 16).unwrap();
        all += &chunk[..length];
        rest = chunk[length..].trim_start_matches("\r\n");
    }
    all
}

fn seqs(lines: &[Value]) -> Vec<u64> {
    let rows = lines[1..].iter();
    rows.map(|line| line["seq"].as_u64().unwrap()).collect()
}

#[tokio::test]
async fn results_behind_a_seq_come_oldest_first_below_a_header() {
    let served = served().await;
    let state = served._folder.path();
    // Numbers are skipped after a loss of power; two pages and more.
    let kept: Vec<u32> = (3..=70).chain(128..=200).collect();
    let entries: Vec<_> = kept.iter().map(|&seq| entry(seq)).collect();
    writer(state, 1000).store(entries.iter()).unwrap();

    let all = lines(&served, "").await;
    let id = Reader::of(state).id().unwrap();
    let header = serde_json::json!({ "serial": "SN-1", "history": id, "first": 3, "last": 200 });
    assert_eq!(all[0], header);
    assert!(
        seqs(&all).iter().eq(kept
            .iter()
            .map(|&seq| u64::from(seq))
            .collect::<Vec<_>>()
            .iter())
    );
    let some = lines(&served, "?after=69&limit=3").await;
    assert_eq!(
        (some[0].clone(), seqs(&some)),
        (header.clone(), vec![70, 128, 129])
    );
    let none = lines(&served, "?after=200").await;
    assert_eq!(none, [header]);
}

#[tokio::test]
async fn what_is_not_known_of_a_result_is_null_and_never_0() {
    let served = served().await;
    let mut writer = writer(served._folder.path(), 1000);
    writer.store([entry(1), entry(2)].iter()).unwrap();

    let all = lines(&served, "").await;
    let [undated, dated] = [&all[1], &all[2]];
    assert_eq!(
        (&undated["at_unix_ms"], &undated["clock"]),
        (&Value::Null, &"none".into())
    );
    assert_eq!(dated["at_unix_ms"], 2000);
    assert_eq!(
        (&dated["clock"], &dated["placement"]),
        (&"synchronised".into(), &Value::Null)
    );
    assert_eq!(
        (&dated["processing_us"], &dated["coverage"]),
        (&600.into(), &0.987.into())
    );
    assert_eq!(
        (&dated["verdict"], &dated["history"]),
        (&"PASS".into(), &all[0]["history"])
    );
    let values: Vec<_> = (0..3).map(|at| &dated["gauges"][at]["value"]).collect();
    assert_eq!(
        values,
        [&Value::from(0.1 + 0.2), &Value::Null, &Value::Null]
    );
    assert_eq!(dated["gauges"][2]["slot"], 5);

    writer.date("0000000a", 5_000_000).unwrap();
    let all = lines(&served, "?limit=1").await;
    assert_eq!(
        (&all[1]["at_unix_ms"], &all[1]["clock"]),
        (&6000.into(), &"browser".into())
    );
}

#[tokio::test]
async fn the_header_shows_what_was_deleted_before_anybody_asked() {
    let served = served().await;
    let mut writer = writer(served._folder.path(), 10);
    assert_eq!(lines(&served, "").await[0]["first"], Value::Null);
    for first in [1, 11] {
        let entries: Vec<_> = (first..first + 10).map(entry).collect();
        writer.store(entries.iter()).unwrap();
    }
    let all = lines(&served, "?after=5").await;
    assert_eq!(all[0]["first"], 11);
    assert_eq!(seqs(&all), (11..=20).collect::<Vec<_>>());
}

#[tokio::test]
async fn where_results_are_deleted_behind_a_reader_its_walk_ends_so_that_the_next_shows_the_gap() {
    let folder = tempfile::tempdir().unwrap();
    let mut writer = writer(folder.path(), 100);
    writer
        .store((1..=100).map(entry).collect::<Vec<_>>().iter())
        .unwrap();
    let mut walk = Reader::of(folder.path()).after(0, 1000).unwrap();
    let page = walk.page().unwrap();
    let read = page.results.last().unwrap().seq;
    writer
        .store((101..=190).map(entry).collect::<Vec<_>>().iter())
        .unwrap();
    let next = walk.page().unwrap();
    assert!(next.first.unwrap() > read + 1 && next.results.is_empty());
}

#[tokio::test]
async fn a_reader_that_hangs_holds_neither_the_others_nor_the_history() {
    let served = served().await;
    let mut writer = writer(served._folder.path(), 20_000);
    let entries: Vec<_> = (1..=20_000).map(entry).collect();
    writer.store(entries.iter()).unwrap();
    let mut hanging = Vec::new();
    for _ in 0..3 {
        let mut stream = TcpStream::connect(served.address).await.unwrap();
        let request = format!(
            "GET /api/results HTTP/1.1\r\nHost: {}\r\n\r\n",
            served.address
        );
        stream.write_all(request.as_bytes()).await.unwrap();
        let mut begun = [0; 100];
        stream.read_exact(&mut begun).await.unwrap();
        hanging.push(stream);
    }
    assert_eq!(seqs(&lines(&served, "?after=19999").await), [20_000]);
    // The whole log goes into the database: no reader needs it.
    writer.checkpoint().unwrap();
    writer.store([entry(20_001)].iter()).unwrap();
    assert!(writer.log_bytes() < 2 << 20, "{}", writer.log_bytes());
    assert_eq!(
        served.get("/api/history?limit=1").await.json()["results"][0]["seq"],
        20_001
    );
}
