//! How station and measuring task hand over to the history's threads; nothing here waits for the card.
//!
//! Results go to the thread `history`, the frames of parts to the thread `recordings`, because a
//! recording takes as long as many results.

use super::entry::Entry;
use super::recordings::{JudgedPart, Recordings, Unkept};
use super::seqs::Seqs;
use super::spool::{SLOTS, Spool};
use crate::recipe::Store;
use crate::station::{ResultRecord, Unstored, Verdict};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::time::Duration;

/// Results that may wait for the card before some are lost to the history.
pub(super) const MAX_WAITING: usize = SLOTS as usize;

/// A message to the thread `history`: from the station, from a sign-in, or from the thread
/// `recordings`.
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
    /// Gets a message when everything before is stored.
    Reached(SyncSender<()>),
    Stop {
        last_seq: u32,
    },
    /// The thread that writes recordings has ended.
    RecordingsEnded,
}

/// An order to the thread `recordings`.
enum KeepingOrder {
    Keep(Box<JudgedPart>),
    MakeRoom,
    Stop,
}

/// Access to the thread `recordings`.
#[derive(Clone)]
pub(super) struct Keeper {
    orders: SyncSender<KeepingOrder>,
    /// Whether a part waits or is being written: its frames are memory that the head cannot use, so
    /// there is one at a time.
    busy: Arc<AtomicBool>,
    quota: u64,
}

/// What the thread `recordings` owns.
pub(super) struct Keeping {
    orders: Receiver<KeepingOrder>,
    busy: Arc<AtomicBool>,
    recordings: Recordings,
    history: SyncSender<Message>,
}

/// Opens the folder of recordings; `recipes` are those of the station. What happens to the
/// recordings is sent to the `history`.
///
/// # Errors
/// Whatever the file system answers.
pub(super) fn open(
    folder: &Path,
    recipes: Store,
    quota: u64,
    history: SyncSender<Message>,
) -> std::io::Result<(Keeper, Keeping)> {
    let recordings = Recordings::open(folder, recipes, quota)?;
    let (sender, orders) = sync_channel(3);
    let busy = Arc::new(AtomicBool::new(false));
    let keeper = Keeper {
        orders: sender,
        busy: busy.clone(),
        quota,
    };
    let keeping = Keeping {
        orders,
        busy,
        recordings,
        history,
    };
    Ok((keeper, keeping))
}

impl Keeper {
    /// Hands over a part that did not pass, made by `part`; the error says why its frames are not
    /// kept.
    pub(super) fn keep(&self, part: impl FnOnce() -> JudgedPart) -> Result<(), Unkept> {
        if self.quota == 0 {
            return Err(Unkept::Off);
        }
        if self.busy.swap(true, Ordering::AcqRel) {
            return Err(Unkept::Busy);
        }
        let sent = self.orders.try_send(KeepingOrder::Keep(Box::new(part())));
        sent.map_err(|_| {
            self.busy.store(false, Ordering::Release);
            Unkept::Busy
        })
    }

    /// Asks for the oldest recording to be removed: results are worth more than the frames of old
    /// parts.
    pub(super) fn make_room(&self) {
        // With a full queue of orders it is asked again with the next result.
        let _ = self.orders.try_send(KeepingOrder::MakeRoom);
    }

    /// Ends the thread once the orders before are done; it sends a message then.
    pub(super) fn stop(&self) {
        // With a full queue of orders the daemon ends without waiting for it.
        let _ = self.orders.try_send(KeepingOrder::Stop);
    }
}

impl Keeping {
    /// The recordings that are there.
    pub(super) fn recordings(&self) -> &Recordings {
        &self.recordings
    }

    /// Works until [`Keeper::stop`].
    pub(super) fn run(mut self) {
        self.bound();
        while let Ok(order) = self.orders.recv() {
            match order {
                KeepingOrder::Keep(part) => {
                    let seq = part.record.seq;
                    let kept = self.recordings.keep(&part);
                    drop(part);
                    self.busy.store(false, Ordering::Release);
                    let kept = kept.map_err(|error| Unkept::from(&error));
                    self.send(Message::Frames { seq, kept });
                    self.bound();
                }
                KeepingOrder::MakeRoom => {
                    if let Some(name) = self.recordings.remove_oldest() {
                        let why = Unkept::Room;
                        self.send(Message::Removed { name, why });
                    }
                }
                KeepingOrder::Stop => break,
            }
        }
        self.send(Message::RecordingsEnded);
    }

    /// Removes what is over the quota.
    fn bound(&mut self) {
        while let Some(name) = self.recordings.remove_over_quota() {
            let why = Unkept::Quota;
            self.send(Message::Removed { name, why });
        }
    }

    fn send(&self, message: Message) {
        // Links that are not brought up to date now are at the next start.
        let _ = self.history.send(message);
    }
}

/// Longest wait of a sign-in for its time to be stored.
const DATING: Duration = Duration::from_secs(2);
/// Longest wait of a request for its result to be stored.
const STORING: Duration = Duration::from_secs(10);

/// Access to the history's threads. Cheap to clone.
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

    /// Waits until every result so far is stored, those of the run before as well; answers whether they
    /// are.
    pub fn is_stored(&self) -> bool {
        let (stored, done) = sync_channel(1);
        let sent = self.queue.try_send(Message::Reached(stored));
        sent.is_ok() && done.recv_timeout(STORING).is_ok()
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_that_are_not_kept_are_not_even_copied_and_the_reason_is_told() {
        let folder = tempfile::tempdir().unwrap();
        let (history, _) = sync_channel(1);
        let keeper = |quota| {
            let recipes = Store::at(folder.path());
            open(folder.path(), recipes, quota, history.clone())
                .unwrap()
                .0
        };
        assert_eq!(keeper(0).keep(|| unreachable!()), Err(Unkept::Off));
        let busy = keeper(1);
        busy.busy.store(true, Ordering::Release);
        assert_eq!(busy.keep(|| unreachable!()), Err(Unkept::Busy));
    }
}
