//! The device's secret: configured, or made at the first start and stored as an argon2id hash. The
//! hashes of passwords and PINs are made and compared here as well.

use crate::error::{Exit, Result};
use crate::storage::folder::{read_whole, write_whole_with};
use argon2::Argon2;
use argon2::password_hash::phc::{self, PasswordHash};
use argon2::password_hash::{self, PasswordHasher, PasswordVerifier};
use std::io::{self, ErrorKind, Write as _};
use std::os::unix::fs::PermissionsExt as _;
use std::path::Path;

/// Digits of the secret: Crockford's base 32, without I, L, O and U, so that nothing is misread.
const DIGITS: &[u8; 32] = b"0123456789ABCDEFGHJKMNPQRSTVWXYZ";
/// 4 groups of 5 digits of 5 bits each: 100 bits, far beyond guessing.
const LENGTH: usize = 20;
const GROUP: usize = 5;
/// Longest text that is hashed; a secret is shorter.
const LONGEST: usize = 64;
/// Longest file with a hash, bytes.
const MOST: u64 = 4096;
/// Letters and digits of the shortest secret that may be given: 60 bits where they are random.
const SHORTEST: usize = 12;

/// The hash of the secret in this file, which holds it in plain text or as an argon2id hash; none
/// if there is no such file.
///
/// # Errors
/// It cannot be read or used (78).
pub(super) fn given(file: &Path) -> Result<Option<String>> {
    let wrong = Exit::Configuration;
    let text = match std::fs::read_to_string(file) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
        read => read.map_err(wrong.because("read the secret that was given"))?,
    };
    let text = text.trim();
    if text.starts_with('$') {
        return match PasswordHash::new(text) {
            Ok(_) => Ok(Some(text.to_owned())),
            Err(error) => wrong.fail(format!(
                "the secret that was given begins with $ but is not a hash ({error}): give a new one"
            )),
        };
    }
    if plain(text).len() < SHORTEST || text.len() > LONGEST {
        return wrong.fail(format!(
            "the secret that was given must have {SHORTEST} letters and digits at least and {LONGEST} characters at most: give a new one"
        ));
    }
    hash(text).map(Some).map_err(wrong.failure())
}

/// A secret that was made, and is to be shown.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NewSecret {
    /// The secret.
    pub secret: String,
    /// What was wrong with the stored hash of the previous secret, if there was one.
    pub complaint: Option<String>,
}

/// The stored hash; without one that can be used, a new secret with its hash.
///
/// # Errors
/// None can be made or stored (73).
pub(super) fn open(file: &Path) -> Result<(String, Option<NewSecret>)> {
    let complaint = match read(file) {
        Ok(Some(hash)) => return Ok((hash, None)),
        Ok(None) => None,
        Err(problem) => {
            // Where it cannot be renamed it is replaced.
            let _ = std::fs::rename(file, file.with_extension("damaged"));
            let file = file.display();
            Some(format!(
                "read {file}: {problem}: it is put aside as secret.damaged, and the device has a new secret"
            ))
        }
    };
    let unmade = Exit::CannotCreate;
    let secret = make().map_err(unmade.failure())?;
    let hash = hash(&secret).map_err(unmade.failure())?;
    write_closed(file, format!("{hash}\n").as_bytes())
        .map_err(unmade.advising("write secret", "free space"))?;
    Ok((hash, Some(NewSecret { secret, complaint })))
}

/// The stored hash, if there is one.
fn read(file: &Path) -> Result<Option<String>> {
    let bytes = match read_whole(file, MOST) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
        read => read.map_err(Exit::Content.failure())?,
    };
    let Ok(text) = String::from_utf8(bytes) else {
        return Exit::Content.fail("it is not text");
    };
    let hash = text.trim();
    match PasswordHash::new(hash) {
        Ok(_) => Ok(Some(hash.to_owned())),
        Err(error) => Exit::Content.fail(format!("it is damaged ({error})")),
    }
}

/// Whether a text is the secret; dashes, spaces and the case of letters do not matter.
///
/// # Errors
/// If the stored hash cannot be read.
pub(super) fn is_right(typed: &str, stored: &str) -> Result<bool, phc::Error> {
    match typed.len() > LONGEST {
        true => Ok(false),
        false => is_password(&plain(typed), stored),
    }
}

/// Whether a text is the password or PIN with this hash, every character as it was typed.
///
/// # Errors
/// If the stored hash cannot be read.
pub(super) fn is_password(typed: &str, stored: &str) -> Result<bool, phc::Error> {
    let stored = PasswordHash::new(stored)?;
    let verified = Argon2::default().verify_password(typed.as_bytes(), &stored);
    Ok(verified.is_ok())
}

/// How the hashes begin that this program makes: argon2id, 19 MiB, 2 passes, as OWASP recommends.
const USUAL: &str = "$argon2id$v=19$m=19456,t=2,p=1$";

/// A hash of nothing that anybody knows: a name that does not exist takes as long as one that does.
pub(super) const OF_NOBODY: &str = "$argon2id$v=19$m=19456,t=2,p=1$hlBHoGKyB5RfsWs5ltyb4A$+p6WXw2SJXcsBeWlqZyVJmsCyZ2Cm5kURAC/2XwQ1ug";

/// Whether a hash that comes from elsewhere may be used: one with other parameters could take all
/// memory with each guess.
pub(super) fn is_usual(hash: &str) -> bool {
    hash.starts_with(USUAL) && PasswordHash::new(hash).is_ok()
}

fn make() -> Result<String, getrandom::Error> {
    let mut random = [0_u8; LENGTH];
    getrandom::fill(&mut random)?;
    // 256 is a multiple of 32: every digit is equally likely.
    let digits: Vec<char> = random
        .iter()
        .map(|byte| char::from(DIGITS[usize::from(byte % 32)]))
        .collect();
    let groups: Vec<String> = digits.chunks(GROUP).map(String::from_iter).collect();
    Ok(groups.join("-"))
}

fn hash(secret: &str) -> Result<String, password_hash::Error> {
    hash_password(&plain(secret))
}

/// The hash of a password or PIN.
///
/// # Errors
/// If the system gives no random bits.
pub(super) fn hash_password(password: &str) -> Result<String, password_hash::Error> {
    let hash = Argon2::default().hash_password(password.as_bytes());
    hash.map(|hash| hash.to_string())
}

/// The form that is hashed: only letters and digits, in capitals, with the letters that Crockford's
/// digits leave out replaced by the digits that they look like.
fn plain(typed: &str) -> String {
    let kept = typed.chars().filter(char::is_ascii_alphanumeric);
    kept.map(|digit| match digit.to_ascii_uppercase() {
        'O' => '0',
        'I' | 'L' => '1',
        digit => digit,
    })
    .collect()
}

/// Writes a file whole that only this user may read.
///
/// # Errors
/// Whatever the file system answers; then the old file stands.
pub(super) fn write_closed(file: &Path, bytes: &[u8]) -> io::Result<()> {
    write_whole_with(file, |new| {
        new.set_permissions(std::fs::Permissions::from_mode(0o600))?;
        new.write_all(bytes)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_secret_survives_how_people_type_and_nothing_else_opens() {
        let stored = hash("0123A-BCDEF-GHJKM-NPQR1").unwrap();
        for typed in ["0123A-BCDEF-GHJKM-NPQR1", " o123abcdef ghjkmnpqrI"] {
            assert!(is_right(typed, &stored).unwrap(), "{typed}");
        }
        for typed in ["", "0123A-BCDEF-GHJKM-NPQR2", "0123A", &"0".repeat(1000)] {
            assert!(!is_right(typed, &stored).unwrap(), "{typed}");
        }
    }

    #[test]
    fn a_secret_is_given_as_such_or_as_its_hash_and_a_weak_or_broken_one_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("given");
        assert_eq!(given(&file).unwrap(), None);
        let hashed = hash("0123A-BCDEF-GHJKM").unwrap();
        for text in ["0123a-bcdef-ghjkm\n", hashed.as_str()] {
            std::fs::write(&file, text).unwrap();
            let stored = given(&file).unwrap().unwrap();
            assert!(is_right("0123A BCDEF GHJKM", &stored).unwrap(), "{text}");
            assert!(!is_right(&hashed, &stored).unwrap(), "{text}");
        }
        for text in [
            "",
            "0123A-BCDEF",
            "-------------",
            "$argon2id$broken",
            &"0".repeat(65),
        ] {
            std::fs::write(&file, text).unwrap();
            let refused = given(&file).unwrap_err().to_string();
            assert!(refused.contains("give a new one"), "{text}: {refused}");
        }
    }

    #[test]
    fn hashes_have_the_usual_parameters_and_others_are_not_used() {
        let made = hash_password("correct horse battery").unwrap();
        assert!(is_usual(&made) && is_usual(OF_NOBODY));
        assert!(is_password("correct horse battery", &made).unwrap());
        assert!(!is_password("Correct horse battery", &made).unwrap());
        let greedy = made.replace("m=19456", "m=4194304");
        assert!(
            !is_usual(&greedy) && !is_usual("$argon2id$v=19$m=19456,t=2,p=1$") && !is_usual("")
        );
    }

    #[test]
    fn secrets_have_a_hundred_bits_in_groups_that_can_be_read_out() {
        let secret = make().unwrap();
        assert_eq!(secret.len(), LENGTH + 3);
        assert!(secret.split('-').all(|group| group.len() == GROUP));
        assert_ne!(secret, make().unwrap());
    }
}
