//! The last results in memory that outlives this process but not the system.
//!
//! Each result is put into POSIX shared memory before it is shown. No card is behind that memory,
//! so this takes microseconds whatever the card does. After kill -9 the next start stores the
//! results that the database lacks, and numbers go on behind the newest one: a number whose result
//! is not here was never shown. A loss of power takes the memory away; then numbers go on behind
//! those that are reserved on the card ([`super::seqs`]).
//!
//! The first slot says which run of the daemon the content belongs to. It counts only where the
//! counter on the card names the same run: the state folder may be an older copy.

use super::entry::Entry;
use rustix::fs::Mode;
use rustix::shm::{self, OFlags};
use std::fs::File;
use std::io;
use std::os::unix::fs::{FileExt as _, MetadataExt as _};

/// Results that are kept: as many as may wait for the card, six seconds of the fastest line.
pub(super) const SLOTS: u32 = 512;
/// Bytes of a slot; a result with as many gauges as the registers hold takes half. Only what was
/// written takes memory.
const SLOT: usize = 64 << 10;
/// Bytes of a number: hexadecimal digits.
const DIGITS: usize = 8;

/// Where the first slot has what was acknowledged, behind the runs and a SEQ.
const BUFFERED: u64 = 3 * DIGITS as u64;

/// The spool of one device. One process at a time has it.
#[derive(Debug)]
pub struct Spool {
    /// Locked until it is closed, also by a kill.
    file: File,
    name: String,
}

/// Whether a SEQ comes after another one. They start anew after 2³² − 1.
pub fn is_after(seq: u32, other: u32) -> bool {
    seq.wrapping_sub(other) as i32 > 0
}

impl Spool {
    /// Opens the spool of the device with this serial, or begins it. `owner` is the user that the
    /// state folder belongs to.
    ///
    /// # Errors
    /// Whatever the system answers; `PermissionDenied` where it belongs to another user,
    /// `WouldBlock` where another process has it.
    pub fn open(serial: &str, owner: u32) -> io::Result<Self> {
        let plain = |c: &char| c.is_ascii_alphanumeric() || *c == '-';
        let plain: String = serial.chars().filter(plain).collect();
        let name = format!("/fringed-{plain}");
        let flags = OFlags::CREATE | OFlags::RDWR;
        let file = File::from(shm::open(&name, flags, Mode::RUSR | Mode::WUSR)?);
        if file.metadata()?.uid() != owner {
            return Err(io::ErrorKind::PermissionDenied.into());
        }
        file.try_lock()?;
        Ok(Self { file, name })
    }

    /// The last SEQ that the run which the card names has shown, and the results that are here,
    /// oldest first. `None` where the content belongs to another run, or nothing is here.
    pub fn of_run(&self, run: u32) -> Option<(u32, Vec<Entry>)> {
        self.begun(run).map(|last| self.since(last))
    }

    /// The last SEQ that the last run has shown, whichever run that was, and the results that are
    /// here: for when the card names no run.
    pub fn of_any_run(&self) -> Option<(u32, Vec<Entry>)> {
        self.numbers(0).map(|[_, _, last]| self.since(last))
    }

    fn since(&self, last: u32) -> (u32, Vec<Entry>) {
        let mut results: Vec<Entry> = (0..SLOTS).filter_map(|slot| self.read(slot)).collect();
        results.sort_by_key(|entry| entry.seq.wrapping_sub(last) as i32);
        let newest = results.last().map(|entry| entry.seq);
        let shown = newest.filter(|&seq| is_after(seq, last));
        (shown.unwrap_or(last), results)
    }

    /// The SEQ behind which a run began, if the content belongs to it.
    fn begun(&self, run: u32) -> Option<u32> {
        let [before, current, last] = self.numbers(0)?;
        // Run 0 means that the number on the card was written by a person.
        (run != 0 && [before, current].contains(&run)).then_some(last)
    }

    /// Says that the content belongs to both of these runs, and that `last` is the last SEQ in use.
    /// Whatever belongs to neither is removed.
    ///
    /// # Errors
    /// Whatever the system answers.
    pub fn begin(&self, runs: [u32; 2], last: u32) -> io::Result<()> {
        if runs.iter().all(|&run| self.begun(run).is_none()) {
            self.file.set_len(0)?;
        }
        let [before, current] = runs;
        let text = format!("{before:08x}{current:08x}{last:08x}");
        self.file.write_all_at(text.as_bytes(), 0)
    }

    /// Says what was acknowledged last in BUFFERED mode.
    ///
    /// # Errors
    /// Whatever the system answers.
    pub fn buffer(&self, buffered: Option<u32>) -> io::Result<()> {
        let (mode, seq) = (u32::from(buffered.is_some()), buffered.unwrap_or(0));
        let text = format!("{mode:08x}{seq:08x}");
        self.file.write_all_at(text.as_bytes(), BUFFERED)
    }

    /// The last value of [`Self::buffer`]; `None` if it was never called.
    pub fn buffered(&self) -> Option<Option<u32>> {
        let [mode, seq] = self.numbers(BUFFERED)?;
        Some((mode != 0).then_some(seq))
    }

    /// Puts a result in, in place of the one that came [`SLOTS`] before.
    ///
    /// # Errors
    /// Whatever the system answers; `InvalidData` for one that is too long. Then it is not in.
    pub fn put(&self, entry: &Entry) -> io::Result<()> {
        let text = serde_json::to_vec(entry)?;
        if DIGITS + text.len() > SLOT {
            return Err(io::ErrorKind::InvalidData.into());
        }
        let at = place(entry.seq % SLOTS);
        // Killed between these, the slot has no length and counts as empty.
        self.file.write_all_at(&[0; DIGITS], at)?;
        self.file.write_all_at(&text, at + DIGITS as u64)?;
        let length = format!("{:08x}", text.len());
        self.file.write_all_at(length.as_bytes(), at)
    }

    fn read(&self, slot: u32) -> Option<Entry> {
        let at = place(slot);
        let [length] = self.numbers(at)?;
        let mut text = vec![0; (length as usize).min(SLOT)];
        let read = self.file.read_exact_at(&mut text, at + DIGITS as u64);
        read.ok()?;
        serde_json::from_slice(&text).ok()
    }

    /// The numbers at a place, if there are such.
    fn numbers<const COUNT: usize>(&self, at: u64) -> Option<[u32; COUNT]> {
        let mut text = [[0; DIGITS]; COUNT];
        self.file.read_exact_at(text.as_flattened_mut(), at).ok()?;
        let mut numbers = [0; COUNT];
        for (number, digits) in numbers.iter_mut().zip(text) {
            *number = u32::from_str_radix(std::str::from_utf8(&digits).ok()?, 16).ok()?;
        }
        Some(numbers)
    }

    /// Removes the spool: the database has all of it, or it can no longer be relied on.
    pub fn remove(&self) {
        // What is left of it belongs to no later run.
        let _ = shm::unlink(&self.name);
    }
}

/// Where a slot begins, behind that of the runs.
fn place(slot: u32) -> u64 {
    (u64::from(slot) + 1) * SLOT as u64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::history::GaugeEntry;
    use crate::station::{MAX_GAUGES, Square, Verdict};

    fn entry(seq: u32) -> Entry {
        Entry {
            seq,
            verdict: Verdict::Fail,
            height_noise_mm: Some(1.0 / 3.0),
            reason: Some("a, \"b\"".into()),
            ..Entry::default()
        }
    }

    /// A result with every slot in use, by the longest names and numbers.
    fn full() -> Entry {
        let number = Some(-f64::MIN_POSITIVE / 3.0);
        let gauge = |slot| GaugeEntry {
            slot,
            name: "\"".repeat(64),
            unit: "mm³".into(),
            value: number,
            reason: None,
            sigma: number,
            uncertainty: number,
            expected: number,
            square: Some(Square::default()),
            low: number,
            high: number,
            decision: 63,
        };
        Entry {
            gauges: (1..=MAX_GAUGES as u16).map(gauge).collect(),
            ..entry(9)
        }
    }

    fn owner() -> u32 {
        let folder = tempfile::tempdir().unwrap();
        std::fs::metadata(folder.path()).unwrap().uid()
    }

    fn open(name: &str) -> Spool {
        Spool::open(&format!("TEST{}{name}", std::process::id()), owner()).unwrap()
    }

    #[test]
    fn what_a_run_put_in_is_left_in_the_order_of_seq_whole_or_not_at_all() {
        let spool = open("ORDER");
        assert_eq!(spool.of_run(7), None);
        spool.begin([7, 7], u32::MAX - 2).unwrap();
        assert_eq!(spool.of_run(7), Some((u32::MAX - 2, Vec::new())));
        let around = [u32::MAX - 1, u32::MAX, 0, 1];
        for seq in around {
            spool.put(&entry(seq)).unwrap();
        }
        assert_eq!(spool.of_run(7), Some((1, around.map(entry).to_vec())));
        // Killed in the middle of the newest: it was not shown.
        spool.file.write_all_at(&[0; DIGITS], place(1)).unwrap();
        let left = [u32::MAX - 1, u32::MAX, 0].map(entry).to_vec();
        assert_eq!(spool.of_run(7), Some((0, left)));
        spool.remove();
    }

    #[test]
    fn a_result_with_every_slot_in_use_goes_in_and_takes_half_of_the_room() {
        let spool = open("FULL");
        spool.begin([7, 7], 8).unwrap();
        spool.put(&full()).unwrap();
        assert_eq!(spool.of_run(7), Some((9, vec![full()])));
        let bytes = serde_json::to_vec(&full()).unwrap().len();
        assert!(bytes < SLOT / 2, "{bytes}");
        spool.remove();
    }

    #[test]
    fn a_spool_outlives_who_wrote_it_and_belongs_to_one_process_of_one_user() {
        let name = "OUTLIVE";
        let spool = open(name);
        spool.begin([3, 3], 17).unwrap();
        let serial = format!("TEST{}{name}", std::process::id());
        let taken = Spool::open(&serial, owner()).unwrap_err();
        assert_eq!(taken.kind(), io::ErrorKind::WouldBlock);
        drop(spool);
        let foreign = Spool::open(&serial, owner() + 1).unwrap_err();
        assert_eq!(foreign.kind(), io::ErrorKind::PermissionDenied);
        assert_eq!(open(name).of_run(3), Some((17, Vec::new())));
        open(name).file.set_len(12).unwrap();
        assert_eq!(open(name).of_run(3), None);
        open(name).remove();
    }

    #[test]
    fn a_spool_of_another_run_is_not_believed_and_a_kill_while_a_run_begins_loses_nothing() {
        let spool = open("RUNS");
        spool.begin([5, 5], 10).unwrap();
        spool.put(&entry(11)).unwrap();
        let left = Some((11, vec![entry(11)]));
        assert_eq!((spool.of_run(5), spool.of_run(6)), (left.clone(), None));
        // The next run has begun, and the card names this one still, or already the next one.
        spool.begin([5, 6], 11).unwrap();
        assert_eq!(
            (spool.of_run(5), spool.of_run(6)),
            (left.clone(), left.clone())
        );
        spool.begin([6, 6], 11).unwrap();
        assert_eq!((spool.of_run(5), spool.of_run(6)), (None, left));
        // Another folder, and a number that a person wrote.
        spool.begin([8, 9], 40).unwrap();
        assert_eq!(spool.of_run(9), Some((40, Vec::new())));
        spool.begin([0, 10], 40).unwrap();
        assert_eq!(spool.of_run(0), None);
        assert_eq!(spool.of_any_run(), Some((40, Vec::new())));
        spool.remove();
    }

    #[test]
    fn the_newest_results_stay_and_one_that_is_too_long_does_not_go_in() {
        let spool = open("BOUND");
        spool.begin([7, 7], 0).unwrap();
        for seq in 1..=SLOTS + 3 {
            spool.put(&entry(seq)).unwrap();
        }
        let (last, left) = spool.of_run(7).unwrap();
        assert_eq!((last, left.len()), (SLOTS + 3, SLOTS as usize));
        assert_eq!((left[0].seq, left[left.len() - 1].seq), (4, SLOTS + 3));
        let long = Entry {
            reason: Some("?".repeat(SLOT)),
            ..entry(5)
        };
        assert!(spool.put(&long).is_err());
        assert_eq!(spool.of_run(7).unwrap().1.len(), SLOTS as usize);
        spool.remove();
    }
}
