//! Two clients at once: two PLCs that trigger, and a page that changes recipes while a PLC
//! measures.

use crate::page::Browser;
use crate::station_plc::{Daemon, ONLINE, Place, Plc, READY, long, trigger};
use appliance::history::{Filter, Reader};
use appliance::recipe::Store;
use appliance::recipe::file::archive;
use std::collections::BTreeMap;
use std::fs;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use tests::files;
use tests::until::{PATIENCE, until};

/// Number of tokens of each PLC.
const TOKENS: u16 = 12;
/// Number of parts that are measured while the page changes recipes.
const PARTS: u16 = 12;
/// RECIPE_LOAD of CONTROL.
const RECIPE_LOAD: u16 = 1 << 3;

/// Writes a token until it is accepted, which the answer to the same transaction shows.
fn accepted(plc: &mut Plc, words: &[u16; 7], refused: &mut dyn FnMut(&mut Plc)) {
    until("acceptance of the token", PATIENCE, || {
        let status = plc.write_and_read_status(1, words);
        if status.last_token() == words[0] {
            return Ok(());
        }
        refused(plc);
        Err(status)
    });
}

#[test]
fn two_plcs_that_trigger_at_the_same_time_get_one_result_for_each_token() {
    let place = Place::taught();
    let daemon = Daemon::start(&place);
    Plc::connect(&daemon).wait("READY", |status| status.has(READY));
    thread::scope(|scope| {
        for first in [100, 200] {
            let daemon = &daemon;
            scope.spawn(move || {
                let mut plc = Plc::connect(daemon);
                for token in first..first + TOKENS {
                    accepted(&mut plc, &trigger(token), &mut |_| ());
                }
            });
        }
    });
    let mut plc = Plc::connect(&daemon);
    let all = 2 * u32::from(TOKENS);
    let done = plc.wait("the last result", |status| status.seq() == all);
    assert_eq!(done.triggers(), all);
    assert!(done.missed() > 0, "they have not met");
    assert_eq!(daemon.terminate().code(), Some(0));
    let filter = Filter {
        limit: usize::MAX,
        ..Filter::default()
    };
    let results = Reader::of(&place.path("state")).results(&filter).unwrap();
    let mut counts = BTreeMap::new();
    for result in &results {
        *counts.entry(result.token).or_insert(0) += 1;
    }
    let once = |first: u16| (first..first + TOKENS).map(|token| (token, 1));
    assert_eq!(counts, once(100).chain(once(200)).collect());
}

/// A station with the taught recipe as number 1 and as number 2.
fn place_with_two_recipes() -> Place {
    let place = Place::taught();
    let (mut file, arrays) = files::recipe(&fs::read(place.recipe()).unwrap());
    file.number = 2;
    file.part_number = "SECOND".into();
    let (bytes, _) = archive::pack(&file, &arrays).unwrap();
    let store = Store::open(&place.path("state/recipes")).unwrap();
    store.save(2, &bytes).unwrap();
    place
}

/// Selects a recipe by an edge of RECIPE_LOAD.
fn select(plc: &mut Plc, number: u16) {
    plc.write(0, &[ONLINE, 0, number]);
    plc.write(0, &[ONLINE | RECIPE_LOAD, 0, number]);
}

#[test]
fn a_part_is_measured_under_the_recipe_that_the_plc_selects_while_the_page_loads_others() {
    let place = place_with_two_recipes();
    let daemon = Daemon::start(&place);
    let mut browser = Browser::new(&daemon);
    browser.sign_in(&daemon);
    let mut plc = Plc::connect(&daemon);
    plc.wait("READY", |status| status.has(READY));
    let ended = AtomicBool::new(false);
    let (mut refusals, mut loaded) = (0, 0);
    thread::scope(|scope| {
        let ended = &ended;
        let page = scope.spawn(move || {
            let mut loaded = 0;
            while !ended.load(Ordering::Relaxed) {
                for number in [1, 2] {
                    let (status, answer) =
                        browser.ask("POST", &format!("/api/recipes/{number}/load"), &[]);
                    let words = String::from_utf8_lossy(&answer).into_owned();
                    assert!(
                        status < 300 || status == 409 || status == 503,
                        "{status}: {words}"
                    );
                    loaded += usize::from(status < 300);
                }
            }
            loaded
        });
        let measured = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
            for token in 1..=PARTS {
                let number = 1 + token % 2;
                select(&mut plc, number);
                let mut words = trigger(token);
                words[1] = number;
                accepted(&mut plc, &words, &mut |plc| {
                    refusals += 1;
                    select(plc, number);
                });
                let result = plc.result(token);
                assert_eq!(
                    result[3],
                    number,
                    "token {token}, result {}",
                    long(&result, 0)
                );
            }
        }));
        ended.store(true, Ordering::Relaxed);
        loaded = page.join().unwrap();
        if let Err(panic) = measured {
            std::panic::resume_unwind(panic);
        }
    });
    println!("{PARTS} parts, {refusals} triggers refused, {loaded} loads by the page");
    assert!(
        refusals > 0 && loaded > 0,
        "they have not met: {refusals} {loaded}"
    );
    assert_eq!(daemon.terminate().code(), Some(0));
}
