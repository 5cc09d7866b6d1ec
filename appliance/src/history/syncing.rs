//! Brings what was written onto the card: the one thread that waits for it.
//!
//! The history's thread only hands bytes to the system, which keeps them whatever happens to this process; so each result
//! is safe from kill -9 at once, and safe from a loss of power as soon as this thread has synced it.

use super::schema;
use super::task::Message;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::time::Duration;

/// The log is brought into the database when nothing came for this long ...
const IDLE: Duration = Duration::from_secs(1);
/// ... or when it is longer by so many bytes than after the last time.
const STRETCH: u64 = 4 << 20;
/// A log that is longer than this after it was brought into the database is begun anew while no result is stored.
const LONG: u64 = 4 << 20;
/// A log that is longer than this is a warning.
const TOO_LONG: u64 = 32 << 20;

/// The way to the thread; nothing here waits.
#[derive(Clone)]
pub(super) struct Syncer {
    wake: SyncSender<()>,
    stopping: Arc<AtomicBool>,
}

/// The thread's own side.
pub(super) struct Syncing {
    woken: Receiver<()>,
    stopping: Arc<AtomicBool>,
    path: PathBuf,
    told: SyncSender<Message>,
}

/// For the database at `path`. Problems are `told` to the history's thread.
pub(super) fn open(path: &Path, told: SyncSender<Message>) -> (Syncer, Syncing) {
    // One more wake while it syncs is enough: the next sync covers everything written before it.
    let (wake, woken) = sync_channel(1);
    let stopping = Arc::new(AtomicBool::new(false));
    let syncer = Syncer {
        wake,
        stopping: stopping.clone(),
    };
    let syncing = Syncing {
        woken,
        stopping,
        path: path.to_path_buf(),
        told,
    };
    (syncer, syncing)
}

impl Syncer {
    /// Ends the thread.
    pub(super) fn stop(&self) {
        self.stopping.store(true, Ordering::Release);
        let _ = self.wake.try_send(());
    }

    /// Something was written.
    pub(super) fn wake(&self) {
        // It is woken already.
        let _ = self.wake.try_send(());
    }
}

impl Syncing {
    /// Works until told to stop.
    pub(super) fn run(self) {
        let mut problem = None;
        // Whether there is nothing to do until the next result, and from which length of the log on it is brought into the
        // database.
        let (mut idle, mut due) = (true, STRETCH);
        loop {
            let woken = if idle {
                self.woken
                    .recv()
                    .map_err(|_| RecvTimeoutError::Disconnected)
            } else {
                self.woken.recv_timeout(IDLE)
            };
            if self.stopping.load(Ordering::Acquire) {
                return;
            }
            let now = match woken {
                Ok(()) => self.sync().err(),
                Err(RecvTimeoutError::Timeout) => None,
                Err(RecvTimeoutError::Disconnected) => return,
            };
            let paused = woken.is_err();
            let now = if paused || schema::log_bytes(&self.path) >= due {
                let brought = self.checkpoint();
                due = schema::log_bytes(&self.path) + STRETCH;
                brought.err().or(now)
            } else {
                now
            };
            let too_long = self.too_long();
            idle = paused && too_long.is_none();
            let now = now.or(too_long);
            if now != problem {
                problem = now.clone();
                // Where the queue is full there is a problem already.
                let _ = self.told.try_send(Message::Synced { problem: now });
            }
        }
    }

    fn checkpoint(&self) -> Result<(), String> {
        let done = schema::checkpoint(&self.path, LONG);
        done.map_err(|error| format!("sync the history: {error}: free space"))
    }

    /// What is wrong with a log that does not begin anew, in words.
    fn too_long(&self) -> Option<String> {
        (schema::log_bytes(&self.path) > TOO_LONG).then(|| {
            format!(
                "{} has more than {} MiB: another program reads the history without an end, or the storage is too slow: \
                 end that program, or trigger more slowly",
                schema::log_of(&self.path).display(),
                TOO_LONG >> 20
            )
        })
    }

    fn sync(&self) -> Result<(), String> {
        let log = schema::log_of(&self.path);
        let synced = match File::open(&log) {
            // On a file system without one each commit is synced by itself.
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(()),
            opened => opened.and_then(|file| file.sync_data()),
        };
        synced.map_err(|error| format!("sync {}: {error}: free space", log.display()))
    }
}
