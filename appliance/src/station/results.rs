//! The results of this run as the PLC sees them: their numbers, the latest one with its handshake,
//! the queue of BUFFERED mode.

use std::sync::Arc;

use serde::Serialize;

use super::result::{ResultRecord, Verdict};

/// The most unacknowledged results in BUFFERED mode.
pub const MAX_BUFFERED: usize = 32;

/// How many results there are of each verdict.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Counts {
    /// PASS.
    pub pass: u64,
    /// FAIL.
    pub fail: u64,
    /// INVALID.
    pub invalid: u64,
}

impl Counts {
    /// Counts results of a verdict.
    pub fn add(&mut self, verdict: Verdict, count: u64) {
        match verdict {
            Verdict::Pass => self.pass += count,
            Verdict::Fail => self.fail += count,
            Verdict::Invalid => self.invalid += count,
            Verdict::None => {}
        }
    }
}

/// What the run before has left of BUFFERED mode.
#[derive(Debug, Clone, Default)]
pub struct Buffered {
    /// The SEQ that was acknowledged last; `None` if the mode was not in use.
    pub acknowledged: Option<u32>,
    /// The results behind it, oldest first.
    pub queue: Vec<Arc<ResultRecord>>,
}

/// The results since the start.
#[derive(Debug, Clone, Default)]
pub(super) struct Results {
    /// RESULT_SEQ of the last result, also of the run before.
    pub(super) last_seq: u32,
    /// Whether `last_seq` still has to be stored. Until then no trigger is accepted.
    pub(super) unstored: bool,
    /// How many results there were.
    pub(super) counts: Counts,
    /// The last result.
    pub(super) latest: Option<Arc<ResultRecord>>,
    /// RESULT_VALID.
    pub(super) valid: bool,
    /// RESULT_TOGGLE.
    pub(super) toggle: bool,
    /// EXPOSURE_DONE.
    pub(super) exposure_done: bool,
    /// The SEQ that was acknowledged last in BUFFERED mode; `None` outside of it.
    pub(super) buffered: Option<u32>,
    /// Unacknowledged results, oldest first.
    pub(super) queue: heapless::Deque<Arc<ResultRecord>, MAX_BUFFERED>,
    /// BUFFER_OVERFLOW.
    pub(super) overflow_latch: bool,
}

impl Results {
    /// No result yet; the first one is `next_seq`. In BUFFERED mode the run before has left those
    /// that were not acknowledged; of more than there is room for the oldest.
    pub(super) fn new(next_seq: u32, left: &Buffered) -> Self {
        let mut queue = heapless::Deque::new();
        for record in left.queue.iter().take(MAX_BUFFERED) {
            // There is room for all of them.
            let _ = queue.push_back(record.clone());
        }
        Self {
            last_seq: next_seq.wrapping_sub(1),
            buffered: left.acknowledged,
            queue,
            ..Self::default()
        }
    }

    /// Begins BUFFERED mode; answers whether that is new.
    pub(super) fn buffer(&mut self) -> bool {
        let begins = self.buffered.is_none();
        self.buffered = self.buffered.or(Some(self.last_seq));
        begins
    }

    /// A trigger was accepted.
    pub(super) fn begin(&mut self) {
        self.exposure_done = false;
        self.valid = false;
    }

    /// The part may move.
    pub(super) fn exposed(&mut self) {
        self.exposure_done = true;
    }

    /// The number of the result that is complete now.
    pub(super) fn next_seq(&mut self) -> u32 {
        self.last_seq = self.last_seq.wrapping_add(1);
        self.last_seq
    }

    /// Shows a result as one unit. Answers whether it was queued where it had to be.
    pub(super) fn publish(&mut self, record: Arc<ResultRecord>) -> bool {
        let queued = self.buffered.is_none() || self.queue.push_back(record.clone()).is_ok();
        self.overflow_latch |= !queued;
        self.counts.add(record.verdict, 1);
        self.latest = Some(record);
        self.valid = true;
        self.toggle = !self.toggle;
        self.exposure_done = true;
        queued
    }

    /// RESULT_ACK. Answers whether BUFFERED mode has to remember it.
    pub(super) fn acknowledge(&mut self) -> bool {
        self.valid = false;
        let taken = self.queue.pop_front();
        if let Some((taken, acknowledged)) = taken.as_ref().zip(self.buffered.as_mut()) {
            *acknowledged = taken.seq;
        }
        taken.is_some() && self.buffered.is_some()
    }

    /// The storage has this number. Only the last one counts: its storing covers those before it.
    pub(super) fn stored(&mut self, seq: u32) {
        self.unstored &= seq != self.last_seq;
    }

    /// The storage does not have the last number.
    pub(super) fn not_stored(&mut self) {
        self.unstored = true;
    }

    /// ERROR_RESET.
    pub(super) fn reset(&mut self) {
        self.overflow_latch = false;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_full_queue_still_shows_the_result_and_latches_the_overflow() {
        let mut results = Results::new(1, &Buffered::default());
        assert!(results.buffer() && !results.buffer());
        for seq in 1..=MAX_BUFFERED + 1 {
            let record = ResultRecord {
                seq: results.next_seq(),
                ..ResultRecord::default()
            };
            let queued = results.publish(Arc::new(record));
            assert_eq!(queued, seq <= MAX_BUFFERED);
        }
        assert!(results.overflow_latch && results.valid);
        assert_eq!(results.latest.as_ref().unwrap().seq, results.last_seq);
        results.acknowledge();
        assert_eq!(results.queue.front().unwrap().seq, 2);
    }

    #[test]
    fn only_the_last_number_settles_the_storage() {
        let mut results = Results::new(u32::MAX, &Buffered::default());
        assert_eq!((results.next_seq(), results.next_seq()), (u32::MAX, 0));
        results.not_stored();
        results.stored(u32::MAX);
        assert!(results.unstored);
        results.stored(0);
        assert!(!results.unstored);
    }
}
