//! Limits wrong guesses of the secret: each address has a few, then waits twice as long after each.

use crate::system::socket::network;
use std::net::IpAddr;
use std::time::{Duration, Instant};

/// Wrong guesses before the first wait.
pub(super) const FREE: u32 = 3;
/// The first wait.
const FIRST: Duration = Duration::from_secs(2);
/// The longest wait.
pub(super) const LONGEST: Duration = Duration::from_secs(300);
/// Guesses are forgotten after this time.
const MEMORY: Duration = Duration::from_secs(3600);
/// The most addresses remembered; another one replaces the one with the shortest wait left.
const MOST: usize = 256;

#[derive(Debug)]
struct Guesser {
    address: IpAddr,
    wrong: u32,
    last: Instant,
    until: Instant,
}

/// The addresses that guessed wrongly.
#[derive(Debug, Default)]
pub(super) struct Patience(Vec<Guesser>);

impl Patience {
    /// How long this address still has to wait; none if it may guess.
    pub(super) fn wait(&self, from: IpAddr, now: Instant) -> Option<Duration> {
        let from = network(from);
        let guesser = self.0.iter().find(|guesser| guesser.address == from)?;
        let left = guesser.until.saturating_duration_since(now);
        (!left.is_zero()).then_some(left)
    }

    /// This address guessed wrongly.
    pub(super) fn wrong(&mut self, from: IpAddr, now: Instant) {
        let from = network(from);
        self.0
            .retain(|guesser| now.saturating_duration_since(guesser.last) < MEMORY);
        if !self.0.iter().any(|guesser| guesser.address == from) {
            if self.0.len() >= MOST {
                self.0.sort_by_key(|guesser| guesser.until);
                self.0.remove(0);
            }
            self.0.push(Guesser {
                address: from,
                wrong: 0,
                last: now,
                until: now,
            });
        }
        for guesser in self.0.iter_mut().filter(|guesser| guesser.address == from) {
            guesser.wrong = guesser.wrong.saturating_add(1);
            guesser.last = now;
            let doublings = guesser.wrong.checked_sub(FREE);
            let wait = doublings.map(|n| FIRST.saturating_mul(1 << n.min(16)).min(LONGEST));
            guesser.until = now + wait.unwrap_or_default();
        }
    }

    /// This address knew the secret.
    pub(super) fn right(&mut self, from: IpAddr) {
        let from = network(from);
        self.0.retain(|guesser| guesser.address != from);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::net::Ipv6Addr;

    #[test]
    fn each_wrong_guess_doubles_the_wait_up_to_five_minutes() {
        let mut patience = Patience::default();
        let (here, mut now) = (IpAddr::from([10, 0, 0, 1]), Instant::now());
        let mut waits = Vec::new();
        for _ in 0..12 {
            patience.wrong(here, now);
            let wait = patience.wait(here, now).unwrap_or_default();
            waits.push(wait.as_secs());
            now += wait;
            assert_eq!(patience.wait(here, now), None);
        }
        assert_eq!(waits, [0, 0, 2, 4, 8, 16, 32, 64, 128, 256, 300, 300]);
        patience.right(here);
        patience.wrong(here, now);
        assert_eq!(patience.wait(here, now), None);
    }

    #[test]
    fn a_host_with_many_ipv6_addresses_is_one_guesser() {
        let mut patience = Patience::default();
        let now = Instant::now();
        for host in 0..FREE as u16 {
            patience.wrong(Ipv6Addr::new(0xfd00, 1, 2, 3, host, 0, 0, host).into(), now);
        }
        let next = Ipv6Addr::new(0xfd00, 1, 2, 3, 9, 9, 9, 9);
        assert!(patience.wait(next.into(), now).is_some());
        let neighbour = Ipv6Addr::new(0xfd00, 1, 2, 4, 9, 9, 9, 9);
        assert!(patience.wait(neighbour.into(), now).is_none());
    }

    #[test]
    fn the_memory_is_bounded_and_keeps_those_who_wait_longest() {
        let mut patience = Patience::default();
        let (bad, now) = (IpAddr::from([10, 9, 9, 9]), Instant::now());
        for _ in 0..6 {
            patience.wrong(bad, now);
        }
        for host in 0..2000_u32 {
            patience.wrong(IpAddr::from(host.to_be_bytes()), now);
        }
        assert!(patience.0.len() <= MOST);
        assert!(patience.wait(bad, now).is_some());
    }
}
