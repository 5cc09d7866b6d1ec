//! Waits after wrong guesses, for each address and for each name of a user.

use std::time::{Duration, Instant};

/// Wrong guesses before the first wait.
pub(super) const FREE_GUESSES: u32 = 3;
/// The first wait.
const FIRST_WAIT: Duration = Duration::from_secs(2);
/// The longest wait.
pub(super) const LONGEST_WAIT: Duration = Duration::from_secs(300);
/// Guesses are forgotten after this time.
const GUESSES_KEPT: Duration = Duration::from_secs(3600);
/// The most that are remembered; another one replaces the one with the shortest wait left.
const MOST: usize = 256;

#[derive(Debug)]
struct Guesses<K> {
    of: K,
    wrong: u32,
    last: Instant,
    until: Instant,
}

/// Where wrong guesses came from, or whom they were about.
#[derive(Debug)]
pub(super) struct Patience<K>(Vec<Guesses<K>>);

impl<K> Default for Patience<K> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

impl<K: PartialEq> Patience<K> {
    /// How long is still to wait; nothing if a guess is free.
    pub fn wait(&self, of: &K, now: Instant) -> Duration {
        let known = self.0.iter().find(|known| known.of == *of);
        known.map_or(Duration::ZERO, |known| {
            known.until.saturating_duration_since(now)
        })
    }

    /// A guess was wrong.
    pub fn wrong(&mut self, of: K, now: Instant) {
        self.0
            .retain(|known| now.saturating_duration_since(known.last) < GUESSES_KEPT);
        let known = self.0.iter().position(|known| known.of == of);
        let mut guesses = match known {
            Some(at) => self.0.swap_remove(at),
            None => Guesses {
                of,
                wrong: 0,
                last: now,
                until: now,
            },
        };
        guesses.wrong = guesses.wrong.saturating_add(1);
        guesses.last = now;
        let doublings = guesses.wrong.checked_sub(FREE_GUESSES);
        let wait = doublings.map(|n| FIRST_WAIT.saturating_mul(1 << n.min(16)).min(LONGEST_WAIT));
        guesses.until = now + wait.unwrap_or_default();
        if self.0.len() >= MOST {
            self.0.sort_by_key(|known| known.until);
            self.0.remove(0);
        }
        self.0.push(guesses);
    }

    /// A guess was right.
    pub fn right(&mut self, of: &K) {
        self.0.retain(|known| known.of != *of);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_wrong_guess_doubles_the_wait_up_to_five_minutes() {
        let mut patience = Patience::default();
        let mut now = Instant::now();
        let mut waits = Vec::new();
        for _ in 0..12 {
            patience.wrong(1, now);
            let wait = patience.wait(&1, now);
            waits.push(wait.as_secs());
            now += wait;
            assert_eq!(patience.wait(&1, now), Duration::ZERO);
        }
        assert_eq!(waits, [0, 0, 2, 4, 8, 16, 32, 64, 128, 256, 300, 300]);
        patience.right(&1);
        patience.wrong(1, now);
        assert_eq!(patience.wait(&1, now), Duration::ZERO);
    }

    #[test]
    fn the_memory_is_bounded_and_keeps_those_who_wait_longest() {
        let mut patience = Patience::default();
        let now = Instant::now();
        for _ in 0..6 {
            patience.wrong(9999, now);
        }
        for other in 0..2000 {
            patience.wrong(other, now);
        }
        assert!(patience.0.len() <= MOST);
        assert!(!patience.wait(&9999, now).is_zero());
    }
}
