//! Work beside loaded patterns that can be ended at any time.

use super::*;
use crate::error::ErrorKind;
use std::sync::atomic::{AtomicUsize, Ordering};

const START_UP: Duration = Duration::from_millis(500);
/// Longest time from the end to the head's return: the frame that was triggered is exposed and
/// delivered.
const A_FRAME: Duration = Duration::from_millis(4 * 17);

fn rasters(count: usize) -> Vec<Raster> {
    vec![Raster::uniform(1, 1, 0).unwrap(); count]
}

/// Goes on until it has been asked this often, and then never again.
fn asked(often: usize) -> GoOn {
    let count = AtomicUsize::new(0);
    Arc::new(move || count.fetch_add(1, Ordering::Relaxed) < often)
}

#[test]
fn what_is_loaded_aside_comes_behind_the_patterns_that_stay() {
    let mut head = labelled(plain(), 3);
    let taken = head.aside(3, Arc::new(|| true), |head| {
        head.load(rasters(2)).unwrap();
        take(head, &[0, 1])
    });
    let shown: Vec<_> = taken
        .0
        .iter()
        .map(|(index, label)| (*index, label.shown))
        .collect();
    // Counted from behind the three in the head, and from the first in the projector.
    assert_eq!(shown, [(0, Some(3)), (1, Some(4))]);
    taken.1.unwrap();
    let (taken, result) = take(&mut head, &[0, 1, 2]);
    assert_eq!((taken.len(), taken[2].1.shown), (3, Some(2)));
    result.unwrap();
    let refused = head.aside(6, Arc::new(|| true), |head| head.load(rasters(1)));
    assert_eq!(refused.unwrap_err().kind(), ErrorKind::Protocol);
}

#[test]
fn a_sequence_that_is_ended_takes_at_most_a_frame_and_leaves_the_camera_on() {
    for free_running in [None, free_running(2 * REFRESH, Duration::ZERO)] {
        for often in 0..40 {
            let mechanics = Mechanics {
                start_up: START_UP,
                readout: Duration::from_millis(9),
                free_running,
                ..plain()
            };
            let mut head = labelled(mechanics, 12);
            let began = head.devices().clock.now();
            let result = head.aside(0, asked(often), |head| {
                let indices: Vec<usize> = (0..12).collect();
                head.acquire(&indices, TIMEOUT, &mut |_, _| ())
            });
            let took = head.devices().clock.now().since(began);
            let Err(error) = result else { continue };
            assert_eq!(error.kind(), ErrorKind::Ended, "{error}");
            // It was asked at least once a refresh until then.
            let most = START_UP + REFRESH * u32::try_from(often).unwrap() + A_FRAME;
            assert!(took <= most, "{often}: {took:?}");
            // The next cycle is whole, and waits for a start only of a camera that never stays on.
            let (frames, result) = take(&mut head, &[0, 1, 2]);
            let exposure = result.unwrap();
            for ((index, label), wanted) in frames.iter().zip(0..) {
                assert_eq!((*index, label.shown), (wanted, Some(wanted)));
            }
            let start_up = match free_running {
                None => Duration::ZERO,
                Some(_) => START_UP,
            };
            assert_eq!(exposure.start_up, start_up, "{often}");
        }
    }
}

#[test]
fn loading_and_watching_are_ended_too() {
    let mut head = labelled(plain(), 2);
    let loaded = head.aside(2, asked(1), |head| head.load(rasters(9)));
    assert_eq!(loaded.unwrap_err().kind(), ErrorKind::Ended);
    let showings = [Showing {
        index: 0,
        refreshes: 500,
        settle: 3,
    }];
    let began = head.devices().clock.now();
    let watched = head.aside(0, asked(20), |head| {
        head.watch(&showings, TIMEOUT, &mut label).map(|_| ())
    });
    assert_eq!(watched.unwrap_err().kind(), ErrorKind::Ended);
    let took = head.devices().clock.now().since(began);
    assert!(took <= REFRESH * 21, "{took:?}");
    let (frames, result) = take(&mut head, &[0, 1]);
    result.unwrap();
    assert_eq!(frames.len(), 2);
}
