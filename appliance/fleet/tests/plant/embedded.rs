//! The embedded store.

use super::program::*;
use fringed_fleet::answer::{Gauge, Row};
use std::time::Duration;

/// Results that each head makes, and how many a second.
const RESULTS: i64 = 40;
const RATE: &str = "5";

fn plant(heads: u32) -> Plant {
    Plant::of(heads, &["--rate", RATE, "--results", &RESULTS.to_string()])
}

/// Whether each head's results are all there. None is there twice: the key forbids it.
fn is_complete(place: &Place, heads: usize) -> bool {
    let counts = counted(place);
    counts.len() == heads && counts.iter().all(|(_, count)| *count == RESULTS)
}

#[test]
fn a_collector_that_is_killed_again_and_again_leaves_nothing_out() {
    let plant = plant(30);
    let place = Place::new(&[&plant.heads()], "");
    let mut random = Random(5);
    for _ in 0..10 {
        let collector = place.collect(&place.store(), &[]);
        std::thread::sleep(Duration::from_millis(100 + random.below(1200)));
        collector.kill();
    }
    let collector = place.collect(&place.store(), &[]);
    wait("all results", || is_complete(&place, 30));
    assert_eq!(collector.terminate(), Some(0));
    // What is stored is what the head says.
    let said = answer(&plant, "/h/0007/api/results?after=16&limit=1");
    let said: Row = serde_json::from_str(said.lines().nth(1).unwrap()).unwrap();
    let query = "SELECT gauges, at FROM result WHERE serial = 'SIM00007' AND seq = 17";
    let (gauges, at) = numbers(&place, query).remove(0);
    let gauges: Vec<Gauge> = serde_json::from_str(&gauges).unwrap();
    assert_eq!(gauges, said.gauges);
    assert_eq!(at as u64, said.at_unix_ms.unwrap() / 1000);
}

#[test]
fn two_collectors_that_overlap_write_each_result_once() {
    let plant = plant(4);
    let place = Place::new(&[&plant.heads()], "");
    let _both = [(); 2].map(|()| place.collect(&place.store(), &[]));
    wait("all results", || is_complete(&place, 4));
}

#[test]
fn collectors_with_parts_share_the_heads_out() {
    let plant = plant(20);
    let [one, two] = [(); 2].map(|()| Place::new(&[&plant.heads()], ""));
    let _first = one.collect(&one.store(), &["--part", "1/2"]);
    let _second = two.collect(&two.store(), &["--part", "2/2"]);
    let all = |place: &Place| counted(place).iter().map(|(_, count)| count).sum::<i64>();
    wait("all results", || all(&one) + all(&two) == 20 * RESULTS);
    let (one, two) = (counted(&one), counted(&two));
    assert_eq!(one.len() + two.len(), 20);
    assert!(
        one.len() > 3 && two.len() > 3,
        "{} and {}",
        one.len(),
        two.len()
    );
    assert!(one.iter().all(|head| !two.contains(head)));
}

#[test]
fn what_a_head_deleted_before_it_was_asked_is_a_gap() {
    let options = [
        "--rate",
        "100",
        "--backlog",
        "100",
        "--results",
        "100",
        "--kept",
        "20",
    ];
    let plant = Plant::of(2, &options);
    let place = Place::new(&[&plant.heads()], "");
    for times in 1..=2 {
        // A second collector finds the same.
        let collector = place.collect(&place.store(), &[]);
        wait("a collector", || {
            place.log().matches("2 heads are asked").count() == times
        });
        wait("what is kept", || {
            counted(&place).iter().map(|(_, count)| count).sum::<i64>() == 40
        });
        assert_eq!(collector.terminate(), Some(0));
        let gaps = numbers(
            &place,
            "SELECT serial || ' ' || first, last FROM gap ORDER BY serial",
        );
        assert_eq!(gaps, [("SIM00001 1".into(), 80), ("SIM00002 1".into(), 80)]);
    }
    assert!(
        place.log().contains("results 1 to 80 were deleted"),
        "{}",
        place.log()
    );
}

#[test]
fn views_have_what_the_values_come_to() {
    let options = ["--rate", "1", "--backlog", "400", "--results", "400"];
    let plant = Plant::of(1, &options);
    let place = Place::new(&[&plant.heads()], "");
    let _collector = place.collect(&place.store(), &[]);
    wait("all results", || {
        counted(&place) == [("SIM00001".into(), 400)]
    });
    let whole = "SELECT 'all', sum(results) FROM yield_";
    for period in ["hour", "day"] {
        assert_eq!(
            numbers(&place, &format!("{whole}{period}")),
            [("all".into(), 400)]
        );
    }
    // Means and numbers by the view against the lines of the head.
    let connection = rusqlite::Connection::open(place.path("plant.db")).unwrap();
    let query = "SELECT count(value), avg(value) FROM gauge_once WHERE slot = 2";
    let (n, mean): (u32, f64) = connection
        .query_row(query, (), |row| Ok((row.get(0)?, row.get(1)?)))
        .unwrap();
    let said = answer(&plant, "/h/0001/api/results?after=0");
    let rows = said
        .lines()
        .skip(1)
        .map(|line| serde_json::from_str::<serde_json::Value>(line).unwrap());
    let rows: Vec<_> = rows.collect();
    let values: Vec<f64> = rows
        .iter()
        .filter_map(|row| row["gauges"][1]["value"].as_f64())
        .collect();
    assert_eq!(n as usize, values.len());
    assert!((mean - values.iter().sum::<f64>() / values.len() as f64).abs() < 1e-9);
    // Every key of a line is a column.
    let keys = rows[0].as_object().unwrap().keys();
    let cells = keys.map(|key| match &**key {
        "placement" | "gauges" => format!("'{key}', json({key})"),
        _ => format!("'{key}', {key}"),
    });
    let cells = cells.collect::<Vec<_>>().join(", ");
    let query = format!("SELECT json_object({cells}) FROM result ORDER BY seq");
    let mut statement = connection.prepare(&query).unwrap();
    let stored = statement.query_map((), |row| row.get::<_, String>(0));
    let stored = stored.unwrap().map(|line| line.unwrap());
    let stored = stored.map(|line| serde_json::from_str::<serde_json::Value>(&line).unwrap());
    assert_eq!(stored.collect::<Vec<_>>(), rows);
}

#[test]
fn a_collector_ends_whose_store_is_deleted_and_the_next_one_fills_it_again() {
    let plant = plant(2);
    let place = Place::new(&[&plant.heads()], "");
    let collector = place.collect(&place.store(), &[]);
    wait("some results", || !counted(&place).is_empty());
    for name in ["plant.db", "plant.db-wal", "plant.db-shm"] {
        let _ = std::fs::remove_file(place.path(name));
    }
    wait("the words", || {
        place.log().contains("was deleted or replaced")
    });
    assert_eq!(collector.ended(), Some(69));
    let collector = place.collect(&place.store(), &[]);
    wait("all results", || is_complete(&place, 2));
    assert_eq!(collector.terminate(), Some(0));
}
