//! One named test for each rule of the station.

use std::sync::Arc;

use super::control::{self, BY_PART_NUMBER};
use super::error_code;
use super::plc::reject;
use super::snapshot::{status, warning};
use super::*;

/// A station under test with its own clock and one PLC connection.
pub(super) struct Bench {
    pub(super) station: Station,
    pub(super) now: Micros,
    pub(super) effects: Vec<Effect>,
    edges: ConnectionEdges,
}

pub(super) fn settings() -> Settings {
    let identity = Identity {
        vendor: "v".into(),
        product: "p".into(),
        serial: "s".into(),
        version: "1".into(),
    };
    Settings {
        next_seq: 41,
        boot_id: 7,
        teach_allowed: false,
        identity: Arc::new(identity),
        limits: Limits::default(),
    }
}

pub(super) fn recipe(number: u16) -> ActiveRecipe {
    ActiveRecipe {
        number,
        crc: u32::from(number) << 16,
        name: "part".into(),
    }
}

pub(super) fn good() -> Arc<Inspection> {
    let gauge = GaugeValue::judged(
        "height",
        Unit::Length,
        Some(0.1),
        Some(0.01),
        (Some(-1.0), Some(1.0)),
    );
    Arc::new(Inspection {
        judged: Verdict::Pass,
        gauges: [gauge].into_iter().collect(),
        ..Default::default()
    })
}

impl Bench {
    pub(super) fn booting_with(settings: Settings) -> Self {
        let station = Station::new(settings, Micros(0));
        Self {
            station,
            now: Micros(0),
            effects: Vec::new(),
            edges: ConnectionEdges::default(),
        }
    }

    /// Ready with recipe 1; the PLC's first write of CONTROL has been made.
    pub(super) fn ready_with(settings: Settings) -> Self {
        let mut bench = Self::booting_with(settings);
        bench.event(Event::Started);
        bench.event(Event::Request(Request::Load(RecipeKey::Number(1))));
        let job = bench.job();
        bench.event(Event::RecipeLoaded {
            job,
            recipe: recipe(1),
        });
        bench.control(control::ONLINE);
        bench.effects.clear();
        bench
    }

    pub(super) fn ready() -> Self {
        Self::ready_with(settings())
    }

    pub(super) fn event(&mut self, event: Event) -> Snapshot {
        self.now = self.now.after(Micros(10));
        let (station, effects) = step(self.station.clone(), event, self.now);
        self.station = station;
        self.effects.extend(effects);
        self.station.snapshot()
    }

    pub(super) fn write(&mut self, write: ControlWrite) -> Snapshot {
        let rising = self.edges.rise(write.control);
        self.event(Event::Write { write, rising })
    }

    fn control(&mut self, bits: u16) -> Snapshot {
        self.write(ControlWrite {
            control: Masked::<u16>::all(bits),
            ..Default::default()
        })
    }

    /// Raises one bit and lowers it again; answers with the snapshot while it is up.
    fn pulse(&mut self, bit: u16) -> Snapshot {
        let level = self.station.control.control & !bit;
        let up = self.control(level | bit);
        self.control(level);
        up
    }

    fn token(&mut self, token: u16) -> Snapshot {
        self.write(ControlWrite {
            token: Some(token),
            ..Default::default()
        })
    }

    fn select(&mut self, recipe: u16) {
        self.write(ControlWrite {
            recipe_select: Some(recipe),
            ..Default::default()
        });
    }

    pub(super) fn job(&self) -> JobId {
        self.station.last_job
    }

    fn finish(&mut self) -> Snapshot {
        let job = self.job();
        self.event(Event::ExposureDone { job });
        self.event(Event::Finished {
            job,
            inspection: good(),
        })
    }

    fn tick_after(&mut self, ms: u64) -> Snapshot {
        self.now = self.now.after(Micros::from_millis(ms));
        self.event(Event::Tick { utc_us: None })
    }

    pub(super) fn measured(&self) -> usize {
        self.effects
            .iter()
            .filter(|effect| matches!(effect, Effect::Measure(_)))
            .count()
    }
}

#[test]
fn boot_ends_when_the_head_is_open_and_ready_needs_a_recipe() {
    let mut bench = Bench::booting_with(settings());
    assert_eq!(bench.station.snapshot().state, 0);
    let snapshot = bench.event(Event::Started);
    assert_eq!((snapshot.state, snapshot.is(status::READY)), (1, false));
    assert_eq!(bench.token(5).reject_reason, reject::NO_RECIPE);
    bench.event(Event::Request(Request::Teach { number: 1 }));
    let job = bench.job();
    let snapshot = bench.event(Event::Progress {
        job,
        fraction: 0.5,
        words: "fitting".into(),
    });
    assert_eq!(
        snapshot.teach,
        Some(TeachProgress {
            number: 1,
            fraction: 0.5,
            words: "fitting".into()
        })
    );
    let snapshot = bench.event(Event::Taught {
        job,
        recipe: recipe(1),
    });
    assert!(snapshot.is(status::READY) && snapshot.is(status::RECIPE_OK));
}

#[test]
fn an_edge_triggers_once_and_latches_the_fields_of_the_same_write() {
    let mut bench = Bench::ready();
    let write = ControlWrite {
        control: Masked::<u16>::all(3),
        part_id: Masked::<u32>::all(77),
        press_stroke: Masked::<u32>::all(88),
        ..Default::default()
    };
    let snapshot = bench.write(write);
    assert_eq!((snapshot.state, snapshot.triggers), (2, 1));
    assert!(
        snapshot.is(status::TRIGGER_ACK)
            && snapshot.is(status::BUSY)
            && !snapshot.is(status::READY)
    );
    let Some(Effect::Measure(job)) = bench.effects.first() else {
        panic!("no order to measure: {:?}", bench.effects)
    };
    assert_eq!(
        (job.part_id, job.press_stroke, job.token, job.recipe.number),
        (77, 88, 0, 1)
    );
    bench.write(ControlWrite {
        part_id: Masked::<u32>::all(99),
        ..write
    });
    assert_eq!(bench.measured(), 1, "a level that stays high is no trigger");
    let result = bench.finish().result.expect("a result");
    assert_eq!(
        (result.part_id, result.press_stroke, result.token),
        (77, 88, 0)
    );
    assert!(
        !bench.control(1).is(status::TRIGGER_ACK),
        "TRIGGER_ACK follows CONTROL.1 down"
    );
}

#[test]
fn a_token_triggers_once_whatever_connection_repeats_it() {
    let mut bench = Bench::ready();
    assert_eq!(bench.token(5).last_token, 5);
    bench.token(5);
    bench.edges = ConnectionEdges::default();
    bench.token(5);
    bench.finish();
    let snapshot = bench.token(5);
    assert_eq!(
        (bench.measured(), snapshot.triggers, snapshot.missed),
        (1, 1, 0)
    );
    assert_eq!(snapshot.result.map(|result| result.token), Some(5));
    assert_eq!(bench.token(6).triggers, 2);
    bench.finish();
    assert_eq!(bench.token(0).triggers, 2, "0 never triggers");
}

#[test]
fn a_rejected_token_may_be_sent_again() {
    let mut bench = Bench::ready();
    bench.token(5);
    let snapshot = bench.token(6);
    assert_eq!(
        (snapshot.missed, snapshot.last_token, snapshot.reject_reason),
        (1, 5, reject::NOT_READY)
    );
    bench.finish();
    assert_eq!(bench.token(6).last_token, 6);
    assert_eq!(bench.measured(), 2);
}

#[test]
fn an_edge_and_a_new_token_in_one_write_are_one_trigger() {
    let mut bench = Bench::ready();
    bench.write(ControlWrite {
        control: Masked::<u16>::all(3),
        token: Some(9),
        ..Default::default()
    });
    assert_eq!(bench.measured(), 1);
    assert_eq!(bench.finish().result.map(|result| result.token), Some(9));
    bench.control(1);
    bench.write(ControlWrite {
        control: Masked::<u16>::all(3),
        token: Some(9),
        ..Default::default()
    });
    assert_eq!(bench.measured(), 2, "the edge is a trigger of its own");
    assert_eq!(
        bench.finish().result.map(|result| result.token),
        Some(0),
        "an old token is not echoed as a new one"
    );
}

#[test]
fn a_trigger_while_not_ready_is_counted_and_changes_nothing_else() {
    let mut bench = Bench::ready();
    let before = bench.token(5);
    let after = bench.pulse(control::TRIGGER);
    assert!(after.is(status::MISSED_TRIGGER));
    assert_eq!((after.missed, after.reject_reason), (1, reject::NOT_READY));
    assert_eq!(
        (after.state, after.triggers, after.last_token),
        (before.state, before.triggers, before.last_token)
    );
    let done = bench.finish();
    assert!(
        done.is(status::RESULT_VALID),
        "a missed trigger does not touch the result"
    );
    assert!(!bench.pulse(control::ERROR_RESET).is(status::MISSED_TRIGGER));
}

#[test]
fn clearing_online_goes_offline_even_in_the_write_of_a_trigger() {
    let mut bench = Bench::ready();
    let snapshot = bench.control(control::TRIGGER);
    assert_eq!(
        (snapshot.state, snapshot.missed, snapshot.reject_reason),
        (6, 1, reject::OFFLINE)
    );
    assert!(!snapshot.is(status::ONLINE) && !snapshot.is(status::READY));
    let snapshot = bench.control(control::ONLINE);
    assert_eq!((snapshot.state, snapshot.is(status::READY)), (1, true));
}

#[test]
fn going_offline_lets_the_cycle_in_flight_finish() {
    let mut bench = Bench::ready();
    bench.token(5);
    assert_eq!(bench.control(0).state, 2);
    let snapshot = bench.finish();
    assert_eq!(
        (snapshot.state, snapshot.is(status::RESULT_VALID)),
        (6, true)
    );
}

#[test]
fn the_result_life_cycle_is_that_of_the_map() {
    let mut bench = Bench::ready();
    bench.token(1);
    let job = bench.job();
    let exposed = bench.event(Event::ExposureDone { job });
    assert!(
        exposed.is(status::EXPOSURE_DONE)
            && exposed.is(status::PROCESSING)
            && !exposed.is(status::RESULT_VALID)
    );
    let done = bench.event(Event::Finished {
        job,
        inspection: good(),
    });
    assert!(
        done.is(status::RESULT_VALID) && done.is(status::RESULT_TOGGLE) && done.is(status::READY)
    );
    assert_eq!(
        (
            done.result_seq,
            done.result.as_ref().map(|result| result.seq)
        ),
        (41, Some(41)),
        "SEQ continues across restarts"
    );
    assert!(!bench.pulse(control::RESULT_ACK).is(status::RESULT_VALID));
    let again = bench.token(2);
    assert!(
        !again.is(status::EXPOSURE_DONE) && again.is(status::RESULT_TOGGLE),
        "an acknowledge is not required"
    );
    let done = bench.finish();
    assert!(!done.is(status::RESULT_TOGGLE));
    assert!(
        !bench.token(3).is(status::RESULT_VALID),
        "RESULT_VALID falls with the next trigger"
    );
}

#[test]
fn the_sequence_number_is_stored_before_its_result_is_published() {
    let mut bench = Bench::ready();
    bench.token(1);
    bench.finish();
    let orders: Vec<_> = bench
        .effects
        .iter()
        .filter(|effect| !matches!(effect, Effect::Log(_)))
        .collect();
    assert!(
        matches!(
            orders[..],
            [
                Effect::Measure(_),
                Effect::PersistSeq(41),
                Effect::Publish(_)
            ]
        ),
        "{orders:?}"
    );
}

#[test]
fn a_failed_measurement_is_an_invalid_result_with_its_error_code() {
    let mut bench = Bench::ready();
    bench.token(1);
    let job = bench.job();
    let snapshot = bench.event(Event::MeasureFailed {
        job,
        error_code: 102,
        message: "no frame in 200 ms".into(),
    });
    let result = snapshot.result.clone().expect("a result");
    assert_eq!(
        (result.verdict, result.error_code, result.token, result.seq),
        (Verdict::Invalid, 102, 1, 41)
    );
    assert!(
        snapshot.is(status::ERROR)
            && snapshot.is(status::READY)
            && snapshot.is(status::EXPOSURE_DONE)
    );
    assert_eq!(snapshot.error_code, 102);
    bench.token(2);
    assert!(
        !bench.finish().is(status::ERROR),
        "a good cycle clears the last one's error"
    );
}

#[test]
fn buffered_results_are_popped_by_acknowledge_and_overflow_latches() {
    let mut bench = Bench::ready();
    bench.control(control::ONLINE | control::BUFFERED);
    for token in 1..=33 {
        bench.token(token);
        bench.finish();
    }
    let full = bench.station.snapshot();
    assert_eq!((full.buffered, full.result_seq), (32, 73));
    assert!(full.is(status::BUFFER_OVERFLOW));
    assert_eq!(
        full.oldest.map(|result| result.seq),
        Some(41),
        "the newest is left out, not the oldest"
    );
    assert_eq!(
        full.result.map(|result| result.seq),
        Some(73),
        "it is still in RESULT"
    );
    let popped = bench.pulse(control::RESULT_ACK);
    assert_eq!(
        (
            popped.buffered,
            popped.oldest.as_ref().map(|result| result.seq)
        ),
        (31, Some(42))
    );
    assert!(popped.is(status::BUFFER_OVERFLOW));
    assert!(
        !bench
            .pulse(control::ERROR_RESET)
            .is(status::BUFFER_OVERFLOW)
    );
}

#[test]
fn without_buffered_mode_nothing_is_queued() {
    let mut bench = Bench::ready();
    bench.token(1);
    let snapshot = bench.finish();
    assert_eq!((snapshot.buffered, snapshot.oldest), (0, None));
}

#[test]
fn a_recipe_is_loaded_by_number_and_by_part_number() {
    let mut bench = Bench::ready();
    bench.select(12);
    let snapshot = bench.pulse(control::RECIPE_LOAD);
    assert_eq!((snapshot.state, snapshot.requested_recipe), (4, 12));
    assert!(snapshot.is(status::RECIPE_LOADING) && !snapshot.is(status::READY));
    assert_eq!(
        snapshot.recipe.map(|recipe| recipe.number),
        Some(1),
        "the old one until the new one is whole"
    );
    let job = bench.job();
    let snapshot = bench.event(Event::RecipeLoaded {
        job,
        recipe: recipe(12),
    });
    assert_eq!(
        (snapshot.state, snapshot.recipe.map(|recipe| recipe.number)),
        (1, Some(12))
    );
    let mut part_number = [None; 16];
    part_number[0] = Some(u16::from_be_bytes(*b"AB"));
    part_number[1] = Some(u16::from_be_bytes(*b"7\0"));
    bench.write(ControlWrite {
        part_number,
        recipe_select: Some(BY_PART_NUMBER),
        ..Default::default()
    });
    bench.pulse(control::RECIPE_LOAD);
    let job = bench.job();
    assert_eq!(
        bench.effects.last(),
        Some(&Effect::Load {
            job,
            key: RecipeKey::PartNumber("AB7".into())
        })
    );
}

#[test]
fn a_failed_load_keeps_the_old_recipe_and_says_why() {
    let mut bench = Bench::ready();
    for (result, number) in [
        (RecipeResult::Unknown, 1),
        (RecipeResult::Corrupt, 2),
        (RecipeResult::OtherCalibration, 3),
    ] {
        bench.select(12);
        bench.pulse(control::RECIPE_LOAD);
        let job = bench.job();
        let snapshot = bench.event(Event::LoadFailed {
            job,
            result,
            message: "no".into(),
        });
        assert_eq!(
            (
                snapshot.recipe_result.number(),
                snapshot.recipe.clone().map(|recipe| recipe.number)
            ),
            (number, Some(1))
        );
        assert!(!snapshot.is(status::RECIPE_OK) && snapshot.is(status::READY));
    }
}

#[test]
fn a_load_while_measuring_is_answered_with_busy() {
    let mut bench = Bench::ready();
    bench.token(1);
    bench.select(12);
    let snapshot = bench.pulse(control::RECIPE_LOAD);
    assert_eq!(
        (
            snapshot.state,
            snapshot.recipe_result,
            snapshot.reject_reason
        ),
        (2, RecipeResult::Busy, reject::NOT_READY)
    );
}

#[test]
fn a_load_with_recipe_select_0_leaves_the_recipe_as_it_is() {
    let mut bench = Bench::ready();
    let before = bench.station.snapshot();
    let after = bench.pulse(control::RECIPE_LOAD);
    assert_eq!(
        (after.state, after.recipe, after.recipe_result),
        (1, before.recipe, before.recipe_result)
    );
}

#[test]
fn a_load_beats_a_trigger_of_the_same_write() {
    let mut bench = Bench::ready();
    let bits = control::ONLINE | control::TRIGGER | control::RECIPE_LOAD;
    let write = ControlWrite {
        control: Masked::<u16>::all(bits),
        recipe_select: Some(12),
        token: Some(4),
        ..Default::default()
    };
    let snapshot = bench.write(write);
    assert_eq!(
        (snapshot.state, snapshot.missed, snapshot.reject_reason),
        (4, 1, reject::NOT_READY)
    );
    assert_eq!(bench.measured(), 0);
}

#[test]
fn the_plc_teaches_only_where_the_config_allows_it() {
    let mut bench = Bench::ready();
    assert_eq!(
        bench.pulse(control::TEACH).reject_reason,
        reject::TEACH_NOT_ALLOWED
    );
    let mut bench = Bench::ready_with(Settings {
        teach_allowed: true,
        ..settings()
    });
    bench.select(3);
    assert_eq!(bench.pulse(control::TEACH).state, 5);
    assert!(bench.effects.contains(&Effect::Teach {
        job: bench.job(),
        number: 3
    }));
    let job = bench.job();
    let snapshot = bench.event(Event::TeachFailed {
        job,
        error_code: 201,
        message: "too dark".into(),
    });
    assert_eq!(
        (
            snapshot.state,
            snapshot.error_code,
            snapshot.recipe.map(|recipe| recipe.number)
        ),
        (1, 201, Some(1))
    );
}

#[test]
fn an_abort_still_ends_in_one_result() {
    let mut bench = Bench::ready();
    bench.token(1);
    bench.pulse(control::ABORT);
    let job = bench.job();
    assert_eq!(bench.effects.last(), Some(&Effect::Abort { job }));
    let message = Arc::from("aborted by the PLC");
    let snapshot = bench.event(Event::MeasureFailed {
        job,
        error_code: error_code::ABORTED,
        message,
    });
    assert_eq!(
        snapshot
            .result
            .map(|result| (result.verdict, result.error_code)),
        Some((Verdict::Invalid, error_code::ABORTED))
    );
    bench.effects.clear();
    bench.pulse(control::ABORT);
    assert!(
        bench.effects.is_empty(),
        "there is nothing to abort while ready"
    );
}

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
fn progress_extends_the_deadline_of_teaching() {
    let mut bench = Bench::ready();
    bench.event(Event::Request(Request::Teach { number: 2 }));
    let job = bench.job();
    for _ in 0..3 {
        assert_eq!(bench.tick_after(20_000).state, 5);
        bench.event(Event::Progress {
            job,
            fraction: 0.1,
            words: "x".into(),
        });
    }
    assert_eq!(bench.tick_after(31_000).state, 7);
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
