//! Sequences with faults of one kind each, and the speed of a sequence without faults.

use super::*;
use crate::error::ErrorKind;

const COUNT: usize = 12;

/// Takes a sequence and checks that each pattern gives a frame, in order, that shows only this
/// pattern.
fn all_right(head: &mut Head) -> Exposure {
    let indices: Vec<usize> = (0..COUNT).collect();
    let (frames, result) = take(head, &indices);
    let wholly = |index: &usize| Label {
        shown: Some(*index),
        others: 0.0,
        longer: 0.0,
    };
    let expected: Vec<_> = indices
        .iter()
        .map(|index| (*index, wholly(index)))
        .collect();
    assert_eq!(frames, expected);
    result.unwrap()
}

/// As [`all_right`], but tolerates pulses of the trigger that are off by less than what spoils a
/// frame.
fn all_but_half_a_percent(head: &mut Head) -> Exposure {
    let indices: Vec<usize> = (0..COUNT).collect();
    let (frames, result) = take(head, &indices);
    assert_eq!(frames.len(), COUNT, "{result:?}");
    for ((index, label), wanted) in frames.iter().zip(indices) {
        assert_eq!((*index, label.shown), (wanted, Some(wanted)));
        assert!(
            label.others.max(label.longer) <= HALF_A_PERCENT,
            "{label:?}"
        );
    }
    result.unwrap()
}

/// Refreshes from the first pattern's light to the start of the last exposure.
fn refreshes(exposure: &Exposure) -> f64 {
    exposure.done.since(exposure.started).as_secs_f64() / REFRESH.as_secs_f64()
}

#[test]
fn a_camera_that_keeps_up_takes_one_pattern_per_refresh() {
    for delay in [0, 3, 17, 40, 100] {
        let delay = Duration::from_millis(delay);
        let mechanics = Mechanics {
            flip_to_light: delay,
            calibrated_flip_to_light: delay,
            ..plain()
        };
        let exposure = all_right(&mut labelled(mechanics, COUNT));
        assert_eq!(refreshes(&exposure).round(), 11.0, "{delay:?}");
        assert_eq!(
            (exposure.retaken, exposure.missed_flips, exposure.dropped),
            (0, 0, 0)
        );
    }
}

#[test]
fn a_camera_that_needs_two_refreshes_takes_a_pattern_in_two_while_the_next_flip_is_queued() {
    let readout = Mechanics {
        readout: Duration::from_millis(16),
        ..plain()
    };
    let exposed_twice = Mechanics::plain(REFRESH, 2);
    for mechanics in [readout, exposed_twice] {
        let exposure = all_right(&mut labelled(mechanics, COUNT));
        assert_eq!(refreshes(&exposure).round(), 22.0);
        assert_eq!(exposure.retaken, 0);
    }
}

#[test]
fn copying_a_frame_for_longer_than_a_refresh_costs_none() {
    let taken = |copy: u64| {
        let exposure = all_right(&mut labelled(
            Mechanics {
                readout: Duration::from_millis(16),
                copy: Duration::from_millis(copy),
                ..plain()
            },
            COUNT,
        ));
        (
            refreshes(&exposure).round(),
            exposure.retaken,
            exposure.missed_flips,
        )
    };
    assert_eq!(taken(0), (22.0, 0, 0));
    assert_eq!(taken(20), taken(0));
}

#[test]
fn a_camera_that_runs_by_itself_is_followed_from_any_phase() {
    for phase_us in (0..40_000).step_by(1111) {
        for drift_ppm in [-300, 0, 300] {
            let mechanics = Mechanics {
                free_running: free_running(2 * REFRESH, Duration::from_micros(phase_us)),
                flip_to_light: Duration::from_millis(25),
                calibrated_flip_to_light: Duration::from_millis(25),
                readout: Duration::from_millis(12),
                faults: Faults {
                    drift_ppm,
                    ..Faults::default()
                },
                ..plain()
            };
            let exposure = all_right(&mut labelled(mechanics, COUNT));
            // Two refreshes each, and up to four more until the first frame shows the camera's
            // phase. When the phase drifts past a flip, one frame may have to be taken again.
            assert!(
                refreshes(&exposure) < 26.1 && exposure.retaken <= 1,
                "{phase_us} {drift_ppm} {exposure:?}"
            );
        }
    }
}

#[test]
fn a_camera_that_the_projector_triggers_gives_each_pattern_a_whole_exposure() {
    for (dead_us, needed) in [(0, 2), (240, 3)] {
        for (hold, delay_us) in [(needed, 0), (needed, 5_000), (needed, 25_000), (3, 21_000)] {
            let mechanics = Mechanics {
                by_projector: true,
                readout: Duration::from_micros(16_500),
                dead: Duration::from_micros(dead_us),
                flip_to_light: Duration::from_micros(delay_us),
                calibrated_flip_to_light: Duration::from_micros(delay_us),
                calibrated_hold: hold,
                ..plain()
            };
            let exposure = all_right(&mut labelled(mechanics, COUNT));
            let most = f64::from(hold) * 12.0 + 3.0;
            assert!(
                exposure.retaken == 0 && refreshes(&exposure) < most,
                "{dead_us} {hold} {delay_us} {exposure:?}"
            );
        }
    }
}

#[test]
fn stamps_mean_what_calibration_says() {
    for stamp in [Stamp::ExposureStart, Stamp::ExposureEnd, Stamp::ReadoutEnd] {
        let mechanics = Mechanics {
            stamp,
            stamp_late: Duration::from_micros(400),
            calibrated_stamp_late: Duration::from_micros(400),
            readout: Duration::from_millis(9),
            ..plain()
        };
        let mut head = labelled(mechanics, COUNT);
        let exposure = all_right(&mut head);
        assert!(exposure.sync_error < TOLERANCE, "{exposure:?}");
        // With the wrong kind of stamp in the calibration no frame fits its pattern.
        let wrong = if stamp == Stamp::ExposureStart {
            Stamp::ReadoutEnd
        } else {
            Stamp::ExposureStart
        };
        head.set_timing(Timing {
            stamp: wrong,
            ..head.timing()
        });
        let (frames, result) = take(&mut head, &[0, 1, 2]);
        assert!(frames.is_empty(), "{stamp:?}: {frames:?}");
        assert_eq!(result.unwrap_err().kind(), ErrorKind::Protocol);
    }
}

#[test]
fn a_late_flip_is_counted_and_costs_no_frame() {
    let faults = Faults {
        seed: 4,
        late_flip: 0.5,
        late_refreshes: 3,
        ..Faults::default()
    };
    let exposure = all_right(&mut labelled(Mechanics { faults, ..plain() }, COUNT));
    assert!(exposure.missed_flips > 0, "{exposure:?}");
}

#[test]
fn a_lost_frame_is_taken_again_and_all_come_in_the_order_of_the_sequence() {
    let faults = Faults {
        seed: 1,
        dropped: 0.4,
        ..Faults::default()
    };
    let exposure = all_right(&mut labelled(Mechanics { faults, ..plain() }, COUNT));
    assert!(
        exposure.dropped > 0 && exposure.retaken >= exposure.dropped,
        "{exposure:?}"
    );
}

#[test]
fn frames_that_come_twice_or_in_another_order_are_known_by_their_count_and_time() {
    let faults = Faults {
        seed: 1,
        duplicated: 0.4,
        swapped: 0.4,
        ..Faults::default()
    };
    let exposure = all_right(&mut labelled(Mechanics { faults, ..plain() }, COUNT));
    assert!(exposure.duplicated > 0, "{exposure:?}");
    assert_eq!(exposure.retaken, 0);
}

#[test]
fn a_flip_whose_stamp_contradicts_its_count_proves_nothing() {
    let faults = Faults {
        seed: 2,
        wrong_stamp: 0.2,
        ..Faults::default()
    };
    let exposure = all_right(&mut labelled(Mechanics { faults, ..plain() }, COUNT));
    assert!(exposure.sync_error >= REFRESH, "{exposure:?}");
}

#[test]
fn a_stuck_device_ends_in_a_timeout_that_names_it() {
    for (faults, word) in [
        (
            Faults {
                wire_open: true,
                ..Faults::default()
            },
            "trigger",
        ),
        (
            Faults {
                flips_until_stuck: 1,
                ..Faults::default()
            },
            "cables",
        ),
        (
            Faults {
                frames_until_stuck: 3,
                ..Faults::default()
            },
            "(3 of 5 taken): shown 12 times, no frame came",
        ),
    ] {
        let mut head = labelled(Mechanics { faults, ..plain() }, COUNT);
        let (_, result) = take(&mut head, &[0, 1, 2, 3, 4]);
        let error = result.unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Timeout, "{error}");
        assert!(error.to_string().contains(word), "{error}");
    }
}

#[test]
fn a_frame_whose_pulse_was_too_long_is_taken_again_once() {
    let pulses = |long_pulse_us| Faults {
        seed: 1,
        long_pulse: 0.3,
        long_pulse_us,
        ..Faults::default()
    };
    // Short, so that the camera is free again long before the next pattern's light.
    let (exposure, readout) = (REFRESH / 2, Duration::from_millis(4));
    for stamp in [Stamp::ExposureStart, Stamp::ExposureEnd, Stamp::ReadoutEnd] {
        // Below the tolerance of time stamps, above it, and into the next patterns.
        for longest in [180, 2_000, 50_000] {
            let mechanics = Mechanics {
                stamp,
                exposure,
                readout,
                faults: pulses(longest),
                ..plain()
            };
            let exposure = all_but_half_a_percent(&mut labelled(mechanics, COUNT));
            assert!(exposure.spoiled > 0, "{stamp:?} {longest}: {exposure:?}");
            assert!(
                exposure.pulse_error <= Duration::from_micros(longest),
                "{exposure:?}"
            );
            if longest < 10_000 {
                assert_eq!(
                    exposure.retaken, exposure.spoiled,
                    "{stamp:?}: {exposure:?}"
                );
            }
        }
    }
    // A camera that runs by itself has no pulses.
    let mechanics = Mechanics {
        free_running: free_running(2 * REFRESH, Duration::ZERO),
        faults: pulses(2_000),
        ..plain()
    };
    assert_eq!(all_right(&mut labelled(mechanics, COUNT)).spoiled, 0);
}

#[test]
fn pulses_that_never_last_as_long_as_they_should_end_a_sequence_with_the_remedy() {
    let faults = Faults {
        long_pulse: 1.0,
        long_pulse_us: 2_000,
        ..Faults::default()
    };
    let readout = Duration::from_millis(16);
    let mechanics = Mechanics {
        readout,
        faults,
        ..plain()
    };
    let error = take(&mut labelled(mechanics, COUNT), &[0, 1, 2])
        .1
        .unwrap_err();
    assert_eq!(error.kind(), ErrorKind::Timeout);
    let words = error.to_string();
    for word in ["pulses of the trigger", "brightness", "loads the computer"] {
        assert!(words.contains(word), "{words}");
    }
}

#[test]
fn the_camera_is_stopped_and_the_projector_blank_also_after_an_error() {
    let faults = Faults {
        frames_until_stuck: 2,
        ..Faults::default()
    };
    let mut head = labelled(Mechanics { faults, ..plain() }, COUNT);
    take(&mut head, &[0, 1, 2]).1.unwrap_err();
    let devices = head.devices();
    assert_eq!(
        devices.camera.poll_frame().unwrap_err().kind(),
        ErrorKind::Protocol
    );
    let now = devices.clock.now();
    devices.clock.wait(now + 5 * REFRESH);
    assert_eq!(devices.projector.poll_flip(), Ok(None));
}

#[test]
fn a_sequence_ends_early_when_nobody_wants_the_rest_and_the_head_works_on() {
    let mut head = labelled(plain(), COUNT);
    let mut seen = Vec::new();
    let mut two = |index, _| {
        seen.push(index);
        seen.len() < 2
    };
    head.acquire_while(&[3, 2, 1], TIMEOUT, &mut two).unwrap();
    assert_eq!(seen, [3, 2]);
    all_right(&mut head);
}

#[test]
fn a_pattern_may_be_taken_several_times_in_a_sequence() {
    let (frames, result) = take(&mut labelled(plain(), 2), &[0, 1, 1, 0]);
    result.unwrap();
    let shown: Vec<_> = frames
        .iter()
        .map(|(index, label)| (*index, label.shown))
        .collect();
    assert_eq!(
        shown,
        [(0, Some(0)), (1, Some(1)), (1, Some(1)), (0, Some(0))]
    );
}

/// A virtual clock that claims to run by itself.
struct Running(Box<dyn Clock>);

impl Clock for Running {
    fn now(&self) -> Timestamp {
        self.0.now()
    }

    fn wait(&mut self, until: Timestamp) {
        self.0.wait(until);
    }
}

#[test]
fn devices_are_served_while_the_sink_works() {
    let (exposed, exposures) = mpsc::channel();
    let labels = Labels {
        exposed: Some(exposed),
        ..Labels::default()
    };
    let Head {
        devices, timing, ..
    } = in_front_of(labels, plain(), COUNT);
    let mut head = Head::new(
        devices.camera,
        devices.projector,
        devices.trigger,
        Box::new(Running(devices.clock)),
        timing,
    );
    let indices: Vec<usize> = (0..COUNT).collect();
    let mut frames = Vec::new();
    let exposure = head.acquire(&indices, TIMEOUT, &mut |index, frame| {
        if frames.is_empty() {
            // The first frame keeps the sink busy until the camera has exposed them all.
            for _ in 0..COUNT {
                exposures.recv_timeout(Duration::from_secs(20)).unwrap();
            }
        }
        frames.push((index, label(&frame).shown));
    });
    assert_eq!(refreshes(&exposure.unwrap()).round(), 11.0);
    let all: Vec<_> = indices.iter().map(|index| (*index, Some(*index))).collect();
    assert_eq!(frames, all);
}
