//! The log of the history stays short while results come without a pause and others read.

use super::{opened, record, station, wait};
use crate::history::schema::log_bytes;
use crate::history::*;
use crate::station::snapshot::warning;
use crate::storage::state::StateFolder;
use std::io::Write;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// The longest log that is no warning, in bytes.
const BOUND: u64 = 32 << 20;
/// Results that are handed over before it is looked whether they are stored.
const AT_ONCE: u32 = 16;
/// From one result to the next: ten times as fast as the fastest line.
const PERIOD: Duration = Duration::from_millis(1);

/// Ends the history's threads and its readers, also where an assertion fails.
struct End<'a>(&'a History, &'a AtomicBool);

impl Drop for End<'_> {
    fn drop(&mut self) {
        self.1.store(true, Ordering::Relaxed);
        while !self.0.stop(0) {
            std::thread::yield_now();
        }
    }
}

/// A reader of a list who looks at its first lines until the end: `fringed history --csv | less`.
struct Pager<'a> {
    lines: usize,
    over: &'a AtomicBool,
}

impl Write for Pager<'_> {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.lines += 1;
        while self.lines > 20 && !self.over.load(Ordering::Relaxed) {
            std::thread::sleep(Duration::from_millis(5));
        }
        Ok(bytes.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

/// Stores so many results without a pause while a pager reads, and so many clients that ask for a
/// list again and again; the longest that the log was, in bytes.
fn soak(count: u32, clients: usize) -> u64 {
    let folder = tempfile::tempdir().unwrap();
    let state = StateFolder::open(folder.path()).unwrap();
    let (history, task, _, _) = opened(&state, 1);
    let ((station, log), over) = (station(), AtomicBool::default());
    let database = folder.path().join(DATABASE);
    let reader = Reader::of(folder.path());
    let mut longest = 0;
    std::thread::scope(|scope| {
        scope.spawn(|| task.run(&station));
        let _end = End(&history, &over);
        for seq in 1..=count {
            history.record(&record(seq));
            std::thread::sleep(PERIOD);
            if seq % AT_ONCE == 0 {
                wait("result", || {
                    reader.result(seq).is_ok_and(|found| found.is_some())
                });
            }
            if seq == 10 * AT_ONCE {
                scope.spawn(|| {
                    let all = Filter {
                        limit: 10_000,
                        ..Filter::default()
                    };
                    let mut pager = Pager {
                        lines: 0,
                        over: &over,
                    };
                    reader.csv(&all, &mut pager).unwrap();
                });
                for _ in 0..clients {
                    scope.spawn(|| {
                        let page = Filter {
                            limit: 100,
                            ..Filter::default()
                        };
                        while !over.load(Ordering::Relaxed) {
                            reader.results(&page).unwrap();
                            std::thread::sleep(10 * PERIOD);
                        }
                    });
                }
            }
            longest = longest.max(log_bytes(&database));
        }
        assert_eq!(history.lost(), 0);
        assert_eq!(*log.lock().unwrap(), [""; 0]);
    });
    println!(
        "{count} results: the log had {:.1} MiB at most, the database has {:.1} MiB",
        longest as f64 / f64::from(1 << 20),
        std::fs::metadata(&database).unwrap().len() as f64 / f64::from(1 << 20)
    );
    longest
}

#[test]
fn the_log_stays_short_while_results_come_without_a_pause_and_others_read() {
    assert!(soak(4_000, 0) <= BOUND);
}

/// Run by `.ci/run full`.
#[test]
#[ignore = "takes a minute"]
fn the_log_stays_short_for_fifty_thousand_results() {
    assert!(soak(50_000, 2) <= BOUND);
}

#[test]
fn a_log_that_another_program_holds_is_a_warning_and_ends_with_it() {
    let folder = tempfile::tempdir().unwrap();
    let state = StateFolder::open(folder.path()).unwrap();
    let (history, task, _, _) = opened(&state, 1);
    let ((station, log), over) = (station(), AtomicBool::default());
    let database = folder.path().join(DATABASE);
    let reader = Reader::of(folder.path());
    let warned = || station.snapshot().warnings & warning::STORAGE != 0;
    std::thread::scope(|scope| {
        scope.spawn(|| task.run(&station));
        let _end = End(&history, &over);
        history.record(&record(1));
        wait("result", || {
            reader.result(1).is_ok_and(|found| found.is_some())
        });
        let other = rusqlite::Connection::open(&database).unwrap();
        other.execute_batch("BEGIN; SELECT * FROM result").unwrap();
        let mut seq = 1;
        while log_bytes(&database) <= BOUND {
            seq += 1;
            history.record(&record(seq));
            if seq % AT_ONCE == 0 {
                wait("result", || {
                    reader.result(seq).is_ok_and(|found| found.is_some())
                });
            }
        }
        wait("warning", warned);
        let words = log.lock().unwrap()[0].clone();
        assert!(
            words.contains("history.db-wal has more than 32 MiB"),
            "{words}"
        );
        drop(other);
        wait("end of the warning", || !warned());
        assert!(log_bytes(&database) <= BOUND / 2);
    });
}
