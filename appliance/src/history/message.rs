//! What reaches the history's thread, from the station, from a sign-in and from the threads beside it.

use super::entry::Entry;
use super::unkept::Unkept;
use std::sync::mpsc::SyncSender;

/// One of them.
pub(super) enum Message {
    Result(Box<Entry>),
    /// The frames of a result are kept under a name.
    Kept {
        seq: u32,
        name: String,
    },
    /// They are not.
    NotKept {
        seq: u32,
        why: Unkept,
        /// In words, where it is one.
        problem: Option<String>,
    },
    /// A recording is gone.
    Removed {
        name: String,
        why: Unkept,
    },
    /// A start of the daemon was then, by a browser's clock.
    Dated {
        boot_id: String,
        utc_us: u64,
        /// Hears when it is stored.
        stored: SyncSender<()>,
    },
    Synced {
        problem: Option<String>,
    },
    Stop {
        last_seq: u32,
    },
    KeeperEnded,
}
