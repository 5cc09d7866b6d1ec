//! Triggers of several clients: whose turn it is, how many were accepted and missed, and why the last
//! request was rejected.
//!
//! Each of the clients that trigger without a pause is granted in turn, else the fastest would starve
//! the others. A client that was rejected several times within a second, because the station was busy,
//! waits for its turn. Until it has had it, the client that was granted last is rejected, if both are
//! of one kind: a PLC never waits for the page, and a start line, which cannot ask again, waits for no
//! other client.

use super::clock::Micros;
use core::net::IpAddr;
use std::sync::Arc;

/// Who triggers.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Client {
    /// The start line, or somebody of whom nothing is known.
    #[default]
    Line,
    /// A session of the page.
    Page(u64),
    /// A connection of Modbus, by its number, and its address.
    Plc(u64, IpAddr),
}

impl Client {
    /// Where a PLC's connection comes from.
    pub fn address(self) -> Option<IpAddr> {
        match self {
            Self::Plc(_, address) => Some(address),
            Self::Line | Self::Page(_) => None,
        }
    }

    fn competes(self, other: Self) -> bool {
        match (self, other) {
            (Self::Page(one), Self::Page(two)) | (Self::Plc(one, _), Self::Plc(two, _)) => {
                one != two
            }
            _ => false,
        }
    }
}

/// A trigger: who asks for what.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Trigger {
    /// Who asks.
    pub client: Client,
    /// TRIGGER_TOKEN, 0 for an edge.
    pub token: u16,
    /// The token of a request by the API.
    pub request: Option<Arc<str>>,
    /// The recipe that must be active; any if it is not said.
    pub recipe: Option<u16>,
    /// PART_ID; that of the registers if it is not said.
    pub part_id: Option<u32>,
    /// PRESS_STROKE; that of the registers if it is not said.
    pub press_stroke: Option<u32>,
}

/// Rejected triggers after which a client waits for its turn: one that asks less often does not
/// compete.
const INSISTENT: u32 = 3;
/// A client that has not asked again for so long does not wait any more.
const PAUSE: Micros = Micros::from_millis(1000);

/// Who was granted last, and who waits.
#[derive(Debug, Clone, Default)]
pub(super) struct Turns {
    last: Client,
    waiting: Option<WaitingClient>,
}

#[derive(Debug, Clone, Copy)]
struct WaitingClient {
    client: Client,
    rejected: u32,
    /// When it asked last.
    at: Micros,
}

impl Turns {
    /// Whether a trigger of this client may be granted now.
    pub(super) fn may(&self, client: Client, now: Micros) -> bool {
        !self.waiting.is_some_and(|other| {
            client == self.last
                && client.competes(other.client)
                && other.rejected >= INSISTENT
                && now.since(other.at) <= PAUSE
        })
    }

    /// A trigger was granted.
    pub(super) fn granted(&mut self, client: Client) {
        self.last = client;
        self.waiting.take_if(|waiting| waiting.client == client);
    }

    /// A trigger was rejected because the station was busy.
    pub(super) fn rejected(&mut self, client: Client, now: Micros) {
        if !client.competes(self.last) {
            return;
        }
        let before = self
            .waiting
            .filter(|waiting| now.since(waiting.at) <= PAUSE);
        if before.is_some_and(|waiting| waiting.client != client) {
            return;
        }
        self.waiting = Some(WaitingClient {
            client,
            rejected: before.map_or(0, |waiting| waiting.rejected) + 1,
            at: now,
        });
    }
}

/// The counters and latches of requests.
#[derive(Debug, Clone, Default)]
pub(super) struct Requests {
    /// Accepted triggers.
    pub(super) triggers: u32,
    /// Rejected triggers.
    pub(super) missed: u32,
    /// Whether a trigger was rejected since the last ERROR_RESET.
    pub(super) missed_latch: bool,
    /// The last accepted token.
    pub(super) last_token: u16,
    /// Why the last rejected request was rejected ([`super::reject`]); 0 before the first.
    pub(super) reject_reason: u16,
}

impl Requests {
    /// The token of a write if it is a trigger: neither 0 nor the last accepted one, whatever
    /// connection that came from. So a write that is sent again does not measure again, until
    /// another token is accepted or the daemon is started again.
    pub(super) fn new_token(&self, written: Option<u16>) -> Option<u16> {
        written.filter(|&token| token != 0 && token != self.last_token)
    }

    /// Counts an accepted trigger; `token` is 0 for an edge.
    pub(super) fn accept(&mut self, token: u16) {
        self.triggers = self.triggers.wrapping_add(1);
        if token != 0 {
            self.last_token = token;
        }
    }

    /// Counts a rejected trigger.
    pub(super) fn miss(&mut self, reason: u16) {
        self.reject(reason);
        self.missed = self.missed.wrapping_add(1);
        self.missed_latch = true;
    }

    /// Notes why a request of any kind was rejected.
    pub(super) fn reject(&mut self, reason: u16) {
        self.reject_reason = reason;
    }

    /// ERROR_RESET clears the latch; counters and token stay.
    pub(super) fn reset(&mut self) {
        self.missed_latch = false;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HERE: IpAddr = IpAddr::V4(core::net::Ipv4Addr::LOCALHOST);
    const FAST: Client = Client::Plc(1, HERE);
    const SLOW: Client = Client::Plc(2, HERE);

    fn at(ms: u64) -> Micros {
        Micros::from_millis(ms)
    }

    #[test]
    fn a_client_that_was_rejected_again_and_again_has_the_next_turn_and_then_the_other_one() {
        let mut turns = Turns::default();
        turns.granted(FAST);
        for ms in 1..=3 {
            assert!(turns.may(FAST, at(ms)));
            turns.rejected(SLOW, at(ms));
        }
        assert!(!turns.may(FAST, at(4)) && turns.may(SLOW, at(4)));
        turns.granted(SLOW);
        assert!(turns.may(FAST, at(5)));
    }

    #[test]
    fn a_client_that_gave_up_and_one_that_asked_once_hold_nobody_up() {
        let mut turns = Turns::default();
        turns.granted(FAST);
        turns.rejected(SLOW, at(1));
        assert!(turns.may(FAST, at(2)));
        turns.rejected(SLOW, at(2));
        turns.rejected(SLOW, at(3));
        assert!(!turns.may(FAST, at(1003)) && turns.may(FAST, at(1004)));
    }

    #[test]
    fn neither_the_page_nor_a_line_takes_a_turn_from_a_plc() {
        for other in [Client::Page(2), Client::Line] {
            let mut turns = Turns::default();
            turns.granted(FAST);
            for ms in 1..9 {
                turns.rejected(other, at(ms));
            }
            assert!(turns.may(FAST, at(9)) && turns.may(Client::Line, at(9)));
        }
    }

    #[test]
    fn a_token_is_new_until_it_is_accepted_and_an_edge_leaves_it() {
        let mut requests = Requests::default();
        requests.miss(1);
        assert_eq!(requests.new_token(Some(7)), Some(7));
        requests.accept(7);
        requests.accept(0);
        assert_eq!((requests.new_token(Some(7)), requests.triggers), (None, 2));
        assert_eq!(requests.new_token(Some(0)), None);
    }
}
