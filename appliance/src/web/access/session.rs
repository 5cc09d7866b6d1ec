//! Sessions: random tokens that a browser keeps in a cookie; the device keeps only their hashes.

use sha2::{Digest, Sha256};
use std::time::{Duration, Instant};

/// A session ends when it was not used for this long.
const IDLE: Duration = Duration::from_secs(30 * 60);
/// A session ends at this age in any case: a shift.
pub const MAX_AGE_S: u64 = 12 * 3600;
/// The most sessions at a time; another one ends the one that was unused for longest.
const MOST: usize = 16;

/// The token of a session: 256 random bits in hexadecimal digits.
#[derive(Clone, PartialEq, Eq)]
pub struct Token(String);

impl Token {
    /// The digits.
    pub fn text(&self) -> &str {
        &self.0
    }
}

impl std::fmt::Debug for Token {
    // A token in a log would give access.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Token")
    }
}

#[derive(Debug)]
struct Session {
    hash: [u8; 32],
    begun: Instant,
    used: Instant,
}

impl Session {
    fn is_open(&self, now: Instant) -> bool {
        now.saturating_duration_since(self.used) < IDLE
            && now.saturating_duration_since(self.begun).as_secs() < MAX_AGE_S
    }
}

/// The open sessions.
#[derive(Debug, Default)]
pub(super) struct Sessions(Vec<Session>);

impl Sessions {
    /// A new session.
    ///
    /// # Errors
    /// If the system gives no random bits.
    pub(super) fn begin(&mut self, now: Instant) -> Result<Token, String> {
        let mut random = [0_u8; 32];
        getrandom::fill(&mut random).map_err(|error| error.to_string())?;
        let token = Token(crate::storage::hex(&random));
        self.0.retain(|session| session.is_open(now));
        if self.0.len() >= MOST {
            self.0.sort_by_key(|session| session.used);
            self.0.remove(0);
        }
        self.0.push(Session {
            hash: hash(&token.0),
            begun: now,
            used: now,
        });
        Ok(token)
    }

    /// Whether the session is open; then it was used now.
    pub(super) fn touch(&mut self, token: &str, now: Instant) -> bool {
        self.0.retain(|session| session.is_open(now));
        // Hashes are compared, so the time of a comparison reveals nothing about the token.
        let wanted = hash(token);
        let found = self.0.iter_mut().find(|session| session.hash == wanted);
        found.map(|session| session.used = now).is_some()
    }

    pub(super) fn end(&mut self, token: &str) {
        let ended = hash(token);
        self.0.retain(|session| session.hash != ended);
    }
}

fn hash(token: &str) -> [u8; 32] {
    Sha256::digest(token.as_bytes()).into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_session_ends_when_unused_and_after_a_shift_at_the_latest() {
        let mut sessions = Sessions::default();
        let begun = Instant::now();
        let token = sessions.begin(begun).unwrap();
        let mut now = begun;
        while now.duration_since(begun).as_secs() + IDLE.as_secs() / 2 < MAX_AGE_S {
            now += IDLE / 2;
            assert!(sessions.touch(token.text(), now));
        }
        assert!(!sessions.touch(token.text(), now + IDLE / 2));
        let token = sessions.begin(now).unwrap();
        assert!(!sessions.touch(token.text(), now + IDLE));
    }

    #[test]
    fn only_the_whole_token_opens_and_the_oldest_session_gives_way() {
        let mut sessions = Sessions::default();
        let now = Instant::now();
        let first = sessions.begin(now).unwrap();
        assert!(!sessions.touch(&first.text()[1..], now));
        assert!(!sessions.touch("", now));
        let later = now + Duration::from_secs(1);
        let more: Vec<Token> = (0..MOST).map(|_| sessions.begin(later).unwrap()).collect();
        assert!(!sessions.touch(first.text(), later));
        assert!(more.iter().all(|token| sessions.touch(token.text(), later)));
    }
}
