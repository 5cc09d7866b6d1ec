//! Who may change something: the device's secret, sessions, patience with wrong guesses, and the record of what was changed.
//!
//! Looking needs no login. Changing needs a session, which [`Access::sign_in`] gives for the secret that was given to the
//! device, or else was shown once at the first start. Everything of it lies in the folder `access` of the state folder: `secret`, the argon2id hash, and
//! `changes.jsonl`, the record. Whoever can delete `secret` owns the device anyway: the next start makes a new one.

mod changes;
mod patience;
mod secret;
mod session;

pub use changes::{Change, Changes};
pub use session::{MAX_AGE_S, Token};

use crate::error::{Exit, Failure};
use patience::Patience;
use session::Sessions;
use std::net::IpAddr;
use std::path::Path;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// The way in. Cheap to clone.
#[derive(Clone, Debug)]
pub struct Access(Arc<Inside>);

#[derive(Debug)]
struct Inside {
    hash: String,
    doors: Mutex<Doors>,
    /// One guess is hashed at a time: argon2id takes 19 MiB and a core.
    guessing: Mutex<()>,
    changes: Changes,
}

#[derive(Debug, Default)]
struct Doors {
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
    /// Opens the folder, creating it where it does not exist. At the first start it makes the device's secret and
    /// answers with it: show it, nobody can read it again.
    ///
    /// # Errors
    /// If the folder cannot be read or written (exit code 73).
    pub fn open(folder: &Path) -> Result<(Self, Option<String>), Failure> {
        Self::open_given(folder, None)
    }

    /// The same, with the secret that a file gives, if it exists; then none is made and none is stored.
    ///
    /// # Errors
    /// As [`Access::open`]; if the given secret cannot be used (exit code 78).
    pub fn open_given(
        folder: &Path,
        given: Option<&Path>,
    ) -> Result<(Self, Option<String>), Failure> {
        let failed = |error: String| {
            let what = format!("open {}", folder.display());
            Failure::because(Exit::CannotCreate, what, error)
        };
        std::fs::create_dir_all(folder).map_err(|error| failed(error.to_string()))?;
        let given = given.map_or(Ok(None), secret::given);
        let given = given.map_err(|error| Failure::new(Exit::Configuration, error))?;
        let (hash, shown) = match given {
            Some(hash) => (hash, None),
            None => secret::open(&folder.join("secret")).map_err(failed)?,
        };
        let changes = Changes::open(&folder.join("changes.jsonl"));
        let inside = Inside {
            hash,
            doors: Mutex::default(),
            guessing: Mutex::default(),
            changes,
        };
        Ok((Self(Arc::new(inside)), shown))
    }

    /// A session for the secret. Takes some ten milliseconds of a core: not for the socket thread.
    ///
    /// # Errors
    /// The secret is wrong, or this address guessed too often.
    pub fn sign_in(&self, from: IpAddr, secret: &str, now: Instant) -> Result<Token, Refused> {
        // Held over check and verdict, so that many guesses at once are still counted one by one.
        let _one = self
            .0
            .guessing
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        if let Some(wait) = self.doors().patience.wait(from, now) {
            return Err(Refused::Wait(wait));
        }
        let right = secret::is_right(secret, &self.0.hash).map_err(Refused::Broken)?;
        let mut doors = self.doors();
        if !right {
            doors.patience.wrong(from, now);
            return Err(Refused::Wrong);
        }
        doors.patience.right(from);
        doors.sessions.begin(now).map_err(Refused::Broken)
    }

    /// Whether a session is still open; each use keeps it open.
    pub fn is_signed_in(&self, token: &str, now: Instant) -> bool {
        self.doors().sessions.touch(token, now)
    }

    /// Ends a session.
    pub fn sign_out(&self, token: &str) {
        self.doors().sessions.end(token);
    }

    /// The record of changes.
    pub fn changes(&self) -> &Changes {
        &self.0.changes
    }

    fn doors(&self) -> MutexGuard<'_, Doors> {
        self.0.doors.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HERE: IpAddr = IpAddr::V4(std::net::Ipv4Addr::LOCALHOST);

    #[test]
    fn the_secret_is_shown_once_and_opens_after_every_restart() {
        let folder = tempfile::tempdir().unwrap();
        let now = Instant::now();
        let (access, shown) = Access::open(folder.path()).unwrap();
        let secret = shown.unwrap();
        let token = access.sign_in(HERE, &secret, now).unwrap();
        assert!(access.is_signed_in(token.text(), now));
        access.sign_out(token.text());
        assert!(!access.is_signed_in(token.text(), now));
        let (access, shown) = Access::open(folder.path()).unwrap();
        assert_eq!(shown, None);
        // As people write it down: without dashes, in small letters.
        let typed = secret.replace('-', " ").to_lowercase();
        assert!(access.sign_in(HERE, &typed, now).is_ok());
    }

    #[test]
    fn a_secret_that_was_given_goes_before_the_stored_one_and_leaves_it_alone() {
        let (folder, given) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        let file = given.path().join("secret");
        let open = || Access::open_given(folder.path(), Some(&file)).unwrap();
        let now = Instant::now();
        std::fs::write(&file, "0123A-BCDEF-GHJKM").unwrap();
        let (access, shown) = open();
        assert!(shown.is_none() && !folder.path().join("secret").exists());
        assert!(access.sign_in(HERE, "0123A-BCDEF-GHJKM", now).is_ok());
        std::fs::remove_file(&file).unwrap();
        let (access, shown) = open();
        assert!(access.sign_in(HERE, &shown.unwrap(), now).is_ok());
        assert!(access.sign_in(HERE, "0123A-BCDEF-GHJKM", now).is_err());
    }

    #[test]
    fn wrong_guesses_make_their_address_wait_and_no_other() {
        let folder = tempfile::tempdir().unwrap();
        let (access, secret) = Access::open(folder.path()).unwrap();
        let (secret, now) = (secret.unwrap(), Instant::now());
        for _ in 0..patience::FREE {
            assert_eq!(access.sign_in(HERE, "guess", now), Err(Refused::Wrong));
        }
        let waiting = access.sign_in(HERE, &secret, now);
        assert!(matches!(waiting, Err(Refused::Wait(_))), "{waiting:?}");
        let other = IpAddr::from([10, 0, 0, 7]);
        assert!(access.sign_in(other, &secret, now).is_ok());
        let later = now + patience::LONGEST;
        assert!(access.sign_in(HERE, &secret, later).is_ok());
    }

    #[test]
    fn two_devices_never_share_a_secret_and_the_file_does_not_hold_it() {
        let folders = [tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap()];
        let secrets = folders
            .each_ref()
            .map(|folder| Access::open(folder.path()).unwrap().1.unwrap());
        assert_ne!(secrets[0], secrets[1]);
        let stored = std::fs::read_to_string(folders[0].path().join("secret")).unwrap();
        assert!(stored.starts_with("$argon2id$"), "{stored}");
        assert!(!stored.contains(&secrets[0]));
    }

    #[test]
    fn a_damaged_secret_file_is_an_error_with_the_remedy_and_lets_nobody_in() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("secret"), "$argon2id$broken").unwrap();
        let refused = Access::open(folder.path()).unwrap_err();
        assert!(refused.message.contains("delete it"), "{refused}");
    }
}
