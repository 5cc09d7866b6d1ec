//! Deadlines, faults, signs of life, time.

use super::*;

#[test]
fn every_wait_has_a_deadline_and_a_missed_one_is_a_fault_that_says_how_to_clear_it() {
    type Prepare = fn(&mut Bench);
    let waits: [(u16, Prepare); 4] = [
        (2, |bench| {
            bench.token(1);
        }),
        (3, |bench| {
            bench.token(1);
            let job = bench.job();
            bench.event(Event::ExposureDone { job });
        }),
        (4, |bench| {
            bench.event(Event::Request(Request::Load(RecipeKey::Number(2))));
        }),
        (5, |bench| {
            bench.event(Event::Request(Request::Teach { number: 2 }));
        }),
    ];
    for (state, prepare) in waits {
        let mut bench = Bench::ready();
        prepare(&mut bench);
        let job = bench.job();
        let before = bench.station.snapshot();
        assert_eq!(before.state, state);
        let snapshot = bench.tick_after(31_000);
        assert_eq!(
            (snapshot.state, snapshot.error_code),
            (7, error_code::DEADLINE),
            "state {state}"
        );
        let fault = snapshot.fault.clone().expect("a fault");
        assert!(
            fault.cause.contains("ms") && fault.remedy.contains("ERROR_RESET"),
            "{fault:?}"
        );
        assert_eq!(
            snapshot.heartbeat, before.heartbeat,
            "a hanging worker's heart stands still"
        );
        assert!(!snapshot.worker_alive);
        assert_eq!(bench.token(50).reject_reason, reject::FAULT);
        assert_eq!(
            bench.pulse(control::ERROR_RESET).state,
            7,
            "not before the worker lives again"
        );
        bench.event(Event::Finished {
            job,
            inspection: good(),
        });
        let snapshot = bench.pulse(control::ERROR_RESET);
        assert_eq!((snapshot.state, snapshot.error_code), (1, 0));
        let results = u32::from(state < 4);
        assert_eq!(
            snapshot.result_seq,
            40 + results,
            "the cycle ended once, the late answer was ignored"
        );
    }
    let mut bench = Bench::booting_with(settings());
    assert_eq!(bench.tick_after(31_000).state, 7);
    assert_eq!(
        bench.event(Event::Started).state,
        1,
        "a slow boot is still a boot"
    );
}

#[test]
fn a_broken_device_is_a_fault_until_it_recovers() {
    let mut bench = Bench::ready();
    bench.token(1);
    let fault = Event::Faulted {
        error_code: 101,
        cause: "camera unplugged".into(),
        remedy: "plug it in".into(),
    };
    let snapshot = bench.event(fault);
    assert_eq!(
        (
            snapshot.state,
            snapshot.error_code,
            snapshot.is(status::ONLINE)
        ),
        (7, 101, true)
    );
    assert_eq!(
        snapshot.result.map(|result| result.error_code),
        Some(101),
        "the cycle in flight ended with it"
    );
    assert_eq!(bench.pulse(control::ERROR_RESET).state, 7);
    let snapshot = bench.event(Event::Recovered);
    assert!(snapshot.is(status::READY));
}

#[test]
fn the_heartbeat_counts_tenths_of_a_second_while_the_worker_lives() {
    let mut bench = Bench::ready();
    let start = bench.station.snapshot().heartbeat;
    for _ in 0..20 {
        bench.event(Event::Alive);
        bench.tick_after(100);
    }
    let alive = bench.station.snapshot().heartbeat.wrapping_sub(start);
    assert!((20..=21).contains(&alive), "{alive} beats in 2 s");
    bench.tick_after(1_500);
    let silent = bench.station.snapshot();
    assert!(!silent.worker_alive);
    assert_eq!(
        bench.tick_after(1_500).heartbeat,
        silent.heartbeat,
        "it stands still when the worker is silent"
    );
    bench.event(Event::Alive);
    assert_eq!(
        bench.tick_after(150).heartbeat,
        silent.heartbeat.wrapping_add(1),
        "missed beats are not made up for"
    );
}

#[test]
fn a_plc_heartbeat_that_stands_still_is_a_warning_once_it_was_used() {
    let mut bench = Bench::ready();
    let lost = |snapshot: &Snapshot| snapshot.warnings & warning::PLC_LOST != 0;
    assert!(
        !lost(&bench.tick_after(60_000)),
        "a PLC that never used it is not lost"
    );
    bench.write(ControlWrite {
        plc_heartbeat: Some(1),
        ..Default::default()
    });
    assert!(!lost(&bench.tick_after(4_000)));
    bench.write(ControlWrite {
        plc_heartbeat: Some(1),
        ..Default::default()
    });
    let snapshot = bench.tick_after(2_000);
    assert!(
        lost(&snapshot) && snapshot.is(status::WARNING),
        "the same value is no change"
    );
    assert!(!lost(&bench.write(ControlWrite {
        plc_heartbeat: Some(2),
        ..Default::default()
    })));
}

#[test]
fn the_time_of_a_result_is_that_of_its_trigger_and_0_without_a_synchronised_clock() {
    let mut bench = Bench::ready();
    bench.token(1);
    assert_eq!(
        bench.finish().result.map(|result| result.time_utc_us),
        Some(0)
    );
    let zero = 1_700_000_000_000_000;
    let utc_us = Some(zero + bench.now.0 + 10);
    assert_eq!(
        bench.event(Event::Tick { utc_us }).warnings & warning::CLOCK_UNSYNCED,
        0
    );
    bench.token(2);
    let triggered = bench.now;
    let result = bench.finish().result.expect("a result");
    assert_eq!(
        (result.time_utc_us, result.exposure_us, result.total_us),
        (zero + triggered.0, 10, 20)
    );
}

#[test]
fn stopping_aborts_and_still_takes_the_result_in_flight() {
    let mut bench = Bench::ready();
    bench.token(1);
    let job = bench.job();
    assert_eq!(bench.event(Event::Stop).state, 8);
    assert!(bench.effects.contains(&Effect::Abort { job }));
    assert_eq!(bench.token(2).reject_reason, reject::NOT_READY);
    let snapshot = bench.event(Event::Finished {
        job,
        inspection: good(),
    });
    assert_eq!((snapshot.state, snapshot.result_seq), (8, 41));
}

#[test]
fn a_missed_deadline_is_not_cleared_by_the_recovery_of_a_device_and_a_new_worker_holds_no_recipe() {
    let mut bench = Bench::ready();
    bench.token(1);
    assert_eq!(bench.tick_after(31_000).state, 7);
    assert_eq!(bench.event(Event::Recovered).state, 7);
    let snapshot = bench.event(Event::Started);
    assert_eq!((snapshot.state, snapshot.recipe), (1, None));
}
