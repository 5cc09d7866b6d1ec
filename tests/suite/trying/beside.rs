//! An editor that tries all the time beside a station that measures.

use super::{TRY, list};
use crate::commissioning::median;
use crate::page::Browser;
use crate::station_plc::{Daemon, Place, Plc, long};
use serde_json::{Value, json};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// Circles that are tried.
const CIRCLES: usize = 32;
/// Blocks of cycles with and without an editor, by turns.
const BLOCKS: u16 = 20;
const CYCLES: u16 = 15;
/// By how much a cycle may end later.
const LATER: f64 = 0.05;

/// The list of a recipe with so many circles more, each about a hole that golden has.
fn many_circles(recipe: &Value) -> Value {
    let mut edit = list(recipe);
    let features = edit["features"].as_array().unwrap().iter();
    let circles: Vec<Value> = features
        .filter(|of| of["kind"] == "circle")
        .cloned()
        .collect();
    let features = edit["features"].as_array_mut().unwrap();
    for (at, circle) in (circles.len()..CIRCLES).zip(circles.iter().cycle()) {
        let name = format!("circle {at}");
        features.push(json!({ "name": name, "kind": "circle", "region": circle["region"] }));
    }
    edit
}

#[test]
#[ignore = "measures times; run it alone: cargo test -p tests --test suite -- --ignored --nocapture trying::"]
fn a_cycle_is_hardly_later_while_an_editor_tries() {
    let place = Place::taught_before("sub_rays = 2\n\n[part]\nkind = \"plate\"\n");
    let daemon = Daemon::start(&place);
    let mut browser = Browser::new(&daemon);
    browser.sign_in(&daemon);
    let edit = many_circles(&browser.get("/api/recipes/1"));
    let mut plc = Plc::connect(&daemon);
    // From the trigger, and from the last exposure, to the result, ms.
    let mut block = |first: u16| {
        let times = (first..first + CYCLES).map(|token| {
            let words = plc.measure(token);
            let [exposed, whole] = [18, 20].map(|at| f64::from(long(&words, at)) / 1000.0);
            (whole, whole - exposed)
        });
        let (whole, processed) = times.unzip();
        [median(whole), median(processed)]
    };
    block(1);
    let (stop, mut tries) = (AtomicBool::new(false), Vec::new());
    let (mut alone, mut later) = ([vec![], vec![]], [vec![], vec![]]);
    for number in 0..BLOCKS {
        let first = 100 + 2 * CYCLES * number;
        let quiet = block(first);
        stop.store(false, Ordering::Relaxed);
        let beside = std::thread::scope(|scope| {
            scope.spawn(|| {
                while !stop.load(Ordering::Relaxed) {
                    let began = Instant::now();
                    assert_eq!(browser.json("POST", TRY, &edit).0, 200);
                    tries.push(began.elapsed().as_secs_f64() * 1000.0);
                }
            });
            let beside = block(first + CYCLES);
            stop.store(true, Ordering::Relaxed);
            beside
        });
        for at in 0..2 {
            alone[at].push(quiet[at]);
            later[at].push(beside[at] / quiet[at] - 1.0);
        }
    }
    let count = tries.len();
    let [alone, later] = [alone, later].map(|both| both.map(median));
    println!(
        "a cycle of {:.0} ms ends {:+.1} % later, its processing of {:.1} ms {:+.1} %; {count} tries of {:.0} ms",
        alone[0],
        100.0 * later[0],
        alone[1],
        100.0 * later[1],
        median(tries)
    );
    assert!(later[0] <= LATER, "{later:?}");
}
