//! Reserves RESULT_SEQs on the card ahead of their use, so that no number is used twice and no
//! result waits for the card.
//!
//! The counter's file says which SEQs may be in use. As soon as a quarter of the reserved numbers
//! are used, a thread of its own (`reserving`) reserves [`AHEAD`] again; nothing else that waits
//! for the card runs on it. After a loss of power numbers go on behind the reservation, so that at
//! most [`AHEAD`] are skipped; after kill -9 behind the last result in shared memory
//! (`history/spool.rs`). A stop writes the SEQ of the last result, so that none is skipped.

use super::spool::Spool;
use crate::station::Unstored;
use crate::storage::state::{Counted, Counter, CounterError};
use std::io;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

/// The most numbers that are reserved: at 86 results a second the storage may take half a second
/// for one sync.
pub const AHEAD: u32 = 64;
/// With so many left, more are reserved.
const FEW: i32 = (AHEAD / 4 * 3) as i32;

/// What numbers results.
#[derive(Debug)]
pub struct Numbering {
    /// What the card said at the start, or why that is not known.
    pub counted: Result<Counted, CounterError>,
    /// The counter on the card.
    pub counter: Counter,
    /// The serial of the device.
    pub serial: String,
    /// This start of the daemon: random, not 0.
    pub run: u32,
    /// The time in s since 1970 UTC, if it is known.
    pub utc_s: Option<u64>,
}

impl Numbering {
    /// Reserves the first numbers from `next` on, before anything is measured, and begins this run
    /// in the spool, in BUFFERED mode if a SEQ was acknowledged in it. The answer has no spool where
    /// it cannot be written.
    ///
    /// # Errors
    /// Whatever the file system answers.
    pub(super) fn reserve(
        self,
        spool: Option<Spool>,
        next: u32,
        buffered: Option<u32>,
    ) -> io::Result<(Seqs, Option<Spool>)> {
        let (used, reserved) = (next.wrapping_sub(1), next.wrapping_add(AHEAD - 1));
        let (before, run) = (self.counted.map_or(0, |counted| counted.run), self.run);
        // Killed before the card names this run, the next start still finds the run before.
        let spool = spool.filter(|spool| {
            let begun = spool.begin([before, run], used).is_ok();
            if !begun {
                spool.remove();
            }
            begun
        });
        let numbers = Numbers {
            used,
            reserved,
            buffered,
            asked: None,
            refused: None,
            exhausted: false,
            stopping: false,
        };
        let seqs = Seqs {
            counter: self.counter,
            run,
            shared: Arc::new((Mutex::new(numbers), Condvar::new())),
        };
        seqs.store(reserved, buffered)?;
        if let Some(spool) = &spool {
            // Otherwise the run before is believed as well.
            let _ = spool.begin([run, run], used);
            let _ = spool.buffer(buffered);
        }
        Ok((seqs, spool))
    }
}

/// The reservation; clones share it.
#[derive(Clone, Debug)]
pub struct Seqs {
    counter: Counter,
    run: u32,
    /// The condition is that more numbers are asked for, or the thread is to stop.
    shared: Arc<(Mutex<Numbers>, Condvar)>,
}

/// How far numbers are used and reserved.
#[derive(Debug)]
struct Numbers {
    /// The last SEQ in use.
    used: u32,
    /// The last SEQ that is reserved on the card.
    reserved: u32,
    /// As [`Counted::buffered`].
    buffered: Option<u32>,
    /// Since when the card is asked for more, until it answers.
    asked: Option<Instant>,
    /// What the card answered last, if it refused.
    refused: Option<Arc<str>>,
    /// Whether the station waits, because no number was left.
    exhausted: bool,
    stopping: bool,
}

impl Numbers {
    /// Numbers left. They start anew after 2³² − 1.
    fn left(&self) -> i32 {
        self.reserved.wrapping_sub(self.used) as i32
    }
}

impl Seqs {
    fn numbers(&self) -> MutexGuard<'_, Numbers> {
        self.shared.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes a SEQ into use; it waits for nothing.
    ///
    /// # Errors
    /// No number is reserved after it: none must be used until the card has answered.
    pub fn take(&self, seq: u32) -> Result<(), Unstored> {
        let mut numbers = self.numbers();
        numbers.used = seq;
        let left = numbers.left();
        if left <= FEW && numbers.asked.is_none() {
            numbers.asked = Some(Instant::now());
            self.shared.1.notify_one();
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

    /// Reserves numbers whenever more are asked for, until [`Self::stop`]. `again` gets the last
    /// SEQ in use when the station waited for numbers and there are some.
    pub(super) fn run(&self, again: impl Fn(u32)) {
        loop {
            let idle = |numbers: &mut Numbers| numbers.asked.is_none() && !numbers.stopping;
            let numbers = self.shared.1.wait_while(self.numbers(), idle);
            if numbers.unwrap_or_else(PoisonError::into_inner).stopping {
                return;
            }
            if let Some(seq) = self.refill() {
                again(seq);
            }
        }
    }

    /// Reserves more where they are asked for: it waits for the card. Answers with the last SEQ in
    /// use if the station waited for numbers and there are some.
    fn refill(&self) -> Option<u32> {
        let (last, buffered) = {
            let numbers = self.numbers();
            numbers.asked?;
            (numbers.used.wrapping_add(AHEAD), numbers.buffered)
        };
        let stored = self.store(last, buffered);
        let mut numbers = self.numbers();
        numbers.asked = None;
        numbers.refused = stored.err().map(|error| error.to_string().into());
        if numbers.refused.is_some() {
            return None;
        }
        numbers.reserved = last;
        // Many were used, or one acknowledged, while the card was busy.
        let more = numbers.left() <= FEW || numbers.buffered != buffered;
        numbers.asked = more.then(Instant::now);
        std::mem::take(&mut numbers.exhausted).then_some(numbers.used)
    }

    /// Has the card remember what was acknowledged in BUFFERED mode; it waits for nothing.
    pub(super) fn buffer(&self, buffered: Option<u32>) {
        let mut numbers = self.numbers();
        numbers.buffered = buffered;
        numbers.asked.get_or_insert_with(Instant::now);
        self.shared.1.notify_one();
    }

    fn store(&self, last: u32, buffered: Option<u32>) -> io::Result<()> {
        self.counter.store(Counted {
            last,
            run: self.run,
            buffered,
            copied: false,
        })
    }

    /// Ends the thread.
    pub(super) fn stop(&self) {
        self.numbers().stopping = true;
        self.shared.1.notify_one();
    }

    /// Gives back what was not used, once the thread has ended: `seq` is the last of all.
    ///
    /// # Errors
    /// Whatever the file system answers.
    pub(super) fn settle(&self, seq: u32) -> io::Result<()> {
        let buffered = self.numbers().buffered;
        self.store(seq, buffered)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::history::Entry;
    use crate::storage::state::StateFolder;
    use std::os::unix::fs::MetadataExt as _;
    use std::path::Path;

    /// Reserves without shared memory.
    fn reserved(state: &StateFolder, next: u32) -> Seqs {
        let numbering = Numbering {
            counted: Ok(Counted::default()),
            counter: state.counter(),
            serial: String::new(),
            run: 1,
            utc_s: None,
        };
        numbering.reserve(None, next, None).unwrap().0
    }

    #[test]
    fn after_a_kill_counting_goes_on_and_after_a_loss_of_power_behind_the_reservation() {
        let folder = tempfile::tempdir().unwrap();
        let state = StateFolder::open(folder.path()).unwrap();
        let serial = state.serial().unwrap();
        let spool = || {
            let owner = std::fs::metadata(folder.path()).unwrap().uid();
            Spool::open(&serial, owner).unwrap()
        };
        // What the next start finds.
        let after = || {
            let counted = state.counted().unwrap();
            let shown = spool().of_run(counted.run).map(|(last, _)| last);
            shown.unwrap_or(counted.last) + 1
        };
        let begin = |run, next| {
            let numbering = Numbering {
                counted: state.counted(),
                counter: state.counter(),
                serial: serial.clone(),
                run,
                utc_s: None,
            };
            let (seqs, spool) = numbering.reserve(Some(spool()), next, None).unwrap();
            (seqs, spool.unwrap())
        };
        let show = |spool: &Spool, seq| {
            let entry = Entry {
                seq,
                ..Entry::default()
            };
            spool.put(&entry).unwrap();
        };
        let (mut next, mut skipped) = (1, 0);
        for run in 1..=6_u32 {
            let (seqs, own) = begin(run, next);
            for _ in 0..50 * (run - 1) {
                seqs.take(next).unwrap();
                assert_eq!(seqs.refill(), None);
                show(&own, next);
                next += 1;
            }
            let lost_power = run % 2 == 0;
            if lost_power {
                own.remove();
            }
            drop(own);
            let found = after();
            match lost_power {
                true => assert!(found >= next && found - next <= AHEAD, "{next} {found}"),
                false => assert_eq!(found, next),
            }
            skipped += found - next;
            next = found;
        }
        assert!(skipped > 0);
        let (seqs, own) = begin(9, next);
        seqs.take(next + AHEAD - 2).unwrap();
        // The last one that is reserved: it does not come back, also after a loss of power, and no
        // other may follow.
        let last = next + AHEAD - 1;
        assert!(matches!(seqs.take(last), Err(Unstored::Busy(_))));
        show(&own, last);
        drop(own);
        assert_eq!(after(), last + 1);
        spool().remove();
        assert_eq!(after(), last + 1);
        seqs.settle(next).unwrap();
        assert_eq!(after(), next + 1);
        spool().remove();
    }

    #[test]
    fn numbers_that_start_anew_are_taken_too() {
        let folder = tempfile::tempdir().unwrap();
        let state = StateFolder::open(folder.path()).unwrap();
        let seqs = reserved(&state, u32::MAX - 1);
        assert!(seqs.take(u32::MAX).is_ok() && seqs.take(3).is_ok() && seqs.take(100).is_err());
        assert_eq!(seqs.refill(), Some(100));
        assert!(seqs.take(101).is_ok());
    }

    /// Puts a pipe in place of the counter's file: writing hangs until it is read.
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
        let seqs = reserved(&state, 1);
        let file = folder.path().join("result-seq");
        hang(&file);
        let (told, again) = std::sync::mpsc::channel();
        let reserving = seqs.clone();
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
        // What was under way as the folder went may still be refused, so it is asked until it answers.
        let began = Instant::now();
        let told = loop {
            let _ = seqs.take(3 * AHEAD);
            if let Ok(seq) = again.recv_timeout(std::time::Duration::from_millis(10)) {
                break seq;
            }
            assert!(began.elapsed() < patience);
        };
        assert_eq!(told, 3 * AHEAD);
        assert_eq!(seqs.refused(), None);
        seqs.stop();
        thread.join().unwrap();
    }
}
