//! The thread `recordings`: writes the frames of failed parts. It is not the history's thread,
//! because a recording takes as long as many results.

use super::message::Message;
use super::recordings::{JudgedPart, Recordings};
use super::unkept::Unkept;
use crate::recipe::Store;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};

/// What the thread is asked to do.
enum KeepingOrder {
    Keep(Box<JudgedPart>),
    MakeRoom,
    Stop,
}

/// The way to the thread; nothing here waits.
#[derive(Clone)]
pub(super) struct Keeper {
    orders: SyncSender<KeepingOrder>,
    /// A failed part waits or is being written: its frames are memory that the head cannot use, so
    /// there is one at a time.
    busy: Arc<AtomicBool>,
    quota: u64,
}

/// The thread's own side.
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
