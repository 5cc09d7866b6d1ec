//! A watch that is ended early.

use super::*;
use std::cell::Cell;

#[test]
fn a_watch_ends_within_a_refresh_when_it_is_told_to_and_keeps_what_has_arrived() {
    let mut head = labelled(plain(), 2);
    let showing = |index| Showing {
        index,
        refreshes: 50,
        settle: 3,
    };
    let showings = [showing(0), showing(1)];
    let whole = head.watch(&showings, TIMEOUT, &mut label).unwrap();
    assert_eq!(whole.flips.len(), 2);
    let (asked, frames) = (Cell::new(0), Cell::new(0));
    let go_on = || {
        asked.set(asked.get() + 1);
        frames.get() < 3
    };
    let mut measure = |frame: &Frame| {
        frames.set(frames.get() + 1);
        label(frame)
    };
    let began = head.devices().clock.now();
    let ended = head
        .watch_while(&showings, TIMEOUT, &mut measure, &go_on)
        .unwrap();
    let took = head.devices().clock.now().since(began);
    assert_eq!((ended.flips.len(), ended.frames.len()), (1, 3));
    // The flip, the time to settle, three exposures and what the end may take.
    assert!(took <= REFRESH * (2 + 3 + 3 * 2 + 1), "{took:?}");
    // It is asked at least once per refresh, also while nothing happens.
    assert!(u128::from(asked.get() as u32) >= took.as_nanos() / REFRESH.as_nanos());
    // Nothing is left of it: the next sequence is whole.
    let (taken, result) = take(&mut head, &[0, 1]);
    result.unwrap();
    assert_eq!(taken.len(), 2);
}
