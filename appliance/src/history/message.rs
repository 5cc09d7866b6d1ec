//! What reaches the history's thread.

use super::entry::Entry;
use super::spool::SLOTS;
use super::unkept::Unkept;
use std::sync::mpsc::SyncSender;

/// Results that may wait for the card before some are lost to the history.
pub(super) const MAX_WAITING: usize = SLOTS as usize;

/// What reaches the thread: from the station, from a sign-in, from the thread that writes
/// recordings.
pub(super) enum Message {
    Result(Box<Entry>),
    /// The name under which the frames of a result are kept, or why they are not.
    Frames {
        seq: u32,
        kept: Result<String, Unkept>,
    },
    /// A recording was removed.
    Removed {
        name: String,
        why: Unkept,
    },
    /// When a start of the daemon was, by a browser's clock.
    Dated {
        boot_id: String,
        utc_us: u64,
        /// Gets a message when it is stored.
        stored: SyncSender<()>,
    },
    Stop {
        last_seq: u32,
    },
    /// The thread that writes recordings has ended.
    RecordingsEnded,
}
