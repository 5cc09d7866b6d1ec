//! The places for connections: bounded, and whoever has been waiting for longest gives way to a newcomer.
//!
//! A connection waits until its next request has come; while it is being answered or follows the events nobody takes its
//! place. So a crowd of silent connections only pushes out itself.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use tokio::sync::Notify;

/// All places.
#[derive(Clone, Debug)]
pub struct Slots(Arc<Inside>);

#[derive(Debug)]
struct Inside {
    most: usize,
    open: Mutex<Vec<Open>>,
}

#[derive(Debug)]
struct Open {
    id: u64,
    /// Since when it has been waiting for a request; none while it is being answered.
    waiting: Option<Instant>,
    leave: Arc<Notify>,
}

/// One place, held until it is dropped.
#[derive(Debug)]
pub struct Slot {
    id: u64,
    slots: Slots,
    leave: Arc<Notify>,
}

impl Slots {
    /// So many places.
    pub fn new(most: usize) -> Self {
        let open = Mutex::default();
        Self(Arc::new(Inside { most, open }))
    }

    /// A place for connection `id`; none if every other is being answered.
    pub fn enter(&self, id: u64, now: Instant) -> Option<Slot> {
        let mut open = self.open();
        if open.len() >= self.0.most {
            let waiting = (0..open.len()).filter(|&at| open[at].waiting.is_some());
            let longest = waiting.min_by_key(|&at| open[at].waiting)?;
            open.swap_remove(longest).leave.notify_one();
        }
        let leave = Arc::new(Notify::new());
        open.push(Open {
            id,
            waiting: Some(now),
            leave: leave.clone(),
        });
        let slots = self.clone();
        Some(Slot { id, slots, leave })
    }

    fn open(&self) -> MutexGuard<'_, Vec<Open>> {
        self.0.open.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Slot {
    /// Its request has come, or it waits for the next one since `waiting`.
    pub fn mark(&self, waiting: Option<Instant>) {
        let mut open = self.slots.open();
        if let Some(own) = open.iter_mut().find(|open| open.id == self.id) {
            own.waiting = waiting;
        }
    }

    /// Ends when somebody else gets this place.
    pub async fn left(&self) {
        self.leave.notified().await;
    }
}

impl Drop for Slot {
    fn drop(&mut self) {
        self.slots.open().retain(|open| open.id != self.id);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[tokio::test]
    async fn a_newcomer_takes_the_place_of_who_waited_longest_and_of_nobody_who_is_answered() {
        let slots = Slots::new(2);
        let now = Instant::now();
        let first = slots.enter(1, now).unwrap();
        let second = slots.enter(2, now + Duration::from_secs(1)).unwrap();
        first.mark(None);
        let third = slots.enter(3, now + Duration::from_secs(2)).unwrap();
        second.left().await;
        third.mark(None);
        assert!(slots.enter(4, now).is_none());
        drop(second);
        assert!(slots.enter(5, now).is_none());
        drop(first);
        assert!(slots.enter(6, now).is_some());
    }
}
