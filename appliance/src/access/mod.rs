//! Who may do what on this device, and the record of who did.
//!
//! Looking needs no login, unless the configuration says so. Everything else needs a session, which
//! [`Access::sign_in`] opens for a user and its password, or for the device's secret, whose user is
//! the engineer [`ENGINEER`]: the secret that was configured, else the one that was made and shown
//! once at the first start. The folder `access` of the state folder holds `secret`, the argon2id
//! hash, `users.json` and the record. If `secret` is deleted, the next start makes a new one; only
//! the owner of the device can delete it. The PLC and its registers know no users.

mod backward;
pub mod chain;
mod patience;
pub mod record;
mod role;
mod secret;
mod sessions;
pub mod users;

pub use record::{Change, ChangeRecord, Way};
pub use role::Role;
pub use secret::NewSecret;
pub use sessions::{MAX_AGE_S, Token};
pub use users::{ENGINEER, User, UserError};

use crate::error::{Exit, Result};
use crate::system::socket::network;
use patience::Patience;
use sessions::Sessions;
use std::net::IpAddr;
use std::path::Path;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use users::Users;

/// Access control of one device. Cheap to clone.
#[derive(Clone, Debug)]
pub struct Access(Arc<AccessState>);

#[derive(Debug)]
struct AccessState {
    hash: String,
    logins: Mutex<Logins>,
    /// One password is hashed at a time: argon2id takes 19 MiB and a core.
    guessing: Mutex<()>,
    record: ChangeRecord,
}

#[derive(Debug)]
struct Logins {
    users: Users,
    sessions: Sessions,
    addresses: Patience<IpAddr>,
    /// By the small letters of a name, whether it exists or not. The device's secret is too long to
    /// be guessed: nobody can keep its owner out by guessing.
    names: Patience<String>,
}

/// A signed-in user.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Signed {
    /// Its name.
    pub name: String,
    /// What it may do now.
    pub role: Role,
}

impl std::fmt::Display for Signed {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.name == ENGINEER {
            true => f.write_str(ENGINEER),
            false => write!(f, "{} ({})", self.name, self.role.word()),
        }
    }
}

/// A sign-in that was refused.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Refused {
    /// Not the secret.
    #[error(
        "this is not the secret of this device: the one that was given to it, or else was shown once at its first start, in the journal"
    )]
    Wrong,
    /// No such user, or not its password.
    #[error("the name or the password is wrong: an engineer can set a new password")]
    WrongUser,
    /// Too many wrong guesses from this address, or about this name.
    #[error("too many wrong guesses: wait {} s", .0.as_secs().max(1))]
    Wait(Duration),
    /// The system gave no random bits, or the stored hash cannot be read.
    #[error("signing in failed: {0}; restart fringed")]
    Broken(String),
}

/// What the access control of a folder opens with.
pub struct OpenedAccess {
    /// It.
    pub access: Access,
    /// A new secret, to be shown.
    pub made: Option<NewSecret>,
    /// What could not be used and was put aside.
    pub complaint: Option<String>,
}

impl Access {
    /// Opens the folder, creating it where it does not exist. The secret is that of the file
    /// `given`, if it exists. Otherwise the first start, or one that finds the stored hash damaged,
    /// makes one and answers with it: it must be shown, because only its hash is stored.
    ///
    /// # Errors
    /// If the folder cannot be read or written (exit code 73), or the given secret cannot be used
    /// (78).
    pub fn open(folder: &Path, given: Option<&Path>, record: ChangeRecord) -> Result<OpenedAccess> {
        let what = format!("open {}", folder.display());
        std::fs::create_dir_all(folder).map_err(Exit::CannotCreate.because(&what))?;
        let (hash, made) = match given.map_or(Ok(None), secret::given)? {
            Some(hash) => (hash, None),
            None => {
                secret::open(&folder.join("secret")).map_err(Exit::CannotCreate.because(&what))?
            }
        };
        let (users, complaint) = Users::open(folder);
        let logins = Logins {
            users,
            sessions: Sessions::default(),
            addresses: Patience::default(),
            names: Patience::default(),
        };
        let inside = AccessState {
            hash,
            logins: Mutex::new(logins),
            guessing: Mutex::default(),
            record,
        };
        Ok(OpenedAccess {
            access: Self(Arc::new(inside)),
            made,
            complaint,
        })
    }

    /// Opens a session for a user's password, or without a name for the device's secret. It takes
    /// some ten milliseconds of a core, whether there is such a user or not, so the socket thread
    /// must not call it.
    ///
    /// # Errors
    /// The password is wrong, or there were too many wrong guesses.
    pub fn sign_in(
        &self,
        from: IpAddr,
        name: Option<&str>,
        password: &str,
        now: Instant,
    ) -> Result<(Token, Signed), Refused> {
        // Locked from the check to the verdict, so that concurrent guesses are counted one by one.
        let _one = self.guessing();
        let signed = self.guess(from, name, password, now)?;
        let begun = self.logins().sessions.begin(&signed.name, now);
        let token = begun.map_err(|error| Refused::Broken(error.to_string()))?;
        Ok((token, signed))
    }

    /// Refuses a guess that has to wait, without a hash.
    ///
    /// # Errors
    /// There were too many wrong guesses.
    pub fn wait(&self, from: IpAddr, name: Option<&str>, now: Instant) -> Result<(), Refused> {
        let (from, _, key) = guessed(from, name);
        let logins = self.logins();
        let of_name = key.map_or(Duration::ZERO, |key| logins.names.wait(&key, now));
        let wait = logins.addresses.wait(&from, now).max(of_name);
        match wait.is_zero() {
            true => Ok(()),
            false => Err(Refused::Wait(wait)),
        }
    }

    /// Whose password this is, waiting after wrong ones. The caller guesses alone.
    fn guess(
        &self,
        from: IpAddr,
        name: Option<&str>,
        password: &str,
        now: Instant,
    ) -> Result<Signed, Refused> {
        self.wait(from, name, now)?;
        let (from, name, key) = guessed(from, name);
        let user = name.and_then(|name| self.logins().users.find(name).cloned());
        let right = match (name, &user) {
            (None, _) => secret::is_right(password, &self.0.hash),
            _ if password.len() > users::LONGEST => Ok(false),
            (_, Some(user)) => secret::is_password(password, &user.hash),
            (_, None) => secret::is_password(password, secret::OF_NOBODY).map(|_| false),
        };
        let right = right.map_err(|error| Refused::Broken(error.to_string()))?;
        let mut logins = self.logins();
        if !right {
            logins.addresses.wrong(from, now);
            if let Some(key) = key {
                logins.names.wrong(key, now);
            }
            return Err(match name {
                Some(_) => Refused::WrongUser,
                None => Refused::Wrong,
            });
        }
        logins.addresses.right(&from);
        if let Some(key) = key {
            logins.names.right(&key);
        }
        Ok(user.map_or_else(engineer, |user| Signed {
            name: user.name,
            role: user.role,
        }))
    }

    /// Who is signed in with a token; each use keeps the session open. The role is that of now.
    pub fn signed_in(&self, token: &str, now: Instant) -> Option<Signed> {
        let mut logins = self.logins();
        let name = logins.sessions.touch(token, now)?.to_owned();
        if name == ENGINEER {
            return Some(engineer());
        }
        // A session of a user that is removed is ended with it.
        let role = logins.users.find(&name)?.role;
        Some(Signed { name, role })
    }

    /// Ends a session.
    pub fn sign_out(&self, token: &str) {
        self.logins().sessions.end(token);
    }

    /// All users but the engineer of the device's secret, without their hashes.
    pub fn users(&self) -> Vec<User> {
        let mut users = self.logins().users.list().to_vec();
        for user in &mut users {
            user.hash.clear();
        }
        users
    }

    /// Adds a user with a password, or changes the role, the password or both of one. Its sessions
    /// end where the password is another.
    ///
    /// # Errors
    /// Name or password cannot be used, there are too many users, or they cannot be stored.
    pub fn set_user(
        &self,
        name: &str,
        role: Role,
        password: Option<&str>,
        (since_utc_us, by): (Option<u64>, &str),
    ) -> Result<User, UserError> {
        users::check_name(name).map_err(UserError::Unfit)?;
        let _one = self.guessing();
        let known = self.logins().users.find(name).cloned();
        let (hash, pin) = match (password, &known) {
            (Some(password), _) => {
                let pin = users::check_password(password, role).map_err(UserError::Unfit)?;
                let hash = secret::hash_password(password);
                let hash = hash.map_err(|error| UserError::Unfit(error.to_string()))?;
                (hash, pin)
            }
            (None, None) => {
                let words = format!("user {name} is new: give a password");
                return Err(UserError::Unfit(words));
            }
            (None, Some(known)) if known.pin && role > Role::Operator => {
                let words = format!(
                    "{} has a PIN, which only operators may: give a password with the new role",
                    known.name
                );
                return Err(UserError::Unfit(words));
            }
            (None, Some(known)) => (known.hash.clone(), known.pin),
        };
        let user = User {
            name: known.map_or_else(|| name.to_owned(), |known| known.name),
            role,
            hash,
            pin,
            since_utc_us,
            by: by.to_owned(),
        };
        let mut logins = self.logins();
        logins.users.put(user.clone())?;
        if password.is_some() {
            logins.sessions.end_all(&user.name);
        }
        Ok(User {
            hash: String::new(),
            ..user
        })
    }

    /// Removes a user, and ends its sessions.
    ///
    /// # Errors
    /// There is no such user, it is that of the device's secret, or users cannot be stored.
    pub fn remove_user(&self, name: &str) -> Result<(), UserError> {
        users::check_name(name).map_err(UserError::Unfit)?;
        let mut logins = self.logins();
        let known = logins.users.find(name).map(|user| user.name.clone());
        logins.users.remove(name)?;
        if let Some(name) = known {
            logins.sessions.end_all(&name);
        }
        Ok(())
    }

    /// Whether this is the password of a signed-in user, guessed from this address.
    ///
    /// # Errors
    /// As [`Self::sign_in`].
    pub fn confirm(
        &self,
        from: IpAddr,
        name: &str,
        password: &str,
        now: Instant,
    ) -> Result<Signed, Refused> {
        let _one = self.guessing();
        self.guess(from, Some(name), password, now)
    }

    /// The record of changes.
    pub fn record(&self) -> &ChangeRecord {
        &self.0.record
    }

    fn guessing(&self) -> MutexGuard<'_, ()> {
        let guessing = self.0.guessing.lock();
        guessing.unwrap_or_else(PoisonError::into_inner)
    }

    fn logins(&self) -> MutexGuard<'_, Logins> {
        self.0.logins.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Where a guess comes from, whom it names but the engineer, and how that name is remembered: as long
/// as any name may be, so that the memory is bounded.
fn guessed(from: IpAddr, name: Option<&str>) -> (IpAddr, Option<&str>, Option<String>) {
    let name = name.filter(|name| !name.is_empty() && !users::is_same(name, ENGINEER));
    let key = name.map(|name| name.to_lowercase().chars().take(users::LONGEST).collect());
    (network(from), name, key)
}

fn engineer() -> Signed {
    Signed {
        name: ENGINEER.into(),
        role: Role::Engineer,
    }
}

#[cfg(test)]
mod tests;
