//! Limits between clients: slots for connections and for pages that follow the events, shared fairly
//! between addresses; and of a session's tries of an edit, only the newest is answered.
//!
//! A slot is either waiting for a request or being answered. One address holds at most its share of
//! the slots. When all are in use, the one waiting for longest is closed for the new one, so a crowd of
//! silent connections displaces only itself. If none is waiting, the address with most slots loses one
//! to an address with fewer, so no address can keep another out.

use std::collections::HashMap;
use std::collections::hash_map::DefaultHasher;
use std::hash::{Hash as _, Hasher as _};
use std::net::IpAddr;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;
use tokio::sync::{Notify, watch};

/// All slots.
#[derive(Clone, Debug)]
pub struct Slots(Arc<SlotLimits>);

#[derive(Debug)]
struct SlotLimits {
    most: usize,
    each: usize,
    table: Mutex<SlotTable>,
}

#[derive(Debug, Default)]
struct SlotTable {
    /// The number of the next slot.
    next: u64,
    /// The slots in use, oldest first.
    taken: Vec<Taken>,
}

#[derive(Debug)]
struct Taken {
    number: u64,
    /// The address that holds it; none for a proxy, which stands for many clients.
    holder: Option<IpAddr>,
    /// Since when it has been waiting for a request; none while it is being answered.
    waiting: Option<Instant>,
    leave: Arc<Notify>,
}

/// One slot, held until it is dropped.
#[derive(Debug)]
pub struct Slot {
    number: u64,
    slots: Slots,
    leave: Arc<Notify>,
}

impl SlotTable {
    fn held_by(&self, holder: Option<IpAddr>) -> usize {
        let held = self.taken.iter().filter(|taken| taken.holder == holder);
        holder.map_or(0, |_| held.count())
    }

    /// The slot that has been waiting for longest, of those that `may` be closed.
    fn waiting_longest(&self, may: impl Fn(&Taken) -> bool) -> Option<u64> {
        let waiting = self.taken.iter().filter(|taken| may(taken));
        let longest = waiting.filter_map(|taken| Some((taken.waiting?, taken.number)));
        longest.min().map(|(_, number)| number)
    }

    /// The newest slot of the address with most slots, if it has more slots than an address with
    /// `held` slots would have with one more.
    fn of_the_largest(&self, held: usize) -> Option<u64> {
        let counted = self.taken.iter().map(|taken| self.held_by(taken.holder));
        let (most, at) = counted.zip(0..).max()?;
        (most > held + 1).then(|| self.taken[at].number)
    }
}

impl Slots {
    /// `most` slots; each address holds at most `each` of them.
    pub fn new(most: usize, each: usize) -> Self {
        let table = Mutex::default();
        Self(Arc::new(SlotLimits { most, each, table }))
    }

    /// A slot for `holder` (none for a proxy), which waits from `now` on. There is none if every
    /// slot that could be closed for it is being answered.
    pub fn enter(&self, holder: Option<IpAddr>, now: Instant) -> Option<Slot> {
        let mut table = self.table();
        let held = table.held_by(holder);
        let leaving = if held >= self.0.each {
            Some(table.waiting_longest(|taken| taken.holder == holder)?)
        } else if table.taken.len() >= self.0.most {
            let longest = table.waiting_longest(|_| true);
            Some(longest.or_else(|| table.of_the_largest(held))?)
        } else {
            None
        };
        let left = |taken: &mut Taken| Some(taken.number) == leaving;
        for taken in table.taken.extract_if(.., left) {
            taken.leave.notify_one();
        }
        let leave = Arc::new(Notify::new());
        let number = table.next;
        table.next += 1;
        table.taken.push(Taken {
            number,
            holder,
            waiting: Some(now),
            leave: leave.clone(),
        });
        let slots = self.clone();
        Some(Slot {
            number,
            slots,
            leave,
        })
    }

    fn table(&self) -> MutexGuard<'_, SlotTable> {
        self.0.table.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Slot {
    /// Its request has come (`None`), or it has been waiting for the next one since `waiting`.
    pub fn mark(&self, waiting: Option<Instant>) {
        let mut table = self.slots.table();
        let mut taken = table.taken.iter_mut();
        if let Some(own) = taken.find(|taken| taken.number == self.number) {
            own.waiting = waiting;
        }
    }

    /// Waits until this slot is given to another connection.
    pub async fn left(&self) {
        self.leave.notified().await;
    }
}

impl Drop for Slot {
    fn drop(&mut self) {
        let mut table = self.slots.table();
        table.taken.retain(|taken| taken.number != self.number);
    }
}

/// The newest try of each session, by the hash of its token.
#[derive(Clone, Default)]
pub(super) struct Tries(Arc<Mutex<HashMap<u64, Watched>>>);

/// A try that is being answered; dropped, it is over.
pub(super) struct Turn(Watched);

/// The view of a try that the thread working on it has: whether it is over.
#[derive(Clone)]
pub(super) struct Watched(Arc<watch::Sender<bool>>);

impl Watched {
    /// Whether the answer is no longer waited for.
    pub(super) fn is_over(&self) -> bool {
        *self.0.borrow()
    }
}

impl Turn {
    /// The view for the thread that works on it.
    pub(super) fn watched(&self) -> Watched {
        self.0.clone()
    }

    /// Waits until it is over.
    pub(super) async fn over(&self) {
        // The sender is not dropped meanwhile.
        let _ = self.0.0.subscribe().wait_for(|over| *over).await;
    }
}

impl Tries {
    /// Begins a try of a session, which has this token; the one before is over.
    pub(super) fn begin(&self, token: &str) -> Turn {
        let mut hash = DefaultHasher::new();
        token.hash(&mut hash);
        let begun = Watched(Arc::new(watch::Sender::new(false)));
        let mut newest = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        newest.retain(|_, watched| !watched.is_over());
        if let Some(before) = newest.insert(hash.finish(), begun.clone()) {
            before.0.send_replace(true);
        }
        Turn(begun)
    }
}

impl Drop for Turn {
    fn drop(&mut self) {
        self.0.0.send_replace(true);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    fn host(number: u8) -> Option<IpAddr> {
        Some(IpAddr::from([10, 0, 0, number]))
    }

    /// A slot that is being answered.
    fn answered(slots: &Slots, holder: Option<IpAddr>) -> Option<Slot> {
        let slot = slots.enter(holder, Instant::now())?;
        slot.mark(None);
        Some(slot)
    }

    #[tokio::test]
    async fn a_newcomer_takes_the_place_that_waited_longest_and_none_that_is_being_answered() {
        let slots = Slots::new(2, 2);
        let now = Instant::now();
        let first = slots.enter(host(1), now).unwrap();
        let second = slots.enter(host(1), now + Duration::from_secs(1)).unwrap();
        first.mark(None);
        let third = slots.enter(host(1), now + Duration::from_secs(2)).unwrap();
        second.left().await;
        third.mark(None);
        assert!(slots.enter(host(1), now).is_none());
        drop(second);
        assert!(slots.enter(host(1), now).is_none());
        drop(first);
        assert!(slots.enter(host(1), now).is_some());
    }

    #[tokio::test]
    async fn an_address_holds_no_more_than_its_share_and_a_proxy_all() {
        let slots = Slots::new(8, 2);
        let other = slots.enter(host(2), Instant::now()).unwrap();
        let own = [(); 2].map(|()| slots.enter(host(1), Instant::now()).unwrap());
        let newest = answered(&slots, host(1)).unwrap();
        own[0].left().await;
        own[1].mark(None);
        assert!(answered(&slots, host(1)).is_none());
        let through: Vec<_> = (0..5).filter_map(|_| answered(&slots, None)).collect();
        assert_eq!(through.len(), 5);
        // All eight are taken; the one that waits leaves.
        assert!(answered(&slots, None).is_some());
        other.left().await;
        drop(newest);
    }

    #[tokio::test]
    async fn no_address_keeps_another_one_out() {
        let slots = Slots::new(8, 4);
        let crowd: Vec<_> = (0..8_u8)
            .map(|at| answered(&slots, host(at % 2)).unwrap())
            .collect();
        // Slots are taken away until both hold as many as the newcomer.
        let mut late = Vec::new();
        for _ in 0..8 {
            late.extend(answered(&slots, host(9)));
        }
        let held = |number| slots.table().held_by(host(number));
        assert_eq!([held(0), held(1), held(9)], [3, 3, 2]);
        // The newest of an address goes first.
        crowd[7].left().await;
        crowd[6].left().await;
    }

    #[test]
    fn of_one_session_the_newest_try_is_open_and_other_sessions_do_not_matter() {
        let tries = Tries::default();
        let is_over = |turn: &Turn| turn.watched().is_over();
        let (first, other) = (tries.begin("a"), tries.begin("b"));
        assert!(!is_over(&first) && !is_over(&other));
        let second = tries.begin("a");
        assert!(is_over(&first) && !is_over(&second) && !is_over(&other));
        // One that was given up does not end the newer one.
        drop(first);
        assert!(!is_over(&second));
        drop((second, other));
        let _last = tries.begin("c");
        assert_eq!(tries.0.lock().unwrap().len(), 1);
    }
}
