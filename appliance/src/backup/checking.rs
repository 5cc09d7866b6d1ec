//! Checks a backup as a whole before anything of a device is touched: the ZIP's directory, the
//! manifest, the names, the bytes of every member, then their formats by the code that will read them.

use super::{
    Backups, CALIBRATION, CONFIGURATION, COUNTER, DATABASE, FORMAT, LONGEST_SERIAL, MANIFEST,
    Manifest, RECORDINGS, STUDIES, USERS, making,
};
use crate::access::record::FILES;
use crate::access::users;
use crate::head::calibration::place::CalibrationPlace;
use crate::head::commission::Commissioning;
use crate::history::carry::{self, Holding};
use crate::history::studies::Studies;
use crate::storage::archive::Members;
use crate::storage::folder::{check_room, read_whole};
use std::fs::{self, File};
use std::io::{self, ErrorKind, Read, Seek};
use std::path::Path;

/// The most members that are read, as many as a ZIP without 64-bit sizes has.
const MOST: usize = 65_535;
/// Largest manifest, bytes.
const MOST_MANIFEST: u64 = 32 << 20;
/// Longest path of a member, folders and name.
const MOST_PARTS: usize = 6;
/// Longest name of a file.
const LONGEST_NAME: usize = 255;

/// A backup that was checked.
#[derive(Clone, Debug)]
pub struct CheckedBackup {
    /// Its manifest.
    pub manifest: Manifest,
    /// What its history holds.
    pub history: Option<Holding>,
    /// Its users.
    pub users: Option<Vec<crate::access::User>>,
}

impl Backups {
    /// Unpacks and checks a backup beside the state, in place of one that was checked before.
    ///
    /// # Errors
    /// As [`check`]. Then the one before is gone as well, and the state untouched.
    pub fn check(&self, archive: &Path) -> io::Result<CheckedBackup> {
        self.forget()?;
        let checked = check(File::open(archive)?, &self.staged());
        if checked.is_err() {
            self.forget()?;
        }
        checked
    }
}

/// Unpacks a backup into a folder that does not exist, and checks it.
///
/// # Errors
/// What is wrong with it, or whatever the file system answers.
pub fn check(archive: File, into: &Path) -> io::Result<CheckedBackup> {
    let size = archive.metadata()?.len();
    let mut members = Members::open(archive, MOST).map_err(wrong)?;
    let manifest = manifest(&mut members).map_err(wrong)?;
    fs::create_dir_all(into)?;
    let folder = File::open(into)?;
    check_room(&folder, size).map_err(|error| within("there is no room to unpack it", &error))?;
    for member in &manifest.members {
        let name = &member.name;
        let unpacked = unpack(&mut members, name, into);
        let (bytes, sha256) =
            unpacked.map_err(|error| within(&format!("member {name}"), &error))?;
        if (bytes, &sha256) != (member.bytes, &member.sha256) {
            return Err(wrong(format!(
                "member {name} is not what the manifest says: it was damaged or changed"
            )));
        }
    }
    let checked = formats(manifest, into).map_err(wrong)?;
    // Nothing of it may be missing after a loss of power.
    rustix::fs::syncfs(&folder)?;
    Ok(checked)
}

fn wrong(words: impl ToString) -> io::Error {
    io::Error::new(ErrorKind::InvalidData, words.to_string())
}

/// The same error, with where it was met.
fn within(place: &str, error: &io::Error) -> io::Error {
    io::Error::new(error.kind(), format!("{place}: {error}"))
}

/// Reads the manifest, and checks that it names every member of the ZIP and no other, each once.
fn manifest<R: Read + Seek>(members: &mut Members<R>) -> Result<Manifest, String> {
    if members.has_others() {
        return Err("it has links or folders, which no backup has".into());
    }
    let text = members
        .content(MANIFEST, MOST_MANIFEST)
        .map_err(|error| format!("it is no backup: {MANIFEST}: {error}"))?;
    let read: Result<Manifest, _> = serde_json::from_slice(&text);
    let manifest = read.map_err(|error| {
        let error = crate::error::shortened(&error.to_string());
        format!("it is no backup of this program: {MANIFEST}: {error}")
    })?;
    let Manifest {
        format, version, ..
    } = &manifest;
    if format != FORMAT.0 {
        return Err(format!("it is no backup: its format is {format:?}"));
    }
    if *version != FORMAT.1 {
        let other = if *version > FORMAT.1 {
            "newer"
        } else {
            "older"
        };
        return Err(format!(
            "it is of version {version}, made by {} {other} program ({}): this one reads version {}",
            if other == "older" { "an" } else { "a" },
            manifest.made_by,
            FORMAT.1
        ));
    }
    let serial = &manifest.serial;
    let plain = |c: char| c.is_ascii_alphanumeric() || c == '-';
    if serial.is_empty() || serial.len() > LONGEST_SERIAL || !serial.chars().all(plain) {
        return Err(format!("{serial:?} is no serial of a device"));
    }
    let mut named: Vec<&str> = manifest
        .members
        .iter()
        .map(|member| &*member.name)
        .collect();
    if let Some(strange) = named.iter().find(|name| !is_known(name)) {
        return Err(format!("no backup has a member {strange:?}"));
    }
    named.push(MANIFEST);
    named.sort_unstable();
    if let Some(twice) = named.windows(2).find(|pair| pair[0] == pair[1]) {
        return Err(format!("the manifest names {} twice", twice[0]));
    }
    if !members.names().eq(named) {
        return Err("its members are not those that the manifest names".into());
    }
    Ok(manifest)
}

/// Whether a backup may have a member of this name, which is its place in the state folder.
fn is_known(name: &str) -> bool {
    let allowed = |c: char| c.is_ascii_alphanumeric() || "-_.".contains(c);
    // No "..", nothing hidden, no absolute path.
    let plain = |part: &&str| {
        (1..=LONGEST_NAME).contains(&part.len())
            && !part.starts_with('.')
            && part.chars().all(allowed)
    };
    let parts: Vec<&str> = name.split('/').collect();
    parts.len() <= MOST_PARTS
        && parts.iter().all(plain)
        && match parts[..] {
            [name] => [
                CONFIGURATION,
                COUNTER,
                DATABASE[0],
                "commissioning.json",
                "drift.json",
            ]
            .contains(&name),
            ["access", file] => name == USERS || FILES.contains(&file),
            ["recipes", file] => is_recipe(file),
            ["calibration" | "commissioning", _] => true,
            [STUDIES, file] => file.ends_with(".json"),
            [RECORDINGS, _, _, ..] => true,
            _ => false,
        }
}

fn is_recipe(file: &str) -> bool {
    let number = file.split_once(".recipe").filter(|(number, ending)| {
        number.len() == 4 && ["", ".previous", ".kept"].contains(ending)
    });
    number.is_some_and(|(number, _)| number.bytes().all(|byte| byte.is_ascii_digit()))
}

fn unpack<R: Read + Seek>(
    members: &mut Members<R>,
    name: &str,
    into: &Path,
) -> io::Result<(u64, String)> {
    let target = into.join(name);
    target.parent().map_or(Ok(()), fs::create_dir_all)?;
    let mut file = File::create_new(target)?;
    making::copy(&mut members.member(name)?, &mut file)
}

/// Reads what was unpacked by the code that would read it in its place. Recipes are named one by one
/// in the plan.
fn formats(manifest: Manifest, folder: &Path) -> Result<CheckedBackup, String> {
    let has = |name: &str| folder.join(name).is_file();
    let history = match has(DATABASE[0]) {
        true => Some(carry::check(&folder.join(DATABASE[0])).map_err(|error| error.to_string())?),
        false => None,
    };
    let users = match has(USERS) {
        true => {
            let read = read_whole(&folder.join(USERS), users::MOST_BYTES);
            let read = read.map_err(|error| error.to_string());
            let users = read.and_then(users::parsed);
            Some(users.map_err(|error| format!("member {USERS}: {error}"))?)
        }
        false => None,
    };
    let calibration = CalibrationPlace::at(&folder.join(CALIBRATION)).load();
    let loaded = calibration.map_err(|error| format!("its calibration: {error}"))?;
    if let Some(loaded) = loaded {
        let maps = loaded.file.maps();
        let missing = maps.iter().find(|map| !has(&format!("calibration/{map}")));
        if let Some(missing) = missing {
            return Err(format!("its calibration names {missing}, which it lacks"));
        }
    }
    Commissioning::load(folder).map_err(|error| error.to_string())?;
    let studies = Studies::of(folder);
    for number in studies.numbers() {
        let read = studies.read(number);
        read.map_err(|error| error.to_string())?;
    }
    Ok(CheckedBackup {
        manifest,
        history,
        users,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_names_that_a_backup_has_are_known() {
        for known in [
            "history.db",
            "recipes/0007.recipe",
            "recipes/0007.recipe.kept",
            "calibration/reference_vertical-0123.npy",
            "recordings/12-3-fail/frames/000.png",
            "access/users.json",
            "studies/4.json",
        ] {
            assert!(is_known(known), "{known}");
        }
        for strange in [
            "",
            "/history.db",
            "../history.db",
            "recipes/../history.db",
            "recipes/7.recipe",
            "recipes/0007.recipe.new",
            "recipes/0007.recipe/x",
            "access/secret",
            "access/users.json/x",
            "serial",
            "lock",
            "recordings/x",
            "recordings/.x/y",
            "recordings//y",
            "restore/order.json",
            "history.db-wal",
            "calibration\\x",
            "calibration/\u{e4}",
        ] {
            assert!(!is_known(strange), "{strange}");
        }
    }
}
