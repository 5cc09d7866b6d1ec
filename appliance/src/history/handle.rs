//! How station and measuring task hand over to the history; nothing here waits for the card.

use super::entry::Entry;
use super::keeper::Keeper;
use super::message::Message;
use super::recordings::JudgedPart;
use super::seqs::Seqs;
use super::spool::Spool;
use crate::station::{ResultRecord, Unstored, Verdict};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::mpsc::{SyncSender, TrySendError, sync_channel};
use std::time::Duration;

/// Longest wait of a sign-in for its time to be stored.
const DATING: Duration = Duration::from_secs(2);

/// The way to the history's threads. Cheap to clone.
#[derive(Clone)]
pub struct History {
    pub(super) queue: SyncSender<Message>,
    /// Results that are not in the history because too many waited.
    pub(super) lost: Arc<AtomicU32>,
    pub(super) spool: Option<Arc<Spool>>,
    pub(super) seqs: Seqs,
    pub(super) keeper: Keeper,
    /// Parts that passed since the start.
    pub(super) good: Arc<AtomicU32>,
    pub(super) good_every: u32,
}

impl History {
    /// Takes a SEQ into use.
    ///
    /// # Errors
    /// No number is reserved after it. The card is asked for more, and the station hears when it
    /// has answered.
    pub fn take(&self, seq: u32) -> Result<(), Unstored> {
        self.seqs.take(seq)
    }

    /// Hands over a result before it is shown.
    pub fn record(&self, record: &ResultRecord) {
        let entry = Entry::of(record);
        if let Some(spool) = &self.spool
            && spool.put(&entry).is_err()
        {
            // Without the newest result the spool would have the next start give out its number
            // again.
            spool.remove();
        }
        let message = Message::Result(Box::new(entry));
        if self.queue.try_send(message).is_err() {
            self.lost.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// Remembers what was acknowledged last in BUFFERED mode, `None` outside of it: at once in the
    /// spool, soon on the card.
    pub fn buffer(&self, buffered: Option<u32>) {
        if let Some(spool) = &self.spool {
            // Where it cannot be written, the card has it soon.
            let _ = spool.buffer(buffered);
        }
        self.seqs.buffer(buffered);
    }

    /// Hands over the frames of a part, made by `part`, if it did not pass, or is one of many that
    /// did; after its result. Where the frames of another part are still being written, these are
    /// not kept, and the history says so of one that did not pass: the line goes on.
    pub fn keep(&self, record: &ResultRecord, part: impl FnOnce() -> JudgedPart) {
        let failed = match record.verdict {
            Verdict::Fail | Verdict::Invalid => true,
            Verdict::Pass if self.is_sample() => false,
            _ => return,
        };
        if let Err(why) = self.keeper.keep(part)
            && failed
        {
            let (seq, kept) = (record.seq, Err(why));
            // A queue that is full has lost results as well, and says so.
            let _ = self.queue.try_send(Message::Frames { seq, kept });
        }
    }

    /// Whether a part that passed is one whose frames are kept.
    fn is_sample(&self) -> bool {
        let before = self.good.fetch_add(1, Ordering::Relaxed);
        self.good_every > 0 && before.is_multiple_of(self.good_every)
    }

    /// Stores when this start of the daemon, BOOT_ID, was by the clock of a signed-in user's
    /// browser; waits until the time is stored and answers whether it is.
    pub fn date(&self, boot_id: u32, utc_us: u64) -> bool {
        let (stored, done) = sync_channel(1);
        let dated = Message::Dated {
            boot_id: format!("{boot_id:08x}"),
            utc_us,
            stored,
        };
        self.queue.try_send(dated).is_ok() && done.recv_timeout(DATING).is_ok()
    }

    /// Results that the history has lost since the start because the card did not keep up.
    pub fn lost(&self) -> u32 {
        self.lost.load(Ordering::Relaxed)
    }

    /// Ends the threads once they have stored what they can; `last_seq` is the last SEQ of all.
    /// Answers whether the threads will end: they do not while a card that hangs has filled the
    /// queue.
    pub fn stop(&self, last_seq: u32) -> bool {
        // A thread that is gone has stopped.
        let stop = self.queue.try_send(Message::Stop { last_seq });
        !matches!(stop, Err(TrySendError::Full(_)))
    }
}
