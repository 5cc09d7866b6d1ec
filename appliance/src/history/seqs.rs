//! Reserves RESULT_SEQs ahead of their use, so that none is used twice and none waits for the card.
//!
//! The counter's file says which SEQs may be in use: at the start, and whenever half of them are gone, [`AHEAD`] more are
//! reserved by the history's thread. Besides, each SEQ is marked in memory that a kill does not touch (`mark`). So after
//! kill -9 counting goes on behind the last number that was in use; after a loss of power behind the reservation, so that at
//! most [`AHEAD`] numbers are skipped; after a stop the file holds the SEQ of the last result and none is.

use super::mark::Mark;
use crate::state::{Counted, Counter};
use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

/// Numbers that are reserved at a time: ten seconds of a fast line, in which the card must have answered once.
pub const AHEAD: u32 = 64;

/// What numbers results.
#[derive(Debug)]
pub struct Numbering {
    /// What the card said at the start.
    pub counted: Counted,
    /// How the card is told.
    pub counter: Counter,
    /// The device's.
    pub serial: String,
    /// This start of the daemon: random, not 0.
    pub run: u32,
}

/// The SEQ to go on with after the run that left `counted` on the card and, as far as the system lived on, `marked` in memory.
pub fn next_after(counted: Counted, marked: Option<Counted>) -> u32 {
    // A mark of another run says nothing of this card: it may be of a copy of the folder.
    let same = marked.filter(|mark| counted.run != 0 && mark.run == counted.run);
    same.map_or(counted.last, |mark| mark.last).wrapping_add(1)
}

/// The reservation; clones share it.
#[derive(Clone, Debug)]
pub struct Seqs {
    counter: Counter,
    mark: Option<Arc<Mark>>,
    run: u32,
    /// The last SEQ that is reserved on the card.
    reserved: Arc<AtomicU32>,
}

impl Seqs {
    /// Reserves the first numbers from `next` on for this `run`, before anything is measured.
    ///
    /// # Errors
    /// Whatever the file system answers.
    pub fn reserve(counter: Counter, mark: Option<Mark>, run: u32, next: u32) -> io::Result<Self> {
        let last = next.wrapping_add(AHEAD - 1);
        // The mark first: from then on neither is believed without the other.
        let mark = mark.filter(|mark| {
            let before = next.wrapping_sub(1);
            mark.write(Counted { last: before, run }).is_ok()
        });
        counter.store(Counted { last, run })?;
        Ok(Self {
            counter,
            mark: mark.map(Arc::new),
            run,
            reserved: Arc::new(AtomicU32::new(last)),
        })
    }

    /// Takes a SEQ into use, and answers whether it is reserved on the card.
    pub fn take(&self, seq: u32) -> bool {
        // Also where it is not reserved: the station shows that result and takes no further trigger.
        let counted = Counted {
            last: seq,
            run: self.run,
        };
        if let Some(mark) = &self.mark
            && mark.write(counted).is_err()
        {
            // None is better than an old one.
            mark.remove();
        }
        self.left_after(seq) >= 0
    }

    /// Numbers left behind a SEQ; negative where it is not reserved. Numbers start anew after 2³² − 1.
    fn left_after(&self, seq: u32) -> i32 {
        self.reserved.load(Ordering::Acquire).wrapping_sub(seq) as i32
    }

    /// Reserves more where half of the numbers behind `seq` are gone. For the history's thread: it waits for the card.
    ///
    /// # Errors
    /// Whatever the file system answers.
    pub(super) fn refill(&self, seq: u32) -> io::Result<()> {
        if self.left_after(seq) > (AHEAD / 2) as i32 {
            return Ok(());
        }
        let last = seq.wrapping_add(AHEAD);
        let run = self.run;
        self.counter.store(Counted { last, run })?;
        self.reserved.store(last, Ordering::Release);
        Ok(())
    }

    /// Gives back what was not used: `seq` is the last of all.
    ///
    /// # Errors
    /// Whatever the file system answers.
    pub(super) fn settle(&self, seq: u32) -> io::Result<()> {
        let run = self.run;
        self.counter.store(Counted { last: seq, run })?;
        if let Some(mark) = &self.mark {
            mark.remove();
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::state::StateFolder;
    use std::os::unix::fs::MetadataExt as _;
    use std::path::Path;

    /// The mark of a folder; of none where the power was lost.
    fn mark(folder: &Path, state: &StateFolder) -> Option<Mark> {
        let owner = std::fs::metadata(folder).unwrap().uid();
        Some(Mark::open(&state.serial().unwrap(), owner).unwrap())
    }

    #[test]
    fn after_a_kill_counting_goes_on_and_after_a_loss_of_power_behind_the_reservation() {
        let folder = tempfile::tempdir().unwrap();
        let state = StateFolder::open(folder.path()).unwrap();
        let (mut next, mut skipped) = (1, 0);
        for run in 1..=6_u32 {
            let own = mark(folder.path(), &state);
            let seqs = Seqs::reserve(state.counter(), own, run, next).unwrap();
            for _ in 0..50 * (run - 1) {
                assert!(seqs.take(next));
                seqs.refill(next).unwrap();
                next += 1;
            }
            // What the next start finds.
            let lost_power = run % 2 == 0;
            let found = mark(folder.path(), &state).filter(|_| !lost_power);
            let marked = found.and_then(|mark| mark.read());
            let after = next_after(state.counted().unwrap(), marked);
            match lost_power {
                true => assert!(after >= next && after - next <= AHEAD, "{next} {after}"),
                false => assert_eq!(after, next),
            }
            skipped += after - next;
            next = after;
        }
        assert!(skipped > 0);
        let own = mark(folder.path(), &state);
        let seqs = Seqs::reserve(state.counter(), own, 9, next).unwrap();
        assert!(seqs.take(next + AHEAD - 1) && !seqs.take(next + AHEAD));
        // What was shown without being reserved does not come back either.
        let marked = mark(folder.path(), &state).and_then(|mark| mark.read());
        let after = next_after(state.counted().unwrap(), marked);
        assert_eq!(after, next + AHEAD + 1);
        seqs.settle(next).unwrap();
        let marked = mark(folder.path(), &state).and_then(|mark| mark.read());
        assert_eq!(next_after(state.counted().unwrap(), marked), next + 1);
        mark(folder.path(), &state).unwrap().remove();
    }

    #[test]
    fn a_mark_of_another_run_is_not_believed() {
        let counted = Counted { last: 64, run: 5 };
        let mark = |last, run| Some(Counted { last, run });
        assert_eq!(next_after(counted, mark(10, 5)), 11);
        assert_eq!(next_after(counted, mark(10, 6)), 65);
        assert_eq!(next_after(counted, None), 65);
        let by_hand = Counted { last: 64, run: 0 };
        assert_eq!(next_after(by_hand, mark(10, 0)), 65);
    }

    #[test]
    fn numbers_that_start_anew_are_taken_too() {
        let folder = tempfile::tempdir().unwrap();
        let state = StateFolder::open(folder.path()).unwrap();
        let seqs = Seqs::reserve(state.counter(), None, 1, u32::MAX - 1).unwrap();
        assert!(seqs.take(u32::MAX) && seqs.take(3) && !seqs.take(100));
    }
}
