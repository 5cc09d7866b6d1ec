//! From a trigger to its one result, the handshake and the queue.

use super::*;

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
        .filter(|effect| !matches!(effect, Effect::Log(_) | Effect::Alarm(_)))
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
fn buffered_mode_outlives_writes_without_its_bit_and_a_restart_and_ends_with_bit_8() {
    let mut bench = Bench::ready();
    bench.control(control::ONLINE | control::BUFFERED);
    // An older program acknowledges, and writes CONTROL as it always did.
    bench.token(1);
    bench.finish();
    bench.pulse(control::RESULT_ACK);
    bench.control(control::ONLINE);
    for token in 2..=4 {
        bench.token(token);
        bench.finish();
    }
    let snapshot = bench.station.snapshot();
    assert_eq!(snapshot.buffered, 3);
    assert_ne!(snapshot.control.control & control::BUFFERED, 0);
    let oldest = snapshot.oldest.clone().unwrap();
    // What the history says after a restart.
    let left = Buffered {
        acknowledged: Some(oldest.seq - 1),
        queue: vec![oldest.clone()],
    };
    let mut again = Bench::ready_with(Settings {
        buffered: left,
        ..settings()
    });
    let snapshot = again.station.snapshot();
    assert_eq!((snapshot.buffered, snapshot.oldest), (1, Some(oldest)));
    assert_eq!(again.pulse(control::RESULT_ACK).buffered, 0);
    again.token(9);
    assert_eq!(again.finish().buffered, 1);
    again.pulse(control::UNBUFFERED);
    again.token(10);
    let ended = again.finish();
    assert_eq!(ended.buffered, 1, "what waits is still acknowledged");
    assert_eq!(ended.control.control & control::BUFFERED, 0);
}

#[test]
fn without_buffered_mode_nothing_is_queued() {
    let mut bench = Bench::ready();
    bench.token(1);
    let snapshot = bench.finish();
    assert_eq!((snapshot.buffered, snapshot.oldest), (0, None));
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
