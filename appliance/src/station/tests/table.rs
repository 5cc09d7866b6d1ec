//! Every state × every event: the next state is defined, nothing panics, and an event out of place
//! changes nothing.

use std::sync::Arc;

use super::{Bench, good, recipe, settings};
use crate::station::control;
use crate::station::*;

/// The states by their numbers in register 104; a fault once for each way in which it is cleared.
const STATES: [u16; 13] = [0, 1, 2, 3, 4, 5, 6, 7, 7, 7, 7, 8, 9];
/// Columns of the table that are faults: a lost device, a missed deadline, storage, an idle
/// worker's silence.
const LOST: usize = 7;
const LATE: usize = 8;
const FULL: usize = 9;
const SILENT: usize = 10;
const STOPPING: usize = 11;
const COMMISSIONING: usize = 12;

/// A survey that found this much room, in MiB.
fn room(mib: u64) -> Event {
    Event::Surveyed(System {
        free_storage_mib: Some(mib),
        ..System::default()
    })
}

fn in_state(column: usize) -> Bench {
    let mut bench = if column == 0 {
        Bench::booting_with(settings())
    } else {
        Bench::ready()
    };
    let online_off = ControlWrite {
        control: Masked::<u16>::all(0),
        ..Default::default()
    };
    match column {
        2 | 3 => {
            bench.write(ControlWrite {
                token: Some(1),
                ..Default::default()
            });
            if column == 3 {
                let job = bench.job();
                bench.event(Event::ExposureDone { job });
            }
        }
        4 => {
            bench.event(Event::Request(Request::Load(RecipeKey::Number(2))));
        }
        5 => {
            bench.event(Event::Request(Request::Teach(Teaching::of(2))));
        }
        6 => {
            bench.write(online_off);
        }
        LOST => {
            bench.event(Event::Faulted {
                error_code: 101,
                cause: "c".into(),
                remedy: "r".into(),
            });
        }
        LATE => {
            bench.token(1);
            bench.now = bench.now.after(Limits::default().acquiring);
            bench.event(Event::Tick { utc_us: None });
        }
        FULL => {
            bench.event(room(0));
        }
        SILENT => {
            bench.now = bench.now.after(Limits::default().silent);
            bench.event(Event::Tick { utc_us: None });
        }
        STOPPING => {
            bench.event(Event::Stop);
        }
        COMMISSIONING => {
            bench.event(Event::Request(Request::Commission));
        }
        _ => {}
    }
    assert_eq!(bench.station.snapshot().state, STATES[column]);
    bench
}

/// Every event with a given job, and the state that it leads to from each column's.
fn events(job: JobId) -> Vec<(Event, [u16; 13])> {
    let words: Arc<str> = "w".into();
    let write = |bits: u16, rising: u16, token: u16| Event::Write {
        write: ControlWrite {
            control: Masked::<u16>::all(bits),
            token: Some(token),
            recipe_select: Some(1),
            ..Default::default()
        },
        rising,
        client: Client::default(),
    };
    let other_recipe = |rising: u16, token: u16| Event::Write {
        write: ControlWrite {
            token: Some(token),
            recipe_select: Some(77),
            ..Default::default()
        },
        rising,
        client: Client::default(),
    };
    let stay = STATES;
    let mut alive = STATES;
    alive[SILENT] = 1;
    vec![
        (write(1, 0, 0), [0, 1, 2, 3, 4, 5, 1, 7, 7, 7, 7, 8, 9]),
        (write(0, 0, 0), [0, 6, 2, 3, 4, 5, 6, 7, 7, 7, 7, 8, 9]),
        (
            write(3, control::TRIGGER, 0),
            [0, 2, 2, 3, 4, 5, 2, 7, 7, 7, 7, 8, 9],
        ),
        (write(1, 0, 99), [0, 2, 2, 3, 4, 5, 2, 7, 7, 7, 7, 8, 9]),
        (
            other_recipe(control::TRIGGER, 0),
            [0, 1, 2, 3, 4, 5, 6, 7, 7, 7, 7, 8, 9],
        ),
        (other_recipe(0, 99), [0, 1, 2, 3, 4, 5, 6, 7, 7, 7, 7, 8, 9]),
        (
            write(5, control::RESULT_ACK, 0),
            [0, 1, 2, 3, 4, 5, 1, 7, 7, 7, 7, 8, 9],
        ),
        (
            write(9, control::RECIPE_LOAD, 0),
            [0, 4, 2, 3, 4, 5, 4, 7, 7, 7, 7, 8, 9],
        ),
        (
            write(17, control::ERROR_RESET, 0),
            [0, 1, 2, 3, 4, 5, 1, 7, 7, 7, 7, 8, 9],
        ),
        (
            write(33, control::ABORT, 0),
            [0, 1, 2, 3, 4, 5, 1, 7, 7, 7, 7, 8, 9],
        ),
        (
            write(129, control::TEACH, 0),
            [0, 1, 2, 3, 4, 5, 1, 7, 7, 7, 7, 8, 9],
        ),
        (
            Event::Request(Request::Load(RecipeKey::PartNumber("x".into()))),
            [0, 4, 2, 3, 4, 5, 4, 7, 7, 7, 7, 8, 9],
        ),
        (
            Event::Request(Request::Teach(Teaching::of(9))),
            [0, 5, 2, 3, 4, 5, 5, 7, 7, 7, 7, 8, 9],
        ),
        (Event::Started, [1, 1, 2, 3, 4, 5, 6, 7, 1, 7, 1, 8, 9]),
        (
            Event::ExposureDone { job },
            [0, 1, 3, 3, 4, 5, 6, 7, 7, 7, 1, 8, 9],
        ),
        (
            Event::Finished {
                job,
                inspection: good(),
            },
            [0, 1, 1, 1, 4, 5, 6, 7, 7, 7, 1, 8, 9],
        ),
        (
            Event::MeasureFailed {
                job,
                error_code: 0,
                message: words.clone(),
            },
            [0, 1, 1, 1, 4, 5, 6, 7, 7, 7, 1, 8, 9],
        ),
        (
            Event::RecipeLoaded {
                job,
                recipe: recipe(2),
            },
            [0, 1, 2, 3, 1, 5, 6, 7, 7, 7, 1, 8, 9],
        ),
        (
            Event::LoadFailed {
                job,
                result: RecipeResult::Corrupt,
                message: words.clone(),
            },
            [0, 1, 2, 3, 1, 5, 6, 7, 7, 7, 1, 8, 9],
        ),
        (
            Event::Progress {
                job,
                fraction: f32::NAN,
                words: words.clone(),
            },
            alive,
        ),
        (
            Event::Taught {
                job,
                recipe: recipe(2),
            },
            [0, 1, 2, 3, 4, 1, 6, 7, 7, 7, 1, 8, 9],
        ),
        (
            Event::TeachFailed {
                job,
                error_code: 0,
                message: words.clone(),
            },
            [0, 1, 2, 3, 4, 1, 6, 7, 7, 7, 1, 8, 9],
        ),
        (
            Event::Request(Request::Commission),
            [0, 9, 2, 3, 4, 5, 9, 7, 7, 7, 7, 8, 9],
        ),
        (
            Event::Request(Request::EndStep),
            [0, 1, 2, 3, 4, 5, 6, 7, 7, 7, 7, 8, 9],
        ),
        (
            Event::Commissioned {
                job,
                recipe: Some(recipe(1)),
            },
            [0, 1, 2, 3, 4, 5, 6, 7, 7, 7, 1, 8, 1],
        ),
        (
            Event::Condition(Condition {
                warming_up: true,
                calibration_valid: true,
                warnings: 0xFFFF,
            }),
            alive,
        ),
        (
            Event::Faulted {
                error_code: 0,
                cause: words.clone(),
                remedy: words.clone(),
            },
            [7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 8, 7],
        ),
        (
            Event::Recovered {
                recipe: Some(recipe(2)),
            },
            [0, 1, 2, 3, 4, 5, 6, 1, 7, 7, 1, 8, 9],
        ),
        (
            Event::Paced(Pace::default()),
            [0, 1, 2, 3, 4, 5, 6, 7, 7, 7, 1, 8, 9],
        ),
        (Event::Projector(ProjectorHealth::default()), alive),
        (room(0), [0, 7, 2, 3, 4, 5, 7, 7, 7, 7, 7, 8, 9]),
        (room(1000), [0, 1, 2, 3, 4, 5, 6, 7, 7, 1, 7, 8, 9]),
        (
            Event::Stored {
                seq: 40,
                failed: None,
            },
            stay,
        ),
        (
            Event::Stored {
                seq: 40,
                failed: Some(Unstored::Refused(words)),
            },
            [0, 7, 2, 3, 4, 5, 7, 7, 7, 7, 7, 8, 9],
        ),
        (Event::Alive, alive),
        (Event::Tick { utc_us: Some(0) }, stay),
        (Event::Stop, [8; 13]),
    ]
}

#[test]
fn every_state_takes_every_event_and_leads_where_the_table_says() {
    for (column, state) in STATES.into_iter().enumerate() {
        let bench = in_state(column);
        for (event, next) in events(bench.job()) {
            let (station, _) = step(
                bench.station.clone(),
                event.clone(),
                bench.now.after(Micros(1)),
            );
            assert_eq!(
                station.snapshot().state,
                next[column],
                "column {column}, state {state}, {event:?}"
            );
        }
    }
}

#[test]
fn an_answer_of_another_job_changes_no_state() {
    for state in 0..STATES.len() {
        let bench = in_state(state);
        for (event, _) in events(JobId(9999)) {
            let answer = matches!(
                event,
                Event::ExposureDone { .. }
                    | Event::Finished { .. }
                    | Event::MeasureFailed { .. }
                    | Event::RecipeLoaded { .. }
                    | Event::LoadFailed { .. }
                    | Event::Progress { .. }
                    | Event::Taught { .. }
                    | Event::TeachFailed { .. }
                    | Event::Commissioned { .. }
            );
            if answer {
                let (station, effects) = step(bench.station.clone(), event.clone(), bench.now);
                let only_logged = effects
                    .iter()
                    .all(|effect| matches!(effect, Effect::Log(_) | Effect::Alarm(_)));
                // It counts only as a sign of life, which ends the fault of an idle worker's
                // silence.
                let as_before = station.state == bench.station.state || state == SILENT;
                assert!(as_before && only_logged, "state {state}, {event:?}");
            }
        }
    }
}

#[test]
fn time_that_runs_backwards_or_to_its_end_is_survived() {
    for state in 0..STATES.len() {
        for (event, _) in events(JobId(1)) {
            let bench = in_state(state);
            let (station, _) = step(bench.station, event.clone(), Micros(u64::MAX));
            let (station, _) = step(
                station,
                Event::Tick {
                    utc_us: Some(u64::MAX),
                },
                Micros(0),
            );
            let (station, _) = step(station, event, Micros(u64::MAX));
            assert_eq!(station.snapshot().at, Micros(u64::MAX));
        }
    }
}

/// Takes every order of `left` events from `station` on. Each trigger has one result, or its cycle
/// is in flight; none is after the worker's last word, a missed deadline or a second stop.
fn follow(station: &Station, now: Micros, left: u32) {
    let stopping = matches!(station.state, State::Stopping { .. });
    for (event, _) in events(station.worker.last_job) {
        let (ends, pause) = match event {
            Event::Finished { .. } | Event::MeasureFailed { .. } | Event::Faulted { .. } => {
                (true, 1)
            }
            // After every deadline; a stop has its own.
            Event::Tick { .. } => (!stopping, 31_000),
            Event::Stop => (stopping, 1),
            _ => (false, 1),
        };
        let now = now.after(Micros::from_millis(pause));
        let (next, _) = step(station.clone(), event.clone(), now);
        let in_flight = matches!(
            next.state,
            State::Acquiring { .. } | State::Processing { .. } | State::Stopping { cycle: Some(_) }
        );
        let Counts {
            pass,
            fail,
            invalid,
        } = next.results.counts;
        let accounted = pass + fail + invalid + u64::from(in_flight);
        assert!(
            accounted == u64::from(next.requests.triggers) && !(ends && in_flight),
            "{event:?} in {:?} led to {accounted} results in {:?}",
            station.state,
            next.state
        );
        if left > 1 {
            follow(&next, now, left - 1);
        }
    }
}

#[test]
fn every_trigger_has_one_result_in_every_state_and_order_of_three_events() {
    for column in 0..STATES.len() {
        let bench = in_state(column);
        follow(&bench.station, bench.now, 3);
    }
}
