//! Clients: the limit on their connections, which one is closed for a new one, and the log of what is
//! refused.
//!
//! One place is kept for a client that may write. When all connections are in use, the one idle for
//! longest is closed for the new one; if none is idle, the new one is refused. Readers never displace
//! writers. Lines of the log about refusals have a rate limit, so that an attack cannot flood it.

use crate::system::progress::Progress;
use std::net::IpAddr;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::task::{Context, Poll};
use std::time::{Duration, Instant};
use tokio::sync::oneshot;

/// A connection is idle if its last request is older than this: a slow PLC has then missed three
/// polls.
const IDLE: Duration = Duration::from_secs(5);
/// A connection that has sent no complete request yet is idle after this, which is far longer than
/// a round trip.
const MUTE: Duration = Duration::from_millis(250);

/// The places of one server. Cheap to clone.
#[derive(Clone, Debug)]
pub struct Clients(Arc<Mutex<PlaceTable>>);

#[derive(Debug)]
struct PlaceTable {
    limit: usize,
    next: u64,
    taken: Vec<Connection>,
}

#[derive(Debug)]
struct Connection {
    number: u64,
    may_write: bool,
    /// Whether it has sent a complete request.
    spoke: bool,
    /// The time of its last request; before that, of the connection.
    since: Instant,
    /// Dropped to close it.
    _open: oneshot::Sender<()>,
}

impl PlaceTable {
    fn admit(&mut self, may_write: bool, now: Instant) -> Option<(u64, oneshot::Receiver<()>)> {
        let readers = self.taken.iter().filter(|other| !other.may_write).count();
        let room = self.taken.len() < self.limit && (may_write || readers + 1 < self.limit);
        if !room {
            let leaving = self.idle_longest(may_write, now)?;
            self.taken.retain(|other| other.number != leaving);
        }
        let (open, closed) = oneshot::channel();
        let number = self.next;
        self.next += 1;
        self.taken.push(Connection {
            number,
            may_write,
            spoke: false,
            since: now,
            _open: open,
        });
        Some((number, closed))
    }

    /// The connection to close for a new one: readers before writers, and among them the one that
    /// has been idle for longest.
    fn idle_longest(&self, may_write: bool, now: Instant) -> Option<u64> {
        let idle = |other: &&Connection| {
            let patience = if other.spoke { IDLE } else { MUTE };
            (may_write || !other.may_write) && now.saturating_duration_since(other.since) > patience
        };
        let leaving = self.taken.iter().filter(idle);
        leaving
            .min_by_key(|other| (other.may_write, other.since))
            .map(|other| other.number)
    }
}

impl Clients {
    /// Room for `limit` connections.
    pub fn new(limit: usize) -> Self {
        Self(Arc::new(Mutex::new(PlaceTable {
            limit,
            next: 0,
            taken: Vec::new(),
        })))
    }

    /// Open connections, and whether one of them may write.
    pub fn open(&self) -> (u16, bool) {
        let table = self.table();
        let count = u16::try_from(table.taken.len()).unwrap_or(u16::MAX);
        (count, table.taken.iter().any(|taken| taken.may_write))
    }

    /// A place for a new connection, or `None` if all are taken and none is idle.
    pub(super) fn admit(&self, may_write: bool) -> Option<ConnectionPlace> {
        let (number, closed) = self.table().admit(may_write, Instant::now())?;
        Some(ConnectionPlace {
            clients: self.clone(),
            number,
            closed,
        })
    }

    fn table(&self) -> MutexGuard<'_, PlaceTable> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The place of one connection, given back when it is dropped.
#[derive(Debug)]
pub struct ConnectionPlace {
    clients: Clients,
    number: u64,
    closed: oneshot::Receiver<()>,
}

impl ConnectionPlace {
    /// A complete request was received.
    pub(super) fn spoke(&self) {
        let mut table = self.clients.table();
        let mut taken = table.taken.iter_mut();
        if let Some(own) = taken.find(|other| other.number == self.number) {
            own.spoke = true;
            own.since = Instant::now();
        }
    }

    /// Ready when a new connection has displaced this one.
    pub(super) fn poll_displaced(&mut self, context: &mut Context<'_>) -> Poll<()> {
        Future::poll(std::pin::Pin::new(&mut self.closed), context).map(|_| ())
    }
}

impl Drop for ConnectionPlace {
    fn drop(&mut self) {
        let mut table = self.clients.table();
        table.taken.retain(|other| other.number != self.number);
    }
}

/// At most one line in this time.
const PAUSE: Duration = Duration::from_secs(10);

/// What was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RefusedPeer {
    /// A connection from outside the subnets that may read.
    Connection,
    /// A connection while all others are in use and none is idle.
    Full,
    /// A write of a client that may not write.
    Write,
}

impl RefusedPeer {
    fn words(self) -> &'static str {
        match self {
            Self::Connection => {
                "a connection was refused: modbus.readers does not list its address"
            }
            Self::Full => "a connection was refused: all connections are in use and none is idle",
            Self::Write => "a write was refused: modbus.writers does not list its address",
        }
    }
}

/// Logs refusals. Cheap to clone; clones share the rate limit.
#[derive(Clone, Debug)]
pub struct Refusals {
    progress: Progress,
    /// By kind, so that a flood of one does not hide another.
    limits: Arc<Mutex<[RateLimit; 3]>>,
}

#[derive(Debug, Default)]
struct RateLimit {
    last: Option<Instant>,
    /// Refusals since the last line.
    silent: u64,
}

impl RateLimit {
    /// Whether a line may be written now: then the number of refusals since the last line.
    fn pass(&mut self, now: Instant) -> Option<u64> {
        if self
            .last
            .is_some_and(|last| now.saturating_duration_since(last) < PAUSE)
        {
            self.silent += 1;
            return None;
        }
        self.last = Some(now);
        Some(std::mem::take(&mut self.silent))
    }
}

impl Refusals {
    /// Logs refusals as warnings.
    pub fn new(progress: Progress) -> Self {
        Self {
            progress,
            limits: Arc::default(),
        }
    }

    /// Logs a refusal, or counts it for the next line.
    pub(super) fn note(&self, refused: RefusedPeer, peer: IpAddr) {
        let mut limits = self.limits.lock().unwrap_or_else(PoisonError::into_inner);
        let Some(silent) = limits[refused as usize].pass(Instant::now()) else {
            return;
        };
        let mut line = format!("Modbus, {peer}: {}", refused.words());
        if silent > 0 {
            line += &format!("; {silent} more since the last such line");
        }
        self.progress.warn(&line);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(limit: usize) -> PlaceTable {
        PlaceTable {
            limit,
            next: 0,
            taken: Vec::new(),
        }
    }

    fn numbers(table: &PlaceTable) -> Vec<u64> {
        table.taken.iter().map(|taken| taken.number).collect()
    }

    #[test]
    fn readers_leave_one_place_to_a_writer() {
        let (mut table, now) = (table(3), Instant::now());
        for reader in 0..2 {
            assert!(table.admit(false, now).is_some(), "reader {reader}");
        }
        assert!(table.admit(false, now).is_none());
        assert!(table.admit(true, now).is_some());
        assert!(table.admit(true, now).is_none(), "nobody is idle");
    }

    #[test]
    fn the_connection_that_is_idle_for_longest_makes_room() {
        let (mut table, start) = (table(3), Instant::now());
        let at = |ms| start + Duration::from_millis(ms);
        for ms in 0..3 {
            table.admit(true, at(ms)).unwrap();
            table.taken[ms as usize].spoke = true;
        }
        table.taken[0].since = at(10);
        assert!(table.admit(true, at(4000)).is_none());
        table.admit(true, at(5002)).unwrap();
        assert_eq!(numbers(&table), [0, 2, 3]);
    }

    #[test]
    fn who_never_spoke_makes_room_soon_and_a_reader_before_a_writer() {
        let (mut table, start) = (table(3), Instant::now());
        let at = |ms| start + Duration::from_millis(ms);
        table.admit(true, at(0)).unwrap();
        table.admit(true, at(1)).unwrap();
        table.admit(false, at(2)).unwrap();
        assert!(table.admit(true, at(200)).is_none());
        table.admit(true, at(300)).unwrap();
        assert_eq!(numbers(&table), [0, 1, 3], "the reader went");
        assert!(
            table.admit(false, at(9000)).is_none(),
            "a reader displaces no writer"
        );
    }

    #[test]
    fn a_flood_of_refusals_is_one_line_in_ten_seconds_that_counts_the_others() {
        let (mut limit, start) = (RateLimit::default(), Instant::now());
        assert_eq!(limit.pass(start), Some(0));
        for ms in 1..=500 {
            assert_eq!(limit.pass(start + Duration::from_millis(ms)), None);
        }
        assert_eq!(limit.pass(start + PAUSE), Some(500));
        assert_eq!(limit.pass(start + 2 * PAUSE), Some(0));
    }
}
