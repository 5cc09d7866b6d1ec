//! Writes the frames of failed parts as recordings: a thread beside the history's, because a recording takes as long as
//! many results.

use super::recordings::{FailedPart, Recordings};
use super::task::Message;
use super::unkept::Unkept;
use crate::recipe::Store;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};

/// What the keeper is told: one part at a time, a request for room, the end.
enum Order {
    Keep(Box<FailedPart>),
    MakeRoom,
    Stop,
}

/// The way to the keeper; nothing here waits.
#[derive(Clone)]
pub(super) struct Keeper {
    orders: SyncSender<Order>,
    /// A failed part waits or is being written: its frames are memory that the head cannot use.
    busy: Arc<AtomicBool>,
    quota: u64,
}

/// The keeper's own side.
pub(super) struct Keeping {
    orders: Receiver<Order>,
    busy: Arc<AtomicBool>,
    recordings: Recordings,
    told: SyncSender<Message>,
}

/// Opens the folder of recordings; `recipes` are those of the station. What happens to the recordings is `told` to the
/// history's thread.
///
/// # Errors
/// Whatever the file system answers.
pub(super) fn open(
    folder: &Path,
    recipes: Store,
    quota: u64,
    told: SyncSender<Message>,
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
        told,
    };
    Ok((keeper, keeping))
}

impl Keeper {
    /// Hands over a part that did not pass, made by `part`; the error says why its frames are not kept.
    pub(super) fn keep(&self, part: impl FnOnce() -> FailedPart) -> Result<(), Unkept> {
        if self.quota == 0 {
            return Err(Unkept::Off);
        }
        if self.busy.swap(true, Ordering::AcqRel) {
            return Err(Unkept::Busy);
        }
        let sent = self.orders.try_send(Order::Keep(Box::new(part())));
        sent.map_err(|_| {
            self.busy.store(false, Ordering::Release);
            Unkept::Busy
        })
    }

    /// Asks for the oldest recording to be removed: results are worth more than the frames of old parts.
    pub(super) fn make_room(&self) {
        // If it has much to do already it will make room by itself.
        let _ = self.orders.try_send(Order::MakeRoom);
    }

    /// Ends the thread when it has done what it has in hand; it says so.
    pub(super) fn stop(&self) {
        // One that has its hands full is not waited for.
        let _ = self.orders.try_send(Order::Stop);
    }
}

impl Keeping {
    /// The recordings that are there.
    pub(super) fn recordings(&self) -> &Recordings {
        &self.recordings
    }

    /// Works until told to stop.
    pub(super) fn run(mut self) {
        self.bound();
        while let Ok(order) = self.orders.recv() {
            match order {
                Order::Keep(part) => {
                    let seq = part.record.seq;
                    let kept = self.recordings.keep(&part);
                    drop(part);
                    self.busy.store(false, Ordering::Release);
                    self.tell(match kept {
                        Ok(name) => Message::Kept { seq, name },
                        Err(error) => Message::NotKept {
                            seq,
                            why: Unkept::from(&error),
                            problem: Some(error.to_string()),
                        },
                    });
                    self.bound();
                }
                Order::MakeRoom => {
                    if let Some(name) = self.recordings.remove_oldest() {
                        let why = Unkept::Room;
                        self.tell(Message::Removed { name, why });
                    }
                }
                Order::Stop => break,
            }
        }
        self.tell(Message::KeeperEnded);
    }

    /// Removes what is over the quota.
    fn bound(&mut self) {
        while let Some(name) = self.recordings.over_quota() {
            let why = Unkept::Quota;
            self.tell(Message::Removed { name, why });
        }
    }

    fn tell(&self, message: Message) {
        // Links that nobody hears of are put right at the next start.
        let _ = self.told.send(message);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_that_are_not_kept_are_not_even_copied_and_the_reason_is_told() {
        let folder = tempfile::tempdir().unwrap();
        let (told, _) = sync_channel(1);
        let keeper = |quota| {
            let recipes = Store::at(folder.path());
            open(folder.path(), recipes, quota, told.clone()).unwrap().0
        };
        assert_eq!(keeper(0).keep(|| unreachable!()), Err(Unkept::Off));
        let busy = keeper(1);
        busy.busy.store(true, Ordering::Release);
        assert_eq!(busy.keep(|| unreachable!()), Err(Unkept::Busy));
    }
}
