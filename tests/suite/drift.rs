//! The check of the geometry that the station makes by itself: after a teach, and between cycles.

use crate::page::Browser;
use crate::station_plc::{Daemon, Place, Plc, command};
use serde_json::Value;
use std::fs;
use std::time::{Duration, Instant};
use tests::until::{PATIENCE, until};

/// WARNING, bit 9.
const GEOMETRY: u16 = 1 << 9;
/// Cycles between two checks.
const CYCLES: u16 = 3;
/// The station rests for this long before it checks.
const REST: Duration = Duration::from_millis(1000);
/// Longest wait of a trigger for the measuring task, on a busy computer.
const MOST_WAITED_US: u64 = 150_000;

fn place(scenario: &str) -> Place {
    let place = Place::before(scenario);
    checked_every(&place, CYCLES);
    place
}

fn checked_every(place: &Place, cycles: u16) {
    let config = format!(
        "state = \"state\"\n[station]\ngeometry_check_cycles = {cycles}\n[head]\nscenario = \"small.toml\"\n"
    );
    fs::write(place.path("fringed.toml"), config).unwrap();
}

fn drift(browser: &mut Browser) -> Value {
    browser.get("/api/head")["drift"].clone()
}

fn checks(drift: &Value) -> usize {
    drift["trend"].as_array().map_or(0, Vec::len)
}

/// The drift once there were so many checks.
fn after(browser: &mut Browser, count: usize) -> Value {
    until("check", PATIENCE, || {
        let found = drift(browser);
        match checks(&found) >= count {
            true => Ok(found),
            false => Err(found),
        }
    })
}

/// WARNING and DRIFT.
fn registers(plc: &mut Plc) -> (u16, u16) {
    (plc.status().0[3], plc.read(637, 1).unwrap()[0])
}

fn run(plc: &mut Plc, tokens: std::ops::RangeInclusive<u16>) {
    for token in tokens {
        assert_eq!(plc.measure(token)[8], 1, "a good part");
    }
}

#[test]
fn a_knocked_head_is_found_after_its_cycles_and_named_with_the_remedy_and_a_good_one_is_not() {
    const HEAD: &str = "sub_rays = 2\n\n[rig.camera]\nwidth = 160\nheight = 160\n";
    let place = place(HEAD);
    // A head that is well: the teach checks it, and so does the station after its cycles.
    let daemon = Daemon::start(&place);
    let (mut plc, mut browser) = (Plc::connect(&daemon), Browser::new(&daemon));
    run(&mut plc, 1..=CYCLES - 1);
    std::thread::sleep(REST + REST / 2);
    let taught = drift(&mut browser);
    assert_eq!(taught["trend"].as_array().unwrap().len(), 1, "{taught}");
    run(&mut plc, CYCLES..=CYCLES);
    let well = after(&mut browser, 2);
    assert_eq!(
        (&well["drifted"], &well["remedy"]),
        (&false.into(), &Value::Null)
    );
    assert!(well["epipolar_px"].as_f64().unwrap() < 0.1, "{well}");
    let (warnings, thousandths) = registers(&mut plc);
    assert!(warnings & GEOMETRY == 0 && thousandths < 100);
    assert!(daemon.terminate().success());

    // Somebody knocks the camera: the recipe still loads, and nothing is known of the knock before
    // the cycles are over.
    fs::write(
        place.path("small.toml"),
        format!("{HEAD}knocked_deg = [0.05, 0.0, 0.0]\n"),
    )
    .unwrap();
    let daemon = Daemon::start(&place);
    let (mut plc, mut browser) = (Plc::connect(&daemon), Browser::new(&daemon));
    // Its heights are wrong, so parts fail.
    (1..CYCLES).for_each(|token| drop(plc.measure(token)));
    std::thread::sleep(REST + REST / 2);
    assert_eq!(drift(&mut browser), well);
    plc.measure(CYCLES);
    let found = after(&mut browser, 4);
    let off = found["epipolar_px"].as_f64().unwrap();
    assert!((0.5..2.0).contains(&off), "{found}");
    assert_eq!(found["drifted"], true, "{found}");
    assert!(
        found["remedy"].as_str().unwrap().contains("calibrate"),
        "{found}"
    );
    let thousandths = until("warning on the bus", PATIENCE, || {
        let (warnings, thousandths) = registers(&mut plc);
        match warnings & GEOMETRY {
            0 => Err(warnings),
            _ => Ok(thousandths),
        }
    });
    assert!((f64::from(thousandths) - 1000.0 * off).abs() <= 1.0);
    let snapshot = browser.get("/api/snapshot");
    assert!(
        snapshot["warnings"]
            .as_array()
            .unwrap()
            .contains(&"geometry".into())
    );
    assert_eq!(snapshot["health"]["drift_px"], found["epipolar_px"]);
    let log = browser.get("/api/log").to_string();
    assert!(
        log.contains("knocked") && log.contains("calibrate the geometry anew"),
        "{log}"
    );
    let (status, metrics) = browser.ask("GET", "/metrics", &[]);
    let metrics = String::from_utf8(metrics).unwrap();
    assert!(
        status == 200 && metrics.contains("fringed_drift_pixels "),
        "{metrics}"
    );
    // It is a warning: parts are judged all the same. The next start knows it without a check.
    assert_ne!(plc.measure(9)[8], 0);
    assert!(daemon.terminate().success());
    let daemon = Daemon::start(&place);
    let mut plc = Plc::connect(&daemon);
    assert_ne!(registers(&mut plc).0 & GEOMETRY, 0);
    assert_eq!(drift(&mut Browser::new(&daemon)), found);
}

#[test]
fn without_checks_neither_a_teach_nor_a_cycle_makes_one() {
    let place = place("sub_rays = 2\n\n[rig.camera]\nwidth = 160\nheight = 160\n");
    checked_every(&place, 0);
    let daemon = Daemon::start(&place);
    let (mut plc, mut browser) = (Plc::connect(&daemon), Browser::new(&daemon));
    run(&mut plc, 1..=2);
    std::thread::sleep(2 * REST);
    assert_eq!(drift(&mut browser), Value::Null);
    assert_eq!(registers(&mut plc).1, u16::MAX);
}

#[test]
fn a_trigger_ends_a_check_and_is_answered_in_time_with_the_recipes_patterns() {
    // Frames of many rays, so that a check takes long enough to be met.
    let place = place("sub_rays = 6\n\n[rig.camera]\nwidth = 512\nheight = 512\n");
    checked_every(&place, 1);
    let daemon = Daemon::of(command(&place));
    let (mut plc, mut browser) = (Plc::connect(&daemon), Browser::new(&daemon));
    plc.measure(1);
    let done = Instant::now();
    let before = checks(&drift(&mut browser));
    after(&mut browser, before + 1);
    let whole = done.elapsed().saturating_sub(REST);
    let (mut ended, mut longest) = (0, 0);
    for token in 2..10 {
        let before = checks(&drift(&mut browser));
        plc.measure(token);
        // The trigger comes after a part of the check.
        std::thread::sleep(REST + whole * u32::from(token) / 12);
        let result = plc.measure(100 + token);
        assert_eq!(result[8], 1, "the part passes");
        let stages = browser.get("/api/snapshot")["result"]["stages"].clone();
        let mut stages = stages.as_array().unwrap().iter();
        let waited = stages.find(|stage| stage["name"] == "waiting").unwrap();
        longest = longest.max(waited["us"].as_u64().unwrap());
        ended += u32::from(checks(&drift(&mut browser)) == before);
        // What was ended is made up for.
        after(&mut browser, before + 1);
    }
    println!(
        "a check takes {whole:?}; {ended} of 8 were ended, and a trigger waited for {longest} µs at most"
    );
    assert!(ended > 0 && longest <= MOST_WAITED_US);
}
