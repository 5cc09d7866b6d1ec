//! Reserves RESULT_SEQs ahead of their use, so that none is used twice and none waits for the card.
//!
//! The counter's file says which SEQs may be in use: at the start, and whenever half of them are gone, [`AHEAD`] more are
//! reserved by the history's thread. After kill -9 or a loss of power counting goes on behind the reservation, so at most
//! [`AHEAD`] numbers are skipped; after a stop the file holds the SEQ of the last result and none is.

use crate::state::Counter;
use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

/// Numbers that are reserved at a time: ten seconds of a fast line, in which the card must have answered once.
pub const AHEAD: u32 = 64;

/// The reservation; clones share it.
#[derive(Clone, Debug)]
pub struct Seqs {
    counter: Counter,
    /// The last SEQ that is reserved on the card.
    reserved: Arc<AtomicU32>,
}

impl Seqs {
    /// Reserves the first numbers from `next` on, before anything is measured.
    ///
    /// # Errors
    /// Whatever the file system answers.
    pub fn reserve(counter: Counter, next: u32) -> io::Result<Self> {
        let last = next.wrapping_add(AHEAD - 1);
        counter.store(last)?;
        Ok(Self {
            counter,
            reserved: Arc::new(AtomicU32::new(last)),
        })
    }

    /// Whether a SEQ may be shown: it is reserved on the card.
    pub fn covers(&self, seq: u32) -> bool {
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
        self.counter.store(last)?;
        self.reserved.store(last, Ordering::Release);
        Ok(())
    }

    /// Gives back what was not used: `seq` is the last of all.
    ///
    /// # Errors
    /// Whatever the file system answers.
    pub(super) fn settle(&self, seq: u32) -> io::Result<()> {
        self.counter.store(seq)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::state::StateFolder;

    #[test]
    fn a_restart_never_finds_a_number_that_was_covered() {
        let folder = tempfile::tempdir().unwrap();
        let state = StateFolder::open(folder.path()).unwrap();
        let mut next = state.next_seq().unwrap();
        for run in 0..5_u32 {
            let seqs = Seqs::reserve(state.counter(), next).unwrap();
            let first = next;
            for _ in 0..50 * run {
                assert!(seqs.covers(next));
                seqs.refill(next).unwrap();
                next += 1;
            }
            // Killed.
            let after = state.next_seq().unwrap();
            assert!(
                after >= next && after - next <= AHEAD,
                "{first} {next} {after}"
            );
            next = after;
        }
        let seqs = Seqs::reserve(state.counter(), next).unwrap();
        assert!(seqs.covers(next + AHEAD - 1) && !seqs.covers(next + AHEAD));
        seqs.settle(next).unwrap();
        assert_eq!(state.next_seq().unwrap(), next + 1);
    }

    #[test]
    fn numbers_that_start_anew_are_covered_too() {
        let folder = tempfile::tempdir().unwrap();
        let state = StateFolder::open(folder.path()).unwrap();
        let seqs = Seqs::reserve(state.counter(), u32::MAX - 1).unwrap();
        assert!(seqs.covers(u32::MAX) && seqs.covers(3) && !seqs.covers(100));
    }
}
