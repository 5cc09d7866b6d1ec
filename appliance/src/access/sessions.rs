//! The open sessions, each of one user, and the tokens by which they are known.

use crate::storage::hex;
use sha2::{Digest, Sha256};
use std::time::{Duration, Instant};

/// A session ends when it was not used for this long.
const SESSION_IDLE: Duration = Duration::from_secs(30 * 60);
/// A session ends at this age in any case: a shift.
pub const MAX_AGE_S: u64 = 12 * 3600;
/// The most sessions of one user; another one ends the one that was unused for longest, so that no
/// user ends the sessions of others.
const MOST_EACH: usize = 16;

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
    user: String,
    begun: Instant,
    used: Instant,
}

impl Session {
    fn is_open(&self, now: Instant) -> bool {
        now.saturating_duration_since(self.used) < SESSION_IDLE
            && now.saturating_duration_since(self.begun).as_secs() < MAX_AGE_S
    }
}

/// The open sessions.
#[derive(Debug, Default)]
pub(super) struct Sessions(Vec<Session>);

impl Sessions {
    /// A new session of a user.
    ///
    /// # Errors
    /// If the system gives no random bits.
    pub fn begin(&mut self, user: &str, now: Instant) -> Result<Token, getrandom::Error> {
        let mut random = [0_u8; 32];
        getrandom::fill(&mut random)?;
        let token = Token(hex(&random));
        self.0.retain(|session| session.is_open(now));
        let own = self.0.iter().filter(|session| session.user == user);
        if own.count() >= MOST_EACH {
            self.0.sort_by_key(|session| session.used);
            let unused = self.0.iter().position(|session| session.user == user);
            unused.map(|at| self.0.remove(at));
        }
        self.0.push(Session {
            hash: hash(&token.0),
            user: user.to_owned(),
            begun: now,
            used: now,
        });
        Ok(token)
    }

    /// Whose session it is, if it is open; then it was used now.
    pub fn touch(&mut self, token: &str, now: Instant) -> Option<&str> {
        self.0.retain(|session| session.is_open(now));
        // Hashes are compared, so the time of a comparison reveals nothing about the token.
        let wanted = hash(token);
        let found = self.0.iter_mut().find(|session| session.hash == wanted)?;
        found.used = now;
        Some(&found.user)
    }

    /// Ends a session.
    pub fn end(&mut self, token: &str) {
        let ended = hash(token);
        self.0.retain(|session| session.hash != ended);
    }

    /// Ends all sessions of a user.
    pub fn end_all(&mut self, user: &str) {
        self.0.retain(|session| session.user != user);
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
        let token = sessions.begin("anna", begun).unwrap();
        let mut now = begun;
        while now.duration_since(begun).as_secs() + SESSION_IDLE.as_secs() / 2 < MAX_AGE_S {
            now += SESSION_IDLE / 2;
            assert_eq!(sessions.touch(token.text(), now), Some("anna"));
        }
        assert_eq!(sessions.touch(token.text(), now + SESSION_IDLE / 2), None);
        let token = sessions.begin("anna", now).unwrap();
        assert_eq!(sessions.touch(token.text(), now + SESSION_IDLE), None);
    }

    #[test]
    fn only_the_whole_token_opens_and_the_oldest_session_of_a_user_gives_way() {
        let mut sessions = Sessions::default();
        let now = Instant::now();
        let other = sessions.begin("bob", now).unwrap();
        let first = sessions.begin("anna", now).unwrap();
        assert_eq!(sessions.touch(&first.text()[1..], now), None);
        assert_eq!(sessions.touch("", now), None);
        let later = now + Duration::from_secs(1);
        let more: Vec<Token> = (0..MOST_EACH)
            .map(|_| sessions.begin("anna", later).unwrap())
            .collect();
        assert_eq!(sessions.touch(first.text(), later), None);
        for token in &more {
            assert_eq!(sessions.touch(token.text(), later), Some("anna"));
        }
        assert_eq!(sessions.touch(other.text(), later), Some("bob"));
        sessions.end_all("anna");
        assert_eq!(sessions.touch(more[3].text(), later), None);
        assert_eq!(sessions.touch(other.text(), later), Some("bob"));
    }
}
