//! Reserves RESULT_SEQs ahead of their use, so that none is used twice and none waits for the card.
//!
//! The counter's file says which SEQs may be in use: at the start, and whenever a quarter of them are gone, up to [`AHEAD`]
//! are reserved by a thread of its own (`reserving`), so that no other sync of the history comes before. Besides, each SEQ
//! is marked in memory that a kill does not touch (`mark`). So after kill -9 counting goes on behind the last number that was
//! in use; after a loss of power behind the reservation, so that at most [`AHEAD`] numbers are skipped; after a stop the file
//! holds the SEQ of the last result and none is.

use super::mark::Mark;
use crate::station::Unstored;
use crate::storage::state::{Counted, Counter};
use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

/// The most numbers that are reserved: at 86 results a second the storage may take half a second for one sync.
pub const AHEAD: u32 = 64;
/// With so many left, more are reserved.
const FEW: i32 = (AHEAD / 4 * 3) as i32;

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
    wake: SyncSender<()>,
    stopping: Arc<AtomicBool>,
    numbers: Arc<Mutex<Numbers>>,
}

/// How far numbers are used and reserved.
#[derive(Debug)]
struct Numbers {
    /// The last SEQ in use.
    used: u32,
    /// The last SEQ that is reserved on the card.
    reserved: u32,
    /// Since when the card has been asked for more, while it does not answer.
    asked: Option<Instant>,
    /// What the card answered last, if it refused.
    refused: Option<Arc<str>>,
    /// Whether the station was told that there is no number left.
    exhausted: bool,
}

impl Numbers {
    /// Numbers left. They start anew after 2³² − 1.
    fn left(&self) -> i32 {
        self.reserved.wrapping_sub(self.used) as i32
    }
}

/// The thread that asks the card for more numbers.
pub(super) struct Reserving {
    seqs: Seqs,
    woken: Receiver<()>,
}

impl Reserving {
    /// Works until told to stop. `again` is told the last SEQ in use when the station waited for numbers and there are some.
    pub(super) fn run(self, again: impl Fn(u32)) {
        while self.woken.recv().is_ok() && !self.seqs.stopping.load(Ordering::Acquire) {
            if let Some(seq) = self.seqs.refill() {
                again(seq);
            }
        }
    }
}

impl Seqs {
    /// Reserves the first numbers from `next` on for this `run`, before anything is measured. Answers with the thread's side.
    ///
    /// # Errors
    /// Whatever the file system answers.
    pub(super) fn reserve(
        counter: Counter,
        mark: Option<Mark>,
        run: u32,
        next: u32,
    ) -> io::Result<(Self, Reserving)> {
        let (used, reserved) = (next.wrapping_sub(1), next.wrapping_add(AHEAD - 1));
        // The mark first: from then on neither is believed without the other.
        let mark = mark.filter(|mark| mark.write(Counted { last: used, run }).is_ok());
        let last = reserved;
        counter.store(Counted { last, run })?;
        let (wake, woken) = sync_channel(1);
        let numbers = Numbers {
            used,
            reserved,
            asked: None,
            refused: None,
            exhausted: false,
        };
        let seqs = Self {
            counter,
            mark: mark.map(Arc::new),
            run,
            wake,
            stopping: Arc::default(),
            numbers: Arc::new(Mutex::new(numbers)),
        };
        let reserving = Reserving {
            seqs: seqs.clone(),
            woken,
        };
        Ok((seqs, reserving))
    }

    fn numbers(&self) -> MutexGuard<'_, Numbers> {
        self.numbers.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes a SEQ into use; it waits for nothing.
    ///
    /// # Errors
    /// There is no reserved number after it: none must be used until the card has answered.
    pub fn take(&self, seq: u32) -> Result<(), Unstored> {
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
        let mut numbers = self.numbers();
        numbers.used = seq;
        let left = numbers.left();
        if left <= FEW {
            // It is awake already.
            let _ = self.wake.try_send(());
        }
        numbers.exhausted = left <= 0;
        if left > 0 {
            return Ok(());
        }
        Err(match &numbers.refused {
            Some(words) => Unstored::Refused(words.clone()),
            None => Unstored::Busy(numbers.asked.map_or(0, |asked| asked.elapsed().as_millis())),
        })
    }

    /// Why the card did not reserve numbers, while it does not.
    pub(super) fn refused(&self) -> Option<String> {
        let words = self.numbers().refused.clone()?;
        Some(format!("reserve result numbers: {words}: free space"))
    }

    /// Reserves more where few are left: it waits for the card. Answers with the last SEQ in use if the station was told
    /// that there is none left, and now there is.
    fn refill(&self) -> Option<u32> {
        let used = {
            let mut numbers = self.numbers();
            if numbers.left() > FEW {
                return None;
            }
            numbers.asked = Some(Instant::now());
            numbers.used
        };
        let last = used.wrapping_add(AHEAD);
        let run = self.run;
        let stored = self.counter.store(Counted { last, run });
        let mut numbers = self.numbers();
        numbers.asked = None;
        numbers.refused = stored.err().map(|error| error.to_string().into());
        if numbers.refused.is_some() {
            return None;
        }
        numbers.reserved = last;
        std::mem::take(&mut numbers.exhausted).then_some(numbers.used)
    }

    /// Ends the thread.
    pub(super) fn stop(&self) {
        self.stopping.store(true, Ordering::Release);
        let _ = self.wake.try_send(());
    }

    /// Gives back what was not used, once the thread has ended: `seq` is the last of all.
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
    use crate::storage::state::StateFolder;
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
            let (seqs, _) = Seqs::reserve(state.counter(), own, run, next).unwrap();
            for _ in 0..50 * (run - 1) {
                seqs.take(next).unwrap();
                assert_eq!(seqs.refill(), None);
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
        let (seqs, _) = Seqs::reserve(state.counter(), own, 9, next).unwrap();
        seqs.take(next + AHEAD - 2).unwrap();
        // The last one that is reserved: it does not come back, also after a loss of power, and no other may follow.
        let last = next + AHEAD - 1;
        assert_eq!(seqs.take(last), Err(Unstored::Busy(0)));
        let marked = mark(folder.path(), &state).and_then(|mark| mark.read());
        for marked in [marked, None] {
            let after = next_after(state.counted().unwrap(), marked);
            assert_eq!(after, last + 1);
        }
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
        let (seqs, _) = Seqs::reserve(state.counter(), None, 1, u32::MAX - 1).unwrap();
        assert!(seqs.take(u32::MAX).is_ok() && seqs.take(3).is_ok() && seqs.take(100).is_err());
        assert_eq!(seqs.refill(), Some(100));
        assert!(seqs.take(101).is_ok());
    }

    /// The counter's file of a storage that hangs until somebody reads from it.
    fn hang(file: &Path) {
        std::fs::remove_file(file).unwrap();
        let kind = rustix::fs::FileType::Fifo;
        let mode = rustix::fs::Mode::RUSR | rustix::fs::Mode::WUSR;
        rustix::fs::mknodat(rustix::fs::CWD, file, kind, mode, 0).unwrap();
    }

    #[test]
    fn a_storage_that_is_busy_is_told_from_one_that_refuses_and_the_station_hears_at_once_when_it_answers()
     {
        let folder = tempfile::tempdir().unwrap();
        let state = StateFolder::open(folder.path()).unwrap();
        let (seqs, reserving) = Seqs::reserve(state.counter(), None, 1, 1).unwrap();
        let file = folder.path().join("result-seq");
        hang(&file);
        let (told, again) = std::sync::mpsc::channel();
        let thread = std::thread::spawn(move || reserving.run(|seq| told.send(seq).unwrap()));
        // Numbers go on as far as they are reserved.
        for seq in 1..AHEAD {
            assert_eq!(seqs.take(seq), Ok(()), "{seq}");
        }
        let began = Instant::now();
        while seqs.numbers().asked.is_none() {
            assert!(began.elapsed().as_secs() < 30);
            std::thread::yield_now();
        }
        assert!(matches!(seqs.take(AHEAD), Err(Unstored::Busy(_))));
        // It answers.
        drop(std::fs::File::open(&file).unwrap());
        let patience = std::time::Duration::from_secs(30);
        assert_eq!(again.recv_timeout(patience), Ok(AHEAD));
        assert_eq!(seqs.take(AHEAD + 1), Ok(()));
        let began = Instant::now();
        while seqs.numbers().left() <= FEW {
            assert!(began.elapsed() < patience);
        }
        let reserved = state.counted().unwrap().last;
        assert!(
            reserved > AHEAD + 1 && reserved <= 2 * AHEAD + 1,
            "{reserved}"
        );
        // It refuses.
        std::fs::remove_file(&file).unwrap();
        std::fs::create_dir_all(file.join("in the way")).unwrap();
        let began = Instant::now();
        while !matches!(seqs.take(3 * AHEAD), Err(Unstored::Refused(_))) {
            assert!(began.elapsed() < patience);
        }
        assert!(seqs.refused().unwrap().contains("reserve result numbers"));
        std::fs::remove_dir_all(&file).unwrap();
        assert!(seqs.take(3 * AHEAD).is_err());
        assert_eq!(again.recv_timeout(patience), Ok(3 * AHEAD));
        assert_eq!(seqs.refused(), None);
        seqs.stop();
        thread.join().unwrap();
    }
}
