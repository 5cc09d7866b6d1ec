//! Brings what was written onto the card: the one thread that waits for it.
//!
//! The history's thread only hands bytes to the system, which keeps them whatever happens to this process; so each result
//! is safe from kill -9 at once, and safe from a loss of power as soon as this thread has synced it.

use super::schema;
use super::seqs::Seqs;
use super::task::Message;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};

/// The log is brought into the database after this many syncs; a result is a few pages of 4 KiB.
const SYNCS_PER_CHECKPOINT: u32 = 64;

/// The way to the thread; nothing here waits. It ends when this is dropped.
pub(super) struct Syncer {
    wake: SyncSender<()>,
    last_seq: Arc<AtomicU32>,
}

/// The thread's own side.
pub(super) struct Syncing {
    woken: Receiver<()>,
    last_seq: Arc<AtomicU32>,
    seqs: Seqs,
    path: PathBuf,
    told: SyncSender<Message>,
}

/// For the database at `path`. Problems are `told` to the history's thread.
pub(super) fn open(path: &Path, seqs: Seqs, told: SyncSender<Message>) -> (Syncer, Syncing) {
    // One more wake while it syncs is enough: the next sync covers everything written before it.
    let (wake, woken) = sync_channel(1);
    let last_seq = Arc::new(AtomicU32::new(0));
    let syncer = Syncer {
        wake,
        last_seq: last_seq.clone(),
    };
    let syncing = Syncing {
        woken,
        last_seq,
        seqs,
        path: path.to_path_buf(),
        told,
    };
    (syncer, syncing)
}

impl Syncer {
    /// Something was written; `last_seq` is the last SEQ in use.
    pub(super) fn wake(&self, last_seq: u32) {
        self.last_seq.store(last_seq, Ordering::Release);
        // It is woken already.
        let _ = self.wake.try_send(());
    }
}

impl Syncing {
    /// Works until nobody can wake it any more.
    pub(super) fn run(self) {
        let mut problem = None;
        let mut syncs: u32 = 0;
        while self.woken.recv().is_ok() {
            let now = self.sync(syncs.is_multiple_of(SYNCS_PER_CHECKPOINT)).err();
            syncs = syncs.wrapping_add(1);
            if now != problem {
                problem = now.clone();
                // Where the queue is full there is a problem already.
                let _ = self.told.try_send(Message::Synced { problem: now });
            }
        }
    }

    fn sync(&self, checkpoint: bool) -> Result<(), String> {
        let seq = self.last_seq.load(Ordering::Acquire);
        let failed =
            |what: &str, error: &dyn std::fmt::Display| format!("{what}: {error}: free space");
        self.seqs
            .refill(seq)
            .map_err(|error| failed("reserve result numbers", &error))?;
        let log = schema::log_of(&self.path);
        let synced = match File::open(&log) {
            // On a file system without one each commit is synced by itself.
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(()),
            opened => opened.and_then(|file| file.sync_data()),
        };
        synced.map_err(|error| failed(&format!("sync {}", log.display()), &error))?;
        if checkpoint {
            schema::checkpoint(&self.path).map_err(|error| failed("sync the history", &error))?;
        }
        Ok(())
    }
}
