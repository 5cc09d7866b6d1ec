//! The users of this device beside its secret: `access/users.json`.

use super::role::Role;
use super::secret;
use crate::storage::folder::read_whole;
use serde::{Deserialize, Serialize};
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

/// The user whose password is the device's secret. It cannot be removed.
pub const ENGINEER: &str = "engineer";
/// The most users.
pub const MOST_USERS: usize = 64;
/// The file in the folder `access`.
pub const FILE: &str = "users.json";
/// Longest file, bytes.
pub const MOST_BYTES: u64 = 64 << 10;
/// The file's `format` and `version`.
const FORMAT: (&str, u32) = ("fringed-users", 1);
/// Longest name, characters.
const LONGEST_NAME: usize = 32;
/// Shortest password, characters; the shortest PIN, digits; the longest of both, bytes.
const SHORTEST: usize = 12;
const SHORTEST_PIN: usize = 6;
pub(super) const LONGEST: usize = 128;

/// A user.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct User {
    /// Its name, written as it was given; the case of letters does not matter.
    pub name: String,
    /// What it may do.
    pub role: Role,
    /// argon2id hash of its password or PIN.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub hash: String,
    /// Whether it signs in with a PIN.
    pub pin: bool,
    /// Since when it has been as it is, µs since 1970 UTC; `None` if the clock was not synchronised.
    pub since_utc_us: Option<u64>,
    /// Who made it so.
    pub by: String,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct UsersFile {
    format: String,
    version: u32,
    users: Vec<User>,
}

/// A change of users that is not made.
#[derive(Debug, thiserror::Error)]
pub enum UserError {
    /// Why, with the remedy.
    #[error("{0}")]
    Unfit(String),
    /// There is no such user.
    #[error("there is no user {0}")]
    Unknown(String),
    /// The file cannot be written.
    #[error("store the users: {0}: free space")]
    Store(#[from] io::Error),
}

/// All users.
#[derive(Debug)]
pub(super) struct Users {
    file: PathBuf,
    list: Vec<User>,
}

/// Whether two names are those of one user.
pub fn is_same(one: &str, other: &str) -> bool {
    one.to_lowercase() == other.to_lowercase()
}

impl Users {
    /// Opens the file of a folder, which need not be there. One that cannot be read is put aside:
    /// then only the device's secret opens, and the answer says so.
    pub fn open(folder: &Path) -> (Self, Option<String>) {
        let file = folder.join(FILE);
        let (list, complaint) = match read_whole(&file, MOST_BYTES) {
            Err(error) if error.kind() == ErrorKind::NotFound => (Vec::new(), None),
            read => match read.map_err(|error| error.to_string()).and_then(parsed) {
                Ok(list) => (list, None),
                Err(problem) => {
                    // Where it cannot be renamed it is replaced.
                    let _ = std::fs::rename(&file, file.with_extension("json.damaged"));
                    let file = file.display();
                    let words = format!(
                        "read {file}: {problem}: it is put aside as users.json.damaged, and only the device's secret opens"
                    );
                    (Vec::new(), Some(words))
                }
            },
        };
        (Self { file, list }, complaint)
    }

    /// All, in the order in which they came.
    pub fn list(&self) -> &[User] {
        &self.list
    }

    /// The user of this name.
    pub fn find(&self, name: &str) -> Option<&User> {
        self.list.iter().find(|user| is_same(&user.name, name))
    }

    /// Adds a user, or replaces the one of this name.
    pub fn put(&mut self, user: User) -> Result<(), UserError> {
        let mut list = self.list.clone();
        match list
            .iter()
            .position(|known| is_same(&known.name, &user.name))
        {
            Some(at) => list[at] = user,
            None if list.len() >= MOST_USERS => {
                let words = format!("there are {MOST_USERS} users already: remove one first");
                return Err(UserError::Unfit(words));
            }
            None => list.push(user),
        }
        self.store(list)
    }

    /// Removes a user.
    pub fn remove(&mut self, name: &str) -> Result<(), UserError> {
        let mut list = self.list.clone();
        list.retain(|user| !is_same(&user.name, name));
        match list.len() == self.list.len() {
            true => Err(UserError::Unknown(name.to_owned())),
            false => self.store(list),
        }
    }

    fn store(&mut self, users: Vec<User>) -> Result<(), UserError> {
        let (format, version) = (FORMAT.0.to_owned(), FORMAT.1);
        let written = UsersFile {
            format,
            version,
            users,
        };
        let text = serde_json::to_vec_pretty(&written).map_err(io::Error::from)?;
        secret::write_closed(&self.file, &text)?;
        self.list = written.users;
        Ok(())
    }
}

/// Reads the content of a users' file.
///
/// # Errors
/// In words: what no file of this program has.
pub fn parsed(bytes: Vec<u8>) -> Result<Vec<User>, String> {
    let read: Result<UsersFile, _> = serde_json::from_slice(&bytes);
    let UsersFile {
        format,
        version,
        users,
    } = read.map_err(|error| error.to_string())?;
    if (&*format, version) != FORMAT {
        let words = format!("it is {format:?} of version {version}, this program reads version 1");
        return Err(words);
    }
    if users.len() > MOST_USERS {
        return Err(format!("it has more than {MOST_USERS} users"));
    }
    for (at, user) in users.iter().enumerate() {
        check_name(&user.name)?;
        if !secret::is_usual(&user.hash) {
            return Err(format!("the hash of user {} cannot be used", user.name));
        }
        if users[..at]
            .iter()
            .any(|other| is_same(&other.name, &user.name))
        {
            return Err(format!("it has user {} twice", user.name));
        }
        if user.pin && user.role > Role::Operator {
            return Err(format!(
                "user {} has a PIN, which only operators may",
                user.name
            ));
        }
    }
    Ok(users)
}

/// Checks the name of a user.
///
/// # Errors
/// In words, with the remedy.
pub(super) fn check_name(name: &str) -> Result<(), String> {
    let allowed = |c: char| c.is_alphanumeric() || ".-_".contains(c);
    // Browsers take names of dots alone for steps in a path.
    let dots = name.chars().all(|c| c == '.');
    if dots || name.chars().count() > LONGEST_NAME || !name.chars().all(allowed) {
        return Err(format!(
            "a user's name has 1 to {LONGEST_NAME} letters, digits, \".\", \"-\" or \"_\": choose another"
        ));
    }
    match is_same(name, ENGINEER) {
        true => Err(format!(
            "{ENGINEER} is the user of the device's secret, which cannot be changed or removed here: choose another name"
        )),
        false => Ok(()),
    }
}

/// Checks a password or PIN for a role; answers whether it is a PIN.
///
/// # Errors
/// In words, with the remedy.
pub(super) fn check_password(password: &str, role: Role) -> Result<bool, String> {
    let length = password.chars().count();
    if password.len() > LONGEST {
        return Err(format!(
            "a password has at most {LONGEST} bytes: choose a shorter one"
        ));
    }
    if length >= SHORTEST {
        return Ok(false);
    }
    let digits = password.bytes().all(|byte| byte.is_ascii_digit());
    match role <= Role::Operator && digits && length >= SHORTEST_PIN {
        true => Ok(true),
        false => Err(format!(
            "a password has {SHORTEST} characters or more, of an operator also {SHORTEST_PIN} digits or more as a PIN: choose a longer one"
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn user(name: &str, role: Role) -> User {
        User {
            name: name.into(),
            role,
            hash: secret::OF_NOBODY.into(),
            pin: false,
            since_utc_us: Some(1),
            by: ENGINEER.into(),
        }
    }

    #[test]
    fn users_outlive_a_restart_and_a_name_is_one_whatever_its_case() {
        let folder = tempfile::tempdir().unwrap();
        let (mut users, _) = Users::open(folder.path());
        users.put(user("Müller", Role::Operator)).unwrap();
        users.put(user("MÜLLER", Role::Technician)).unwrap();
        let (users, complaint) = Users::open(folder.path());
        assert_eq!((users.list().len(), complaint), (1, None));
        assert_eq!(users.find("müller").unwrap().role, Role::Technician);
        let mut users = users;
        assert!(matches!(users.remove("anna"), Err(UserError::Unknown(_))));
        users.remove("müller").unwrap();
        assert_eq!(Users::open(folder.path()).0.list(), []);
    }

    #[test]
    fn the_most_users_are_bounded() {
        let folder = tempfile::tempdir().unwrap();
        let (mut users, _) = Users::open(folder.path());
        for number in 0..MOST_USERS {
            users
                .put(user(&format!("u{number}"), Role::Viewer))
                .unwrap();
        }
        let refused = users.put(user("more", Role::Viewer)).unwrap_err();
        assert!(
            refused.to_string().contains("remove one first"),
            "{refused}"
        );
        users.put(user("u3", Role::Engineer)).unwrap();
    }

    #[test]
    fn a_file_with_what_no_program_wrote_is_put_aside_and_lets_nobody_in() {
        let folder = tempfile::tempdir().unwrap();
        let (mut users, _) = Users::open(folder.path());
        users.put(user("anna", Role::Operator)).unwrap();
        let file = folder.path().join(FILE);
        let good = std::fs::read_to_string(&file).unwrap();
        for (from, to) in [
            ("operator", "admin"),
            ("anna", "Engineer"),
            ("anna", "an na"),
            ("m=19456", "m=9999999"),
            ("fringed-users", "users"),
            ("\"version\": 1", "\"version\": 2"),
            ("\"pin\": false", "\"pin\": false, \"more\": 1"),
        ] {
            let damaged = good.replace(from, to);
            assert_ne!(damaged, good);
            std::fs::write(&file, &damaged).unwrap();
            let (users, complaint) = Users::open(folder.path());
            assert!(users.list().is_empty(), "{to}");
            assert!(complaint.unwrap().contains("put aside"), "{to}");
            let kept = folder.path().join("users.json.damaged");
            assert_eq!(std::fs::read_to_string(kept).unwrap(), damaged);
        }
    }

    #[test]
    fn passwords_are_long_and_only_those_who_trigger_have_a_pin() {
        for (password, role, found) in [
            ("correct horse", Role::Engineer, Some(false)),
            ("123456", Role::Operator, Some(true)),
            ("123456", Role::Technician, None),
            ("12345", Role::Operator, None),
            ("12345a", Role::Operator, None),
            ("äöüäöüäöüäöü", Role::Technician, Some(false)),
            (&"x".repeat(LONGEST + 1), Role::Operator, None),
        ] {
            assert_eq!(check_password(password, role).ok(), found, "{password}");
        }
    }
}
