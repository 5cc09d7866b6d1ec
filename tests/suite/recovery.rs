//! Faults that come and go while the daemon runs: cables, storage, a PLC that aborts.

use crate::page::Browser;
use crate::station_plc::{
    Daemon as Program, ONLINE, Place, Plc, READY, RECIPE_OK, SMALL_HEAD, Status, long, trigger,
};
use appliance::config::Config;
use appliance::head::calibration::Calibration;
use appliance::history::seqs::AHEAD;
use appliance::recipe::teach::{Naming, TeachError, teach};
use appliance::service::{Caller, Daemon};
use appliance::station::{ConnectionEdges, ControlWrite, Event, Masked, Request, Teaching};
use appliance::system::headway::Headway;
use appliance::system::progress::Progress;
use hal::error::DeviceKind;
use sim::Scenario;
use std::fs;
use std::sync::Mutex;
use tests::until::{PATIENCE, until};

/// Values of VERDICT, STATE and REJECT_REASON.
pub(crate) const PASS: u16 = 1;
const INVALID: u16 = 3;
const FAULT: u16 = 7;
const REJECTED_BY_FAULT: u16 = 5;
/// ABORT in CONTROL.
pub(crate) const ABORT: u16 = 1 << 5;

pub(crate) fn start(place: &Place) -> Daemon {
    let daemon = starting(place);
    daemon.wait_until_ready().unwrap();
    daemon
}

pub(crate) fn starting(place: &Place) -> Daemon {
    let mut config = Config::read(&place.path("fringed.toml")).unwrap();
    config.modbus.listen = "127.0.0.1:0".parse().unwrap();
    config.http.listen = config.modbus.listen;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    Daemon::start(
        &config,
        pool.unwrap(),
        Progress::new(true),
        &Caller::default(),
    )
    .unwrap()
}

fn state(status: &Status) -> u16 {
    status.0[4]
}

fn error_code(status: &Status) -> u16 {
    status.0[2]
}

#[test]
fn a_device_that_is_unplugged_is_a_fault_that_names_it_and_ends_when_it_is_plugged_in_again() {
    let place = Place::taught();
    let daemon = start(&place);
    let stage = daemon.stage.clone().unwrap();
    let mut plc = Plc::at(daemon.modbus);
    assert_eq!(plc.measure(1)[8], PASS);
    let before = plc.status();
    for (triggers, device, code) in [
        (1, DeviceKind::Camera, 101),
        (2, DeviceKind::Projector, 201),
    ] {
        stage.unplug(device);
        let lost = plc.wait("the fault", |status| state(status) == FAULT);
        assert_eq!((error_code(&lost), lost.has(READY)), (code, false));
        let fault = daemon.station.snapshot().fault.clone().unwrap();
        assert!(fault.cause.contains(device.word()), "{fault:?}");
        assert!(fault.remedy.contains("cable"), "{fault:?}");
        let rejected = plc.write_and_read_status(1, &trigger(50));
        assert_eq!(
            (rejected.triggers(), rejected.0[20]),
            (triggers, REJECTED_BY_FAULT)
        );
        // The measuring task runs, although its head is gone.
        let beat = plc.status().0[1];
        plc.wait("the heartbeat", |status| status.0[1] != beat);
        stage.plug(device);
        let back = plc.wait("READY", |status| status.has(READY | RECIPE_OK));
        assert_eq!((error_code(&back), back.crc()), (0, before.crc()));
        assert_eq!(plc.measure(code)[8], PASS);
    }
    daemon.stop();
}

#[test]
fn a_trigger_that_meets_a_dead_camera_ends_in_one_invalid_result_or_is_rejected() {
    let place = Place::taught();
    let daemon = start(&place);
    let stage = daemon.stage.clone().unwrap();
    let mut plc = Plc::at(daemon.modbus);
    let mut met = 0;
    for token in 1..=10 {
        plc.wait("READY", |status| status.has(READY));
        let before = plc.status();
        stage.unplug(DeviceKind::Camera);
        plc.write(1, &trigger(token));
        let lost = plc.wait("the fault", |status| state(status) == FAULT);
        assert_eq!(
            lost.seq() - before.seq(),
            lost.triggers() - before.triggers()
        );
        if lost.seq() != before.seq() {
            let words = plc.read(200, 120).unwrap();
            assert_eq!((words[2], words[8], words[9]), (token, INVALID, 101));
            met += 1;
        }
        stage.plug(DeviceKind::Camera);
    }
    assert!(met > 0, "no trigger came before the loss was noticed");
    assert_eq!(plc.measure(99)[8], PASS);
    daemon.stop();
}

#[test]
fn an_abort_ends_a_sequence_between_two_frames_with_one_invalid_result() {
    let place = Place::taught();
    let daemon = start(&place);
    let mut plc = Plc::at(daemon.modbus);
    plc.write(0, &[ONLINE]);
    let mut aborted = 0;
    for token in 1..=20 {
        plc.wait("READY", |status| status.has(READY));
        plc.write(1, &trigger(token));
        plc.write(0, &[ONLINE | ABORT]);
        plc.write(0, &[ONLINE]);
        let words = plc.result(token);
        assert_eq!(long(&words, 0), u32::from(token));
        match (words[8], words[9]) {
            (INVALID, 802) => aborted += 1,
            (PASS, 0) => {}
            other => panic!("verdict and error {other:?}"),
        }
    }
    assert!(aborted > 0, "every sequence was faster than its abort");
    daemon.stop();
}

#[test]
fn an_abort_ends_a_teach_and_the_recipe_before_it_goes_on() {
    let place = Place::taught();
    let daemon = start(&place);
    let mut plc = Plc::at(daemon.modbus);
    plc.write(0, &[ONLINE]);
    let before = plc.status();
    let request = Event::Request(Request::Teach(Teaching::of(2)));
    assert_eq!(daemon.station.event(request).state_word, "teaching");
    plc.write(0, &[ONLINE | ABORT]);
    let ended = plc.wait("READY", |status| status.has(READY | RECIPE_OK));
    assert_eq!((error_code(&ended), ended.crc()), (802, before.crc()));
    assert!(!place.path("state/recipes/0002.recipe").exists());
    assert_eq!(plc.measure(1)[8], PASS);
    daemon.stop();
}

#[test]
fn a_teach_that_is_ended_does_no_further_step() {
    let scenario = Scenario::from_toml(SMALL_HEAD, "small head").unwrap();
    let (mut head, stage) = sim::head(&scenario).unwrap();
    let calibration = Calibration::of_scenario(stage.scenario()).unwrap();
    let naming = Naming {
        number: 1,
        part_number: "PART".into(),
        name: "part".into(),
        taught_by: String::new(),
        taught_at_unix_s: 0,
        placement_tolerance_mm: 1.0,
        exposures: None,
        everything: false,
        marking: Default::default(),
        empty: None,
        limit_mm: Some(0.15),
    };
    let told = Mutex::new(Vec::new());
    let progress = |share: f64, _: &str| {
        told.lock().unwrap().push(share);
        share < 0.3
    };
    let headway = Headway::new(&progress, "teaching");
    let ended = teach(&mut head, &calibration, &naming, PATIENCE, headway);
    assert!(matches!(ended, Err(TeachError::Ended)), "{ended:?}");
    let told = told.into_inner().unwrap();
    assert_eq!(told.last(), Some(&0.3), "{told:?}");
}

#[test]
fn a_result_counter_that_cannot_be_stored_stops_the_station_until_it_can() {
    let place = Place::new();
    let daemon = Program::start(&place);
    let mut plc = Plc::connect(&daemon);
    plc.measure(1);
    let counter = place.counter_that_hangs();
    let mut last = 1;
    while state(&plc.status()) != FAULT {
        last += 1;
        assert_eq!(plc.measure(last)[8], PASS);
        assert!(u32::from(last) <= AHEAD, "more numbers than were reserved");
    }
    let snapshot = Browser::new(&daemon).get("/api/snapshot");
    let words = snapshot["fault"].to_string();
    assert!(
        words.contains("is busy") && !words.contains("replace"),
        "{words}"
    );
    drop(fs::File::open(&counter).unwrap());
    plc.wait("READY", |status| status.has(READY | RECIPE_OK));
    let reserved = || -> Option<u32> {
        let text = fs::read_to_string(&counter).ok()?;
        text.split_whitespace().next()?.parse().ok()
    };
    // Until enough are reserved that no more are requested.
    until("reserved numbers", PATIENCE, || match reserved() {
        ahead if ahead <= Some(u32::from(last) + AHEAD / 4 * 3) => Err(ahead),
        _ => Ok(()),
    });
    // A folder in place of the counter's file: no write can replace it.
    fs::remove_file(&counter).unwrap();
    fs::create_dir_all(counter.join("in the way")).unwrap();
    // It uses exactly the reserved numbers.
    let broken = loop {
        let words = plc.measure(last + 1);
        last += 1;
        assert_eq!((long(&words, 0), words[8]), (u32::from(last), PASS));
        assert!(u32::from(last) <= 3 * AHEAD, "no fault");
        let status = plc.status();
        if state(&status) == FAULT {
            break status;
        }
    };
    assert_eq!((error_code(&broken), broken.has(READY)), (603, false));
    let rejected = plc.write_and_read_status(1, &trigger(last + 1));
    assert_eq!(rejected.triggers(), u32::from(last));
    assert!(long(&plc.read(614, 2).unwrap(), 0) > 0, "STORAGE_ERRORS");
    fs::remove_dir_all(&counter).unwrap();
    plc.wait("READY", |status| status.has(READY | RECIPE_OK));
    assert!(reserved() >= Some(u32::from(last)), "{:?}", reserved());
    assert_eq!(long(&plc.measure(last + 1), 0), u32::from(last) + 1);
}

#[test]
fn a_start_ends_also_where_the_plc_asks_for_another_recipe_or_is_offline() {
    let place = Place::taught();
    let select = ControlWrite {
        recipe_select: Some(77),
        ..ControlWrite::default()
    };
    let offline = ControlWrite {
        control: Masked::<u16>::all(0),
        ..ControlWrite::default()
    };
    for (write, reason) in [(select, 6), (offline, 2)] {
        let daemon = starting(&place);
        let mut edges = ConnectionEdges::default();
        daemon.station.write(&mut edges, write).unwrap();
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_all()
            .build()
            .unwrap();
        let settled =
            runtime.block_on(async { tokio::time::timeout(PATIENCE, daemon.settled()).await });
        let snapshot = settled.expect("the start ends").unwrap();
        assert_eq!(
            (snapshot.active(), snapshot.refusal),
            (Some(1), Some(reason))
        );
        daemon.stop();
    }
}

#[test]
fn starts_are_counted_and_a_kill_is_seen_at_the_next_one() {
    let place = Place::taught();
    let boots = |program: &Program| {
        let mut plc = Plc::connect(program);
        // The survey runs in its own thread.
        until("survey", PATIENCE, || {
            let words = plc.read(616, 4).unwrap();
            match long(&words, 0) {
                0 => Err(()),
                starts => Ok((starts, long(&words, 2))),
            }
        })
    };
    let first = Program::start(&place);
    assert_eq!(boots(&first), (1, 0));
    first.terminate();
    let second = Program::start(&place);
    assert_eq!(boots(&second), (2, 0));
    second.kill();
    assert_eq!(boots(&Program::start(&place)), (3, 1));
}
