//! Access control: the device's secret, sessions, limits on wrong guesses, and the record of
//! changes.
//!
//! Reading needs no login. A change needs a session, which [`Access::sign_in`] opens for the
//! device's secret: the one that was configured, else the one that was made and shown once at the
//! first start. The folder `access` of the state folder holds `secret`, the argon2id hash, and
//! `changes.jsonl`, the record. If `secret` is deleted, the next start makes a new one; only the
//! owner of the device can delete it.

mod changes;
mod secret;

pub use changes::{Change, Changes};
pub use secret::NewSecret;

use crate::error::{Exit, Result};
use crate::system::socket::network;
use sha2::{Digest, Sha256};
use std::net::IpAddr;
use std::path::Path;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Access control of one device. Cheap to clone.
#[derive(Clone, Debug)]
pub struct Access(Arc<AccessState>);

#[derive(Debug)]
struct AccessState {
    hash: String,
    logins: Mutex<Logins>,
    /// One guess is hashed at a time: argon2id takes 19 MiB and a core.
    guessing: Mutex<()>,
    changes: Changes,
}

#[derive(Debug, Default)]
struct Logins {
    sessions: Sessions,
    patience: Patience,
}

/// A sign-in that was refused.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Refused {
    /// Not the secret.
    #[error(
        "this is not the secret of this device: the one that was given to it, or else was shown once at its first start, in the journal"
    )]
    Wrong,
    /// Too many wrong guesses from this address.
    #[error("too many wrong secrets from this address: wait {} s", .0.as_secs().max(1))]
    Wait(Duration),
    /// The system gave no random bits, or the stored hash cannot be read.
    #[error("signing in failed: {0}; restart fringed")]
    Broken(String),
}

impl Access {
    /// Opens the folder, creating it where it does not exist. The secret is that of the file
    /// `given`, if it exists. Otherwise the first start, or one that finds the stored hash damaged,
    /// makes one and answers with it: it must be shown, because only its hash is stored.
    ///
    /// # Errors
    /// If the folder cannot be read or written (exit code 73), or the given secret cannot be used
    /// (78).
    pub fn open(folder: &Path, given: Option<&Path>) -> Result<(Self, Option<NewSecret>)> {
        let what = format!("open {}", folder.display());
        std::fs::create_dir_all(folder).map_err(Exit::CannotCreate.because(&what))?;
        let (hash, shown) = match given.map_or(Ok(None), secret::given)? {
            Some(hash) => (hash, None),
            None => {
                secret::open(&folder.join("secret")).map_err(Exit::CannotCreate.because(&what))?
            }
        };
        let changes = Changes::open(&folder.join("changes.jsonl"));
        let inside = AccessState {
            hash,
            logins: Mutex::default(),
            guessing: Mutex::default(),
            changes,
        };
        Ok((Self(Arc::new(inside)), shown))
    }

    /// Opens a session for the secret. It takes some ten milliseconds of a core, so the socket
    /// thread must not call it.
    ///
    /// # Errors
    /// The secret is wrong, or this address guessed too often.
    pub fn sign_in(&self, from: IpAddr, secret: &str, now: Instant) -> Result<Token, Refused> {
        // Locked from the check to the verdict, so that concurrent guesses are counted one by one.
        let _one = self
            .0
            .guessing
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        if let Some(wait) = self.logins().patience.wait(from, now) {
            return Err(Refused::Wait(wait));
        }
        let right = secret::is_right(secret, &self.0.hash);
        let right = right.map_err(|error| Refused::Broken(error.to_string()))?;
        let mut logins = self.logins();
        if !right {
            logins.patience.wrong(from, now);
            return Err(Refused::Wrong);
        }
        logins.patience.right(from);
        let begun = logins.sessions.begin(now);
        begun.map_err(|error| Refused::Broken(error.to_string()))
    }

    /// Whether a session is still open; each use keeps it open.
    pub fn is_signed_in(&self, token: &str, now: Instant) -> bool {
        self.logins().sessions.touch(token, now)
    }

    /// Ends a session.
    pub fn sign_out(&self, token: &str) {
        self.logins().sessions.end(token);
    }

    /// The record of changes.
    pub fn changes(&self) -> &Changes {
        &self.0.changes
    }

    fn logins(&self) -> MutexGuard<'_, Logins> {
        self.0.logins.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A session ends when it was not used for this long.
const SESSION_IDLE: Duration = Duration::from_secs(30 * 60);
/// A session ends at this age in any case: a shift.
pub const MAX_AGE_S: u64 = 12 * 3600;
/// The most sessions at a time; another one ends the one that was unused for longest.
const MOST_SESSIONS: usize = 16;

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
        now.saturating_duration_since(self.used) < SESSION_IDLE
            && now.saturating_duration_since(self.begun).as_secs() < MAX_AGE_S
    }
}

/// The open sessions.
#[derive(Debug, Default)]
struct Sessions(Vec<Session>);

impl Sessions {
    /// A new session.
    ///
    /// # Errors
    /// If the system gives no random bits.
    fn begin(&mut self, now: Instant) -> Result<Token, getrandom::Error> {
        let mut random = [0_u8; 32];
        getrandom::fill(&mut random)?;
        let token = Token(crate::storage::hex(&random));
        self.0.retain(|session| session.is_open(now));
        if self.0.len() >= MOST_SESSIONS {
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
    fn touch(&mut self, token: &str, now: Instant) -> bool {
        self.0.retain(|session| session.is_open(now));
        // Hashes are compared, so the time of a comparison reveals nothing about the token.
        let wanted = hash(token);
        let found = self.0.iter_mut().find(|session| session.hash == wanted);
        found.map(|session| session.used = now).is_some()
    }

    fn end(&mut self, token: &str) {
        let ended = hash(token);
        self.0.retain(|session| session.hash != ended);
    }
}

fn hash(token: &str) -> [u8; 32] {
    Sha256::digest(token.as_bytes()).into()
}

/// Wrong guesses before the first wait.
const FREE_GUESSES: u32 = 3;
/// The first wait.
const FIRST_WAIT: Duration = Duration::from_secs(2);
/// The longest wait.
const LONGEST_WAIT: Duration = Duration::from_secs(300);
/// Guesses are forgotten after this time.
const GUESSES_KEPT: Duration = Duration::from_secs(3600);
/// The most addresses remembered; another one replaces the one with the shortest wait left.
const MOST_GUESSERS: usize = 256;

#[derive(Debug)]
struct Guesser {
    address: IpAddr,
    wrong: u32,
    last: Instant,
    until: Instant,
}

/// The addresses that guessed wrongly.
#[derive(Debug, Default)]
struct Patience(Vec<Guesser>);

impl Patience {
    /// How long this address still has to wait; none if it may guess.
    fn wait(&self, from: IpAddr, now: Instant) -> Option<Duration> {
        let from = network(from);
        let guesser = self.0.iter().find(|guesser| guesser.address == from)?;
        let left = guesser.until.saturating_duration_since(now);
        (!left.is_zero()).then_some(left)
    }

    /// This address guessed wrongly.
    fn wrong(&mut self, from: IpAddr, now: Instant) {
        let from = network(from);
        self.0
            .retain(|guesser| now.saturating_duration_since(guesser.last) < GUESSES_KEPT);
        if !self.0.iter().any(|guesser| guesser.address == from) {
            if self.0.len() >= MOST_GUESSERS {
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
            let doublings = guesser.wrong.checked_sub(FREE_GUESSES);
            let wait =
                doublings.map(|n| FIRST_WAIT.saturating_mul(1 << n.min(16)).min(LONGEST_WAIT));
            guesser.until = now + wait.unwrap_or_default();
        }
    }

    /// This address knew the secret.
    fn right(&mut self, from: IpAddr) {
        let from = network(from);
        self.0.retain(|guesser| guesser.address != from);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::net::Ipv6Addr;

    const HERE: IpAddr = IpAddr::V4(std::net::Ipv4Addr::LOCALHOST);

    #[test]
    fn the_secret_is_shown_once_and_opens_after_every_restart() {
        let folder = tempfile::tempdir().unwrap();
        let now = Instant::now();
        let (access, shown) = Access::open(folder.path(), None).unwrap();
        let secret = shown.unwrap().secret;
        let token = access.sign_in(HERE, &secret, now).unwrap();
        assert!(access.is_signed_in(token.text(), now));
        access.sign_out(token.text());
        assert!(!access.is_signed_in(token.text(), now));
        let (access, shown) = Access::open(folder.path(), None).unwrap();
        assert_eq!(shown, None);
        // As people write it down: without dashes, in small letters.
        let typed = secret.replace('-', " ").to_lowercase();
        assert!(access.sign_in(HERE, &typed, now).is_ok());
    }

    #[test]
    fn a_secret_that_was_given_goes_before_the_stored_one_and_leaves_it_alone() {
        let (folder, given) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        let file = given.path().join("secret");
        let open = || Access::open(folder.path(), Some(&file)).unwrap();
        let now = Instant::now();
        std::fs::write(&file, "0123A-BCDEF-GHJKM").unwrap();
        let (access, shown) = open();
        assert!(shown.is_none() && !folder.path().join("secret").exists());
        assert!(access.sign_in(HERE, "0123A-BCDEF-GHJKM", now).is_ok());
        std::fs::remove_file(&file).unwrap();
        let (access, shown) = open();
        assert!(access.sign_in(HERE, &shown.unwrap().secret, now).is_ok());
        assert!(access.sign_in(HERE, "0123A-BCDEF-GHJKM", now).is_err());
    }

    #[test]
    fn wrong_guesses_make_their_address_wait_and_no_other() {
        let folder = tempfile::tempdir().unwrap();
        let (access, secret) = Access::open(folder.path(), None).unwrap();
        let (secret, now) = (secret.unwrap().secret, Instant::now());
        for _ in 0..FREE_GUESSES {
            assert_eq!(access.sign_in(HERE, "guess", now), Err(Refused::Wrong));
        }
        let waiting = access.sign_in(HERE, &secret, now);
        assert!(matches!(waiting, Err(Refused::Wait(_))), "{waiting:?}");
        let other = IpAddr::from([10, 0, 0, 7]);
        assert!(access.sign_in(other, &secret, now).is_ok());
        let later = now + LONGEST_WAIT;
        assert!(access.sign_in(HERE, &secret, later).is_ok());
    }

    #[test]
    fn two_devices_never_share_a_secret_and_the_file_does_not_hold_it() {
        let folders = [tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap()];
        let secrets = folders
            .each_ref()
            .map(|folder| Access::open(folder.path(), None).unwrap().1.unwrap().secret);
        assert_ne!(secrets[0], secrets[1]);
        let stored = std::fs::read_to_string(folders[0].path().join("secret")).unwrap();
        assert!(stored.starts_with("$argon2id$"), "{stored}");
        assert!(!stored.contains(&secrets[0]));
    }

    #[test]
    fn a_damaged_secret_file_is_put_aside_and_lets_nobody_in_but_with_a_new_secret() {
        let folder = tempfile::tempdir().unwrap();
        let now = Instant::now();
        let (_, before) = Access::open(folder.path(), None).unwrap();
        let before = before.unwrap().secret;
        for damaged in [&b"$argon2id$broken"[..], b"", b"\xff\xfe"] {
            std::fs::write(folder.path().join("secret"), damaged).unwrap();
            let (access, shown) = Access::open(folder.path(), None).unwrap();
            let NewSecret { secret, complaint } = shown.unwrap();
            assert!(complaint.unwrap().contains("put aside as secret.damaged"));
            assert!(access.sign_in(HERE, &before, now).is_err());
            assert!(access.sign_in(HERE, &secret, now).is_ok());
            let kept = std::fs::read(folder.path().join("secret.damaged")).unwrap();
            assert_eq!(kept, damaged);
            let again = Access::open(folder.path(), None).unwrap().1;
            assert_eq!(again, None);
        }
    }

    #[test]
    fn a_session_ends_when_unused_and_after_a_shift_at_the_latest() {
        let mut sessions = Sessions::default();
        let begun = Instant::now();
        let token = sessions.begin(begun).unwrap();
        let mut now = begun;
        while now.duration_since(begun).as_secs() + SESSION_IDLE.as_secs() / 2 < MAX_AGE_S {
            now += SESSION_IDLE / 2;
            assert!(sessions.touch(token.text(), now));
        }
        assert!(!sessions.touch(token.text(), now + SESSION_IDLE / 2));
        let token = sessions.begin(now).unwrap();
        assert!(!sessions.touch(token.text(), now + SESSION_IDLE));
    }

    #[test]
    fn only_the_whole_token_opens_and_the_oldest_session_gives_way() {
        let mut sessions = Sessions::default();
        let now = Instant::now();
        let first = sessions.begin(now).unwrap();
        assert!(!sessions.touch(&first.text()[1..], now));
        assert!(!sessions.touch("", now));
        let later = now + Duration::from_secs(1);
        let more: Vec<Token> = (0..MOST_SESSIONS)
            .map(|_| sessions.begin(later).unwrap())
            .collect();
        assert!(!sessions.touch(first.text(), later));
        assert!(more.iter().all(|token| sessions.touch(token.text(), later)));
    }

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
        for host in 0..FREE_GUESSES as u16 {
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
        assert!(patience.0.len() <= MOST_GUESSERS);
        assert!(patience.wait(bad, now).is_some());
    }
}
