//! Access control: the device's secret, sessions, limits on wrong guesses, and the record of
//! changes.
//!
//! Reading needs no login. A change needs a session, which [`Access::sign_in`] opens for the
//! device's secret: the one that was configured, else the one that was made and shown once at the
//! first start. The folder `access` of the state folder holds `secret`, the argon2id hash, and
//! `changes.jsonl`, the record. If `secret` is deleted, the next start makes a new one; only the
//! owner of the device can delete it.

mod changes;
mod patience;
mod secret;
mod session;

pub use changes::{Change, Changes};
pub use secret::NewSecret;
pub use session::{MAX_AGE_S, Token};

use crate::error::{Exit, Result};
use patience::Patience;
use session::Sessions;
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
        let given = given.map_or(Ok(None), secret::given);
        let given = given.map_err(Exit::Configuration.failure())?;
        let (hash, shown) = match given {
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
        let right = secret::is_right(secret, &self.0.hash).map_err(Refused::Broken)?;
        let mut logins = self.logins();
        if !right {
            logins.patience.wrong(from, now);
            return Err(Refused::Wrong);
        }
        logins.patience.right(from);
        logins.sessions.begin(now).map_err(Refused::Broken)
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

#[cfg(test)]
mod tests {
    use super::*;

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
}
