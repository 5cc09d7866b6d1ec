//! Deadlines, faults, signs of life, time.

use super::*;

fn recovered(recipe: Option<ActiveRecipe>) -> Event {
    Event::Recovered { recipe }
}

#[test]
fn every_wait_has_a_deadline_and_a_missed_one_is_a_fault_that_says_how_to_clear_it() {
    type Prepare = fn(&mut Bench);
    let waits: [(u16, Prepare); 2] = [
        (2, |bench| {
            bench.token(1);
        }),
        (3, |bench| {
            bench.token(1);
            let job = bench.job();
            bench.event(Event::ExposureDone { job });
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
        assert_eq!(
            snapshot.result_seq, 41,
            "the cycle ended once, the late answer was ignored"
        );
    }
    let mut bench = Bench::booting_with(settings());
    for _ in 0..3 {
        assert_eq!(bench.tick_after(29_000).state, 0, "a slow head is no fault");
        bench.event(Event::Alive);
    }
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
    let snapshot = bench.event(recovered(Some(recipe(1))));
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
fn a_silent_load_or_teach_is_a_fault_until_the_task_goes_on_with_it_and_ends_as_it_would_have() {
    type Begin = fn(&mut Bench) -> JobId;
    let begin: [(u16, Begin); 2] = [
        (4, |bench| {
            bench.event(Event::Request(Request::Load(RecipeKey::Number(2))));
            bench.job()
        }),
        (5, |bench| bench.teach(2)),
    ];
    for (state, begin) in begin {
        for goes_on in [true, false] {
            let mut bench = Bench::ready();
            let job = begin(&mut bench);
            assert_eq!(bench.tick_after(29_000).state, state);
            let silent = bench.tick_after(2_000);
            assert_eq!((silent.state, silent.error_code), (7, error_code::DEADLINE));
            assert!(!silent.worker_alive);
            let active = silent.recipe.map(|recipe| recipe.number);
            assert_eq!(active, Some(1), "the recipe before is the active one");
            assert_eq!(bench.pulse(control::ERROR_RESET).state, 7, "still silent");
            if goes_on {
                let progress = bench.event(Event::Progress {
                    job,
                    fraction: 0.5,
                    words: "planning".into(),
                });
                assert_eq!((progress.state, progress.error_code), (state, 0));
            }
            // A late answer is taken; of another job it is not.
            let other = Event::TeachFailed {
                job: JobId(job.0 + 1),
                error_code: 201,
                message: "x".into(),
            };
            assert_eq!(bench.event(other).state, state);
            let answer = match state {
                4 => Event::RecipeLoaded {
                    job,
                    recipe: recipe(2),
                },
                _ => Event::Taught {
                    job,
                    recipe: recipe(2),
                },
            };
            let after = bench.event(answer);
            let active = after.recipe.map(|recipe| recipe.number);
            assert_eq!((after.state, after.error_code, active), (1, 0, Some(2)));
        }
    }
}

#[test]
fn a_stop_ends_a_job_that_is_silent() {
    let mut bench = Bench::ready();
    let job = bench.teach(2);
    bench.tick_after(31_000);
    bench.effects.clear();
    bench.event(Event::Stop);
    assert!(
        bench.effects.contains(&Effect::Abort { job }),
        "{:?}",
        bench.effects
    );
}

#[test]
fn a_missed_deadline_is_not_cleared_by_the_recovery_of_a_device_and_a_new_worker_holds_no_recipe() {
    let mut bench = Bench::ready();
    bench.token(1);
    assert_eq!(bench.tick_after(31_000).state, 7);
    assert_eq!(bench.event(recovered(None)).state, 7);
    let snapshot = bench.event(Event::Started);
    assert_eq!((snapshot.state, snapshot.recipe), (1, None));
}

#[test]
fn a_lost_head_comes_back_with_what_the_worker_still_holds() {
    let mut bench = Bench::ready();
    bench.event(Event::Request(Request::Load(RecipeKey::Number(2))));
    let fault = Event::Faulted {
        error_code: 201,
        cause: "projector unplugged".into(),
        remedy: "plug it in".into(),
    };
    let snapshot = bench.event(fault.clone());
    assert_eq!((snapshot.state, snapshot.recipe), (7, None));
    let snapshot = bench.event(recovered(Some(recipe(1))));
    assert!(!snapshot.is(status::READY) && !snapshot.is(status::RECIPE_OK));
    assert_eq!(snapshot.recipe_result, RecipeResult::Busy);
    assert_eq!(
        snapshot.requested_recipe, 2,
        "the load has to be asked again"
    );
    assert_eq!(bench.token(1).reject_reason, reject::OTHER_RECIPE);
    let snapshot = bench.load(1, Ok(()));
    assert!(snapshot.is(status::READY) && snapshot.is(status::RECIPE_OK));
    // A teach asks for no other recipe.
    bench.teach(3);
    assert_eq!(bench.event(fault.clone()).recipe, None);
    let snapshot = bench.event(recovered(Some(recipe(1))));
    assert!(snapshot.is(status::READY) && snapshot.is(status::RECIPE_OK));
    bench.event(fault);
    let snapshot = bench.event(recovered(None));
    assert_eq!((snapshot.state, snapshot.is(status::READY)), (1, false));
}

#[test]
fn an_idle_worker_that_falls_silent_is_a_fault_that_ends_with_its_silence() {
    let mut bench = Bench::ready();
    assert_eq!(bench.tick_after(9_000).state, 1);
    let snapshot = bench.tick_after(1_100);
    assert_eq!((snapshot.state, snapshot.error_code), (7, 801));
    let fault = snapshot.fault.expect("a fault");
    assert!(fault.remedy.contains("clears by itself"), "{fault:?}");
    assert_eq!(bench.token(1).reject_reason, reject::FAULT);
    let snapshot = bench.event(Event::Alive);
    assert!(snapshot.is(status::READY) && snapshot.error_code == 0);
}

fn room(mib: u64) -> Event {
    Event::Surveyed(System {
        free_storage_mib: Some(mib),
        ..System::default()
    })
}

#[test]
fn full_storage_is_a_warning_then_a_fault_between_two_jobs_and_clears_by_itself() {
    let mut bench = Bench::ready();
    let low = bench.event(room(health::LOW_STORAGE_MIB - 1));
    assert!(low.warnings & warning::STORAGE != 0 && low.is(status::READY));
    bench.token(1);
    let full = room(FULL_STORAGE_MIB - 1);
    assert_eq!(bench.event(full.clone()).state, 2, "the cycle goes on");
    assert_eq!(bench.finish().result_seq, 41, "and has its result");
    let snapshot = bench.event(full);
    assert_eq!(
        (snapshot.state, snapshot.error_code),
        (7, error_code::STORAGE_FULL)
    );
    let fault = snapshot.fault.expect("a fault");
    assert!(
        fault.cause.contains("23 MiB") && fault.remedy.contains("remove"),
        "{fault:?}"
    );
    assert_eq!(bench.pulse(control::ERROR_RESET).state, 7);
    assert_eq!(
        bench.event(recovered(None)).state,
        7,
        "a device's recovery is another thing"
    );
    let snapshot = bench.event(room(10_000));
    assert!(snapshot.is(status::READY) && snapshot.warnings & warning::STORAGE == 0);
}

#[test]
fn a_number_that_was_not_stored_stops_the_station_until_it_is() {
    let mut bench = Bench::ready();
    bench.token(1);
    assert_eq!(bench.finish().result_seq, 41);
    let stored = |failed: Option<Unstored>| Event::Stored { seq: 41, failed };
    let refused = || Some(Unstored::Refused("input/output error".into()));
    let snapshot = bench.event(stored(refused()));
    assert_eq!(
        (snapshot.state, snapshot.error_code),
        (7, error_code::SEQ_NOT_STORED)
    );
    assert!(snapshot.is(status::RESULT_VALID), "the PLC has its verdict");
    assert!(snapshot.warnings & warning::STORAGE != 0);
    assert_eq!(bench.token(2).reject_reason, reject::FAULT);
    for tried in 1..=2 {
        bench.effects.clear();
        assert_eq!(bench.event(room(10_000)).state, 7);
        assert_eq!(bench.effects, [Effect::PersistSeq(41)], "try {tried}");
    }
    bench.event(stored(refused()));
    let snapshot = bench.event(stored(None));
    assert!(snapshot.is(status::READY), "{snapshot:?}");
    assert_eq!(
        (snapshot.error_code, snapshot.health.storage_errors),
        (0, 2)
    );
}

#[test]
fn a_storage_that_is_only_busy_is_not_to_be_replaced() {
    for (unstored, cause, remedy) in [
        (
            Unstored::Busy(740),
            "busy, 740 ms so far",
            "trigger more slowly",
        ),
        (
            Unstored::Refused("input/output error".into()),
            "input/output error",
            "replace the storage",
        ),
    ] {
        let mut bench = Bench::ready();
        bench.token(1);
        let seq = bench.finish().result_seq;
        let failed = Some(unstored);
        let fault = bench
            .event(Event::Stored { seq, failed })
            .fault
            .clone()
            .unwrap();
        assert!(
            fault.cause.contains(cause) && fault.remedy.contains(remedy),
            "{fault:?}"
        );
        assert_eq!(fault.remedy.contains("replace"), remedy.contains("replace"));
        assert!(fault.remedy.contains("clears by itself"));
    }
}

#[test]
fn a_fault_of_storage_gives_way_to_a_lost_head_and_comes_again_after_it() {
    let mut bench = Bench::ready();
    bench.event(room(0));
    let fault = Event::Faulted {
        error_code: 101,
        cause: "camera unplugged".into(),
        remedy: "plug it in".into(),
    };
    assert_eq!(bench.event(fault).error_code, 101);
    assert_eq!(bench.event(room(0)).error_code, 101);
    assert_eq!(
        bench.event(room(1000)).error_code,
        101,
        "the head is still lost"
    );
    bench.event(room(0));
    bench.event(recovered(Some(recipe(1))));
    assert_eq!(bench.event(room(0)).error_code, error_code::STORAGE_FULL);
}

#[test]
fn a_step_of_commissioning_can_be_ended_and_nothing_else_is_by_that() {
    let mut bench = Bench::ready();
    let ended = |bench: &Bench| {
        let aborts = bench.effects.iter();
        aborts
            .filter(|effect| matches!(effect, Effect::Abort { .. }))
            .count()
    };
    bench.event(Event::Request(Request::EndStep));
    assert_eq!(ended(&bench), 0);
    bench.event(Event::Request(Request::Commission));
    let Some(Effect::Commission { job }) = bench.effects.last().cloned() else {
        panic!("{:?}", bench.effects);
    };
    bench.event(Event::Request(Request::EndStep));
    assert!(
        bench.effects.contains(&Effect::Abort { job }),
        "{:?}",
        bench.effects
    );
    assert_eq!(bench.station.snapshot().state_word, "commissioning");
}
