//! The signals of the output lines, computed from one snapshot to the next without side effects.

use crate::station::snapshot::status;
use crate::station::{Snapshot, Verdict};

/// The output lines. A start is taken exactly while busy and fault are both off.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Signals {
    /// The station measures, loads, teaches, starts or stops.
    pub busy: bool,
    /// The part of the last start was measured and passed.
    pub ok: bool,
    /// The station is idle, but takes no start: somebody has to do something first.
    pub fault: bool,
}

/// Follows a station. Ok is never on for a part that was not measured: not for the part before, nor
/// for one whose start was missed.
#[derive(Clone, Copy, Debug)]
pub struct Follower {
    seq: u32,
    missed: u32,
    passed: bool,
    said: Signals,
}

impl Follower {
    /// Starts with a snapshot and its signals. Its result is of an earlier part, so it does not
    /// count.
    pub fn new(snapshot: &Snapshot) -> (Self, Signals) {
        let mut follower = Self {
            seq: snapshot.result_seq,
            missed: snapshot.missed,
            passed: false,
            said: Signals::default(),
        };
        follower.said = follower.signals(snapshot);
        (follower, follower.said)
    }

    /// The signals to set after this snapshot, in order; none if nothing changed. Snapshots in
    /// between may be missing.
    pub fn follow(&mut self, snapshot: &Snapshot) -> impl Iterator<Item = Signals> + use<> {
        let finished = snapshot.result_seq != self.seq;
        let missed = snapshot.missed != self.missed;
        let verdict = snapshot.result.as_ref().map(|result| result.verdict);
        if finished {
            self.passed = verdict == Some(Verdict::Pass);
        }
        // Work in this snapshot is on a later part.
        self.passed &= !snapshot.is_working() && !missed;
        (self.seq, self.missed) = (snapshot.result_seq, snapshot.missed);
        // A whole cycle may pass between two snapshots; a machine that waits for busy must still
        // see it.
        let unseen = (finished && !self.said.busy).then_some(Signals {
            busy: true,
            ..Signals::default()
        });
        let signals = self.signals(snapshot);
        self.passed &= !signals.fault;
        let changed = (unseen.is_some() || signals != self.said).then_some(signals);
        self.said = signals;
        unseen.into_iter().chain(changed)
    }

    fn signals(&self, snapshot: &Snapshot) -> Signals {
        let busy = snapshot.is_working();
        let fault = !busy && !snapshot.is(status::READY);
        Signals {
            busy,
            ok: self.passed && !busy && !fault,
            fault,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lines::tests::settings;
    use crate::station::{Micros, ResultRecord, Station};
    use std::sync::Arc;

    const READY: (u16, u16) = (1, status::READY);
    const ACQUIRING: (u16, u16) = (2, 0);
    const LOADING: (u16, u16) = (4, 0);
    const FAULT: (u16, u16) = (7, 0);

    const BUSY: Signals = signals(true, false, false);
    const OK: Signals = signals(false, true, false);
    const NOT_OK: Signals = signals(false, false, false);

    const fn signals(busy: bool, ok: bool, fault: bool) -> Signals {
        Signals { busy, ok, fault }
    }

    /// A station in this state, with the result of this number and so many missed triggers.
    fn snapshot((state, status): (u16, u16), seq: u32, verdict: Verdict, missed: u32) -> Snapshot {
        let record = ResultRecord {
            seq,
            verdict,
            ..ResultRecord::default()
        };
        Snapshot {
            state,
            status,
            result_seq: seq,
            result: Some(Arc::new(record)),
            missed,
            ..Station::new(settings(), Micros(0)).snapshot()
        }
    }

    /// What is said after each of these snapshots, by a station that has just become ready.
    fn said(snapshots: &[Snapshot]) -> Vec<Signals> {
        let (mut follower, first) = Follower::new(&snapshot(READY, 7, Verdict::Pass, 0));
        assert_eq!(first, NOT_OK, "an earlier result does not count");
        let said = snapshots
            .iter()
            .flat_map(|snapshot| follower.follow(snapshot).collect::<Vec<_>>());
        said.collect()
    }

    #[test]
    fn a_part_that_passes_is_busy_then_ok_until_the_next_start() {
        let cycle = [
            snapshot(ACQUIRING, 7, Verdict::Pass, 0),
            snapshot(READY, 8, Verdict::Pass, 0),
            snapshot(READY, 8, Verdict::Pass, 0),
            snapshot(ACQUIRING, 8, Verdict::Pass, 0),
        ];
        assert_eq!(said(&cycle), [BUSY, OK, BUSY]);
    }

    #[test]
    fn a_part_that_fails_or_could_not_be_measured_is_not_ok() {
        for verdict in [Verdict::Fail, Verdict::Invalid, Verdict::None] {
            let cycle = [
                snapshot(ACQUIRING, 7, Verdict::Pass, 0),
                snapshot(READY, 8, verdict, 0),
            ];
            assert_eq!(said(&cycle), [BUSY, NOT_OK]);
        }
    }

    #[test]
    fn a_cycle_between_two_looks_is_busy_all_the_same() {
        let passed = snapshot(READY, 8, Verdict::Pass, 0);
        assert_eq!(said(&[passed]), [BUSY, OK]);
    }

    #[test]
    fn a_missed_start_takes_ok_away() {
        let missed = [
            snapshot(READY, 8, Verdict::Pass, 0),
            snapshot(READY, 8, Verdict::Pass, 1),
        ];
        assert_eq!(said(&missed), [BUSY, OK, NOT_OK]);
    }

    #[test]
    fn ok_does_not_come_back_after_a_fault_or_another_recipe() {
        for (between, shown) in [(FAULT, signals(false, false, true)), (LOADING, BUSY)] {
            let course = [
                snapshot(READY, 8, Verdict::Pass, 0),
                snapshot(between, 8, Verdict::Pass, 0),
                snapshot(READY, 8, Verdict::Pass, 0),
            ];
            assert_eq!(said(&course), [BUSY, OK, shown, NOT_OK]);
        }
    }

    #[test]
    fn ok_does_not_come_back_where_the_end_of_the_cycle_and_the_change_of_recipe_were_one_look() {
        let course = [
            snapshot(LOADING, 8, Verdict::Pass, 0),
            snapshot(READY, 8, Verdict::Pass, 0),
        ];
        assert_eq!(said(&course), [BUSY, BUSY, NOT_OK]);
    }

    #[test]
    fn a_station_that_waits_for_something_else_than_a_start_says_fault() {
        // Offline; and ready without a recipe.
        for state in [(6, 0), (1, 0), (7, 0)] {
            let waits = [snapshot(state, 7, Verdict::Pass, 0)];
            assert_eq!(said(&waits), [signals(false, false, true)]);
        }
    }
}
