//! What triggers, what does not, and why.

use super::*;

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
