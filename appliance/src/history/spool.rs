//! Results that the database may not have yet, in memory that outlives this process but not the system.
//!
//! A card that is busy can hold up the history's thread for seconds, although it only hands bytes to the system. What it has
//! not written by then is here: each result is put into POSIX shared memory as it is shown, which waits for no card, and the
//! next start stores what the database lacks. As with [`super::mark`], a loss of power takes it away.

use super::entry::Entry;
use super::mark;
use std::fs::File;
use std::io;
use std::os::unix::fs::FileExt as _;

/// Results that are kept: as many as may wait for the card.
const SLOTS: u32 = 256;
/// Bytes of a slot; a result with as many gauges as the registers hold takes a quarter. Only what was written takes memory.
const SLOT: usize = 16 << 10;
/// Bytes before the result: the run and the length, 8 hexadecimal digits each.
const HEAD: usize = 16;

/// The spool of one device.
#[derive(Debug)]
pub struct Spool {
    file: File,
    name: String,
}

impl Spool {
    /// Opens the spool of the device with this serial, or begins it. `owner` is the user that the state folder belongs to.
    ///
    /// # Errors
    /// Whatever the system answers; `PermissionDenied` where it is somebody else's.
    pub fn open(serial: &str, owner: u32) -> io::Result<Self> {
        let (file, name) = mark::open_shared(&format!("{serial}-results"), owner)?;
        Ok(Self { file, name })
    }

    /// Puts a result of this run in; the one that came [`SLOTS`] before gives way.
    ///
    /// # Errors
    /// Whatever the system answers; `InvalidData` for one that is too long. Then it is not in.
    pub fn put(&self, run: u32, entry: &Entry) -> io::Result<()> {
        let text = serde_json::to_vec(entry)?;
        if HEAD + text.len() > SLOT {
            return Err(io::ErrorKind::InvalidData.into());
        }
        let at = (entry.seq % SLOTS) as u64 * SLOT as u64;
        // Killed in between, the slot is empty.
        self.file.write_all_at(&[b'0'; HEAD], at)?;
        self.file.write_all_at(&text, at + HEAD as u64)?;
        let head = format!("{run:08x}{:08x}", text.len());
        self.file.write_all_at(head.as_bytes(), at)
    }

    /// The results that a run left, by SEQ, behind `last`; all where there is no last.
    pub fn left(&self, run: u32, last: Option<u32>) -> Vec<Entry> {
        let mut left: Vec<Entry> = (0..SLOTS).filter_map(|slot| self.read(run, slot)).collect();
        // SEQs start anew after 2³² − 1.
        let newest = left.iter().map(|entry| entry.seq).reduce(|newest, seq| {
            match seq.wrapping_sub(newest) as i32 > 0 {
                true => seq,
                false => newest,
            }
        });
        let age = |entry: &Entry| newest.unwrap_or(0).wrapping_sub(entry.seq);
        left.retain(|entry| last.is_none_or(|last| entry.seq.wrapping_sub(last) as i32 > 0));
        left.sort_by_key(|entry| std::cmp::Reverse(age(entry)));
        left
    }

    /// What a run left in a slot, if it did.
    fn read(&self, run: u32, slot: u32) -> Option<Entry> {
        let at = u64::from(slot) * SLOT as u64;
        let mut head = [0; HEAD];
        self.file.read_exact_at(&mut head, at).ok()?;
        let number =
            |digits: &[u8]| u32::from_str_radix(std::str::from_utf8(digits).ok()?, 16).ok();
        let (whose, length) = head.split_at(HEAD / 2);
        let length = number(length)? as usize;
        if number(whose)? != run || length > SLOT - HEAD {
            return None;
        }
        let mut text = vec![0; length];
        self.file.read_exact_at(&mut text, at + HEAD as u64).ok()?;
        serde_json::from_slice(&text).ok()
    }

    /// Takes it away: the database has all of it.
    pub fn remove(&self) {
        mark::remove_shared(&self.name);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::station::Verdict;
    use std::os::unix::fs::MetadataExt as _;

    fn entry(seq: u32) -> Entry {
        Entry {
            seq,
            verdict: Verdict::Fail,
            height_noise_mm: Some(1.0 / 3.0),
            reason: Some("a, \"b\"".into()),
            ..Entry::default()
        }
    }

    fn spool(name: &str) -> Spool {
        let folder = tempfile::tempdir().unwrap();
        let owner = std::fs::metadata(folder.path()).unwrap().uid();
        Spool::open(&format!("TEST{}{name}", std::process::id()), owner).unwrap()
    }

    #[test]
    fn what_a_run_put_in_is_left_in_the_order_of_seq_whole_or_not_at_all() {
        let spool = spool("ORDER");
        assert_eq!(spool.left(7, None), []);
        let around = [u32::MAX - 1, u32::MAX, 0, 1];
        for seq in around {
            spool.put(7, &entry(seq)).unwrap();
        }
        spool.put(8, &entry(2)).unwrap();
        assert_eq!(spool.left(7, None), around.map(entry));
        assert_eq!(spool.left(7, Some(u32::MAX)), [entry(0), entry(1)]);
        assert_eq!(spool.left(9, None), []);
        // Killed behind the result and before its head.
        spool.file.write_all_at(&[b'0'; HEAD], SLOT as u64).unwrap();
        assert_eq!(spool.left(7, Some(u32::MAX)), [entry(0)]);
        spool.remove();
    }

    #[test]
    fn the_newest_results_stay_and_one_that_is_too_long_does_not_go_in() {
        let spool = spool("BOUND");
        for seq in 1..=SLOTS + 3 {
            spool.put(7, &entry(seq)).unwrap();
        }
        let left = spool.left(7, None);
        assert_eq!(left.len(), SLOTS as usize);
        assert_eq!((left[0].seq, left[left.len() - 1].seq), (4, SLOTS + 3));
        let long = Entry {
            reason: Some("?".repeat(SLOT)),
            ..entry(5)
        };
        assert!(spool.put(7, &long).is_err());
        assert_eq!(spool.left(7, None).len(), SLOTS as usize);
        spool.remove();
    }
}
