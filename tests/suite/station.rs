//! The daemon as a PLC sees it: the real program, a real socket, and real time.

use crate::station_plc::{
    BUSY, Daemon, EXPOSURE_DONE, ONLINE, Place, Plc, READY, RECIPE_OK, RESULT_ACK, RESULT_TOGGLE,
    RESULT_VALID, Status, TRIGGER, TRIGGER_ACK, long, trigger,
};
use std::fs;
use std::path::Path;
use tokio_modbus::ExceptionCode;
use tokio_modbus::client::Writer as _;

/// Values of VERDICT and RECIPE_RESULT.
const PASS: u16 = 1;
const CORRUPT: u16 = 2;

/// Checks everything that is the same in every result of a good part.
fn check_pass(words: &[u16], status: &Status) {
    assert_eq!(words.len(), 120);
    assert_eq!(long(words, 0), long(words, 118), "SEQ at both ends");
    assert_eq!(long(words, 0), status.seq());
    assert_eq!(words[8], PASS, "error {}", words[9]);
    assert_eq!(words[3], status.active_recipe());
    assert_eq!(long(words, 4), status.crc());
    let gauges = u32::from(words[27]);
    assert!((1..=16).contains(&gauges));
    assert_eq!(long(words, 10), (1 << gauges) - 1, "every gauge passes");
    assert_eq!(long(words, 12), (1 << gauges) - 1, "every gauge is valid");
    let deviation = f32::from_bits(long(words, 64));
    assert!(deviation.is_finite() && deviation.abs() < 0.25);
}

#[test]
fn a_good_part_passes_by_the_edge_handshake() {
    let place = Place::taught();
    let daemon = Daemon::start(&place);
    let mut plc = Plc::connect(&daemon);
    let before = plc.wait("READY", |status| status.has(READY | RECIPE_OK));
    // The first write of a connection sets the initial level for edges.
    plc.write(0, &[ONLINE]);
    let mut fields = vec![ONLINE | TRIGGER];
    fields.extend(trigger(0));
    let after = plc.write_and_read_status(0, &fields);
    assert!(after.has(BUSY | TRIGGER_ACK) && !after.has(READY));
    assert_eq!(after.bits() & (EXPOSURE_DONE | RESULT_VALID), 0);
    plc.write(0, &fields);
    plc.write(0, &[ONLINE]);
    plc.wait("EXPOSURE_DONE", |status| status.has(EXPOSURE_DONE));
    let done = plc.wait("result", |status| status.seq() != before.seq());
    assert!(done.has(READY | RESULT_VALID) && !done.has(TRIGGER_ACK));
    assert_eq!((done.bits() ^ before.bits()) & RESULT_TOGGLE, RESULT_TOGGLE);
    assert_eq!(done.seq(), before.seq() + 1);
    assert_eq!(done.triggers(), before.triggers() + 1);
    assert_eq!(done.missed(), before.missed());
    let words = plc.read(200, 120).unwrap();
    check_pass(&words, &done);
    assert_eq!(words[2], 0, "an edge has no token");
    assert_eq!((long(&words, 6), long(&words, 28)), (0x10000, 0x20000));
    plc.write(0, &[ONLINE | RESULT_ACK]);
    assert!(!plc.status().has(RESULT_VALID));
}

#[test]
fn a_retried_token_measures_once_and_refused_requests_change_nothing() {
    let place = Place::taught();
    let daemon = Daemon::start(&place);
    let mut plc = Plc::connect(&daemon);
    let before = plc.wait("READY", |status| status.has(READY));
    let after = plc.write_and_read_status(1, &trigger(77));
    assert!(after.has(BUSY));
    assert_eq!(after.last_token(), 77);
    plc.write(1, &trigger(77));
    let words = plc.measure(77);
    plc.write(1, &trigger(77));
    // Another connection that repeats the same write gets the same answer.
    Plc::connect(&daemon).write(1, &trigger(77));
    let done = plc.wait("READY", |status| status.has(READY));
    check_pass(&words, &done);
    assert_eq!((long(&words, 6), long(&words, 28)), (0x1004D, 0x2004D));
    assert_eq!((done.seq(), done.triggers()), (before.seq() + 1, 1));
    assert_eq!(done.missed(), 0);
    for (address, count) in [(40, 1), (120, 20), (1190, 1)] {
        assert_eq!(
            plc.read(address, count),
            Err(ExceptionCode::IllegalDataAddress)
        );
    }
    let reserved = plc.context.write_multiple_registers(0, &[ONLINE | 1 << 9]);
    assert_eq!(
        plc.runtime.block_on(reserved).unwrap(),
        Err(ExceptionCode::IllegalDataValue)
    );
    assert_eq!(plc.status().triggers(), 1);
}

#[test]
fn counters_go_on_and_the_recipe_stays_after_a_restart_and_after_kill_9() {
    let place = Place::new();
    let daemon = Daemon::start(&place);
    assert!(daemon.log.contains("taught recipe 1"), "{}", daemon.log);
    let mut plc = Plc::connect(&daemon);
    let words = plc.measure(5);
    let first = plc.status();
    check_pass(&words, &first);
    assert_eq!(first.seq(), 1);
    let taught = fs::read(place.recipe()).unwrap();
    assert_eq!(daemon.terminate().code(), Some(0));

    let daemon = Daemon::start(&place);
    assert!(!daemon.log.contains("taught"), "{}", daemon.log);
    let mut plc = Plc::connect(&daemon);
    let second = plc.wait("READY", |status| status.has(READY | RECIPE_OK));
    assert_eq!(second.seq(), 1, "RESULT_SEQ goes on");
    assert_eq!((second.last_token(), second.triggers()), (0, 0));
    assert_ne!(second.boot_id(), first.boot_id());
    assert_eq!(second.crc(), first.crc());
    // The same token as before the restart triggers again.
    assert_eq!(long(&plc.measure(5), 0), 2);
    // Killed during a cycle: at most the SEQ of this cycle is skipped.
    plc.write(1, &trigger(6));
    daemon.kill();

    let daemon = Daemon::start(&place);
    let mut plc = Plc::connect(&daemon);
    let third = plc.wait("READY", |status| status.has(READY | RECIPE_OK));
    assert!((2..=3).contains(&third.seq()), "{}", third.seq());
    assert_eq!(third.last_token(), 0);
    assert_ne!(third.boot_id(), second.boot_id());
    let words = plc.measure(5);
    assert_eq!(long(&words, 0), third.seq() + 1);
    check_pass(&words, &plc.status());
    assert_eq!(fs::read(place.recipe()).unwrap(), taught);
}

/// Changes a byte in the middle of a file.
fn damage(path: &Path) {
    let mut bytes = fs::read(path).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 0x10;
    fs::write(path, bytes).unwrap();
}

#[test]
fn a_damaged_recipe_gives_way_to_the_generation_before_it_and_the_daemon_says_so() {
    let place = Place::taught();
    let daemon = Daemon::start(&place);
    let crc = Plc::connect(&daemon).status().crc();
    daemon.kill();
    let previous = place.path("state/recipes/0001.recipe.previous");
    fs::copy(place.recipe(), previous).unwrap();
    damage(&place.recipe());
    let daemon = Daemon::start(&place);
    assert!(daemon.log.contains("0001.recipe"), "{}", daemon.log);
    assert!(
        daemon.log.contains("the previous generation is used"),
        "{}",
        daemon.log
    );
    let mut plc = Plc::connect(&daemon);
    let words = plc.measure(9);
    let status = plc.status();
    assert_eq!(status.crc(), crc);
    check_pass(&words, &status);
}

#[test]
fn without_a_usable_generation_the_daemon_serves_and_says_corrupt() {
    let place = Place::taught();
    damage(&place.recipe());
    let daemon = Daemon::start(&place);
    assert!(daemon.log.contains("0001.recipe"), "{}", daemon.log);
    let mut plc = Plc::connect(&daemon);
    let status = plc.wait("RECIPE_RESULT", |status| status.recipe_result() == CORRUPT);
    assert!(!status.has(RECIPE_OK) && !status.has(READY));
    assert_eq!(status.active_recipe(), 0);
    // A trigger is rejected: there is no recipe (REJECT_REASON 3).
    let rejected = plc.write_and_read_status(1, &trigger(3));
    assert_eq!((rejected.triggers(), rejected.missed()), (0, 1));
    assert_eq!(rejected.0[20], 3);
    assert_eq!(daemon.terminate().code(), Some(0));
}
