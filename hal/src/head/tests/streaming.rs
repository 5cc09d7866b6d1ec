//! A triggered camera stays on between sequences, and no frame of one sequence is taken for one of
//! the next.

use super::*;

const START_UP: Duration = Duration::from_millis(500);

fn slow_to_start(faults: Faults) -> Mechanics {
    Mechanics {
        start_up: START_UP,
        readout: Duration::from_millis(9),
        faults,
        ..plain()
    }
}

fn start_up(head: &mut Head) -> Duration {
    let (frames, result) = take(head, &[0, 1, 2]);
    for ((index, label), wanted) in frames.iter().zip(0..) {
        assert_eq!((*index, label.shown), (wanted, Some(wanted)));
    }
    let exposure = result.unwrap();
    assert_eq!((frames.len(), exposure.retaken), (3, 0), "{exposure:?}");
    exposure.start_up
}

#[test]
fn only_the_first_cycle_waits_for_the_camera_to_start() {
    let mut head = labelled(slow_to_start(Faults::default()), 3);
    assert_eq!(head.start_up().unwrap(), START_UP);
    assert_eq!(start_up(&mut head), START_UP);
    for _ in 0..3 {
        assert_eq!(start_up(&mut head), Duration::ZERO);
        head.rest().unwrap();
    }
    // It is stopped when it has waited for as long as it may, and starts with the next cycle.
    let late = head.devices.clock.now() + head.stays_on();
    head.devices.clock.wait(late);
    head.rest().unwrap();
    assert_eq!(start_up(&mut head), START_UP);
    assert_eq!(start_up(&mut head), Duration::ZERO);
    assert_eq!(head.start_up().unwrap(), START_UP);
}

#[test]
fn a_camera_is_stopped_after_a_sequence_whose_frames_may_still_come_and_where_it_may_not_stay_on() {
    let mut head = labelled(slow_to_start(Faults::default()), 3);
    assert_eq!(start_up(&mut head), START_UP);
    let mut first = |_, _| false;
    head.acquire_while(&[0, 1, 2], TIMEOUT, &mut first).unwrap();
    assert_eq!(start_up(&mut head), START_UP);
    let never = Mechanics {
        stays_on: Duration::ZERO,
        ..slow_to_start(Faults::default())
    };
    let mut by_itself = slow_to_start(Faults::default());
    by_itself.free_running = free_running(2 * REFRESH, Duration::ZERO);
    for mechanics in [never, by_itself] {
        let mut head = labelled(mechanics, 3);
        assert_eq!(start_up(&mut head), START_UP);
        assert_eq!(start_up(&mut head), START_UP);
    }
}

#[test]
fn a_copy_of_the_last_frame_of_a_sequence_is_not_a_frame_of_the_next() {
    let faults = Faults {
        duplicated: 1.0,
        ..Faults::default()
    };
    let mut head = labelled(slow_to_start(faults), 3);
    for _ in 0..20 {
        start_up(&mut head);
    }
}
