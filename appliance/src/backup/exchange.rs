//! Orders a restore, and carries it out at the next start, before anything of the state is used.
//!
//! What comes back was checked and lies in `staged`. Each folder or file of the state is moved to
//! `before`, and that of `staged` takes its place: renames only, which need no room. The order's file
//! says which ones; as long as it is there the next start goes on where a kill or a loss of power
//! stopped this one, so that the state is the old one or the new one. Its last rename, to `done.json`,
//! ends it. Taking the restore back is the same with what lies in `before`.
//!
//! Numbers of results are not exchanged: they go on behind all that either state has used. Nor is the
//! record of changes, which says who ordered the restore.

use super::checking::CheckedBackup;
use super::{
    Backups, CALIBRATION, DATABASE, OF_HEAD, RECIPES, RECORDINGS, RestorePart, STUDIES, USERS,
};
use crate::access::{Change, ChangeRecord, Way};
use crate::error::{Exit, Failure, Result};
use crate::history::{Reader, carry, is_after};
use crate::storage::folder::{read_whole, remove, rename_whole, sync_folder_of, write_whole};
use crate::storage::state::{Counted, SERIAL, StateFolder, random};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::fmt::Display;
use std::fs;
use std::io::{self, ErrorKind};
use std::path::Path;

/// Files in the folder.
const CHECKED: &str = "checked.json";
const ORDER: &str = "order.json";
const DONE: &str = "done.json";
/// Longest of them: a plan of 9999 recipes.
const MOST_BYTES: u64 = 16 << 20;
/// How the names of folders and files begin that a kill leaves behind.
const LEFT_BEHIND: [&str; 2] = ["making-", "arriving-"];

/// What waits for a choice.
#[derive(Debug, Serialize, Deserialize)]
struct CheckedFile {
    serial: String,
    history: Option<String>,
    plan: Value,
}

/// A folder or file that is exchanged.
#[derive(Debug, Serialize, Deserialize)]
struct ExchangedItem {
    name: String,
    /// Whether something takes its place.
    comes: bool,
}

/// A restore that is ordered or done.
#[derive(Debug, Serialize, Deserialize)]
struct RestoreOrder {
    what: RestorePart,
    by: String,
    at_unix_ms: Option<u64>,
    items: Vec<ExchangedItem>,
    /// The id of the history that comes back.
    history: Option<String>,
    /// Whether serial and results of another device are taken over.
    replaces: bool,
    /// Whether the exchange has begun.
    begun: bool,
}

/// What a person chose.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RestoreChoice {
    /// What comes back.
    pub what: RestorePart,
    /// With everything: also the users.
    #[serde(default)]
    pub users: bool,
    /// With everything of another device: this one takes its serial and its results.
    #[serde(default)]
    pub replaces_device: bool,
}

/// A choice that cannot be ordered.
#[derive(Debug, thiserror::Error)]
pub enum OrderError {
    /// Nothing was checked, or there is nothing to take back.
    #[error("{0}")]
    Nothing(&'static str),
    /// Why not, with the remedy.
    #[error("{0}")]
    Refused(String),
    /// It cannot be written.
    #[error("store the order: {0}: free space")]
    Store(#[from] io::Error),
}

impl Backups {
    /// Keeps what was checked with its plan, for a choice.
    ///
    /// # Errors
    /// Whatever the file system answers.
    pub fn offer(&self, checked: &CheckedBackup, plan: Value) -> io::Result<()> {
        let file = CheckedFile {
            serial: checked.manifest.serial.clone(),
            history: checked.history.as_ref().map(|history| history.id.clone()),
            plan,
        };
        self.write(CHECKED, &file)
    }

    /// What was checked, what is ordered, and which state before is kept.
    pub fn shown(&self) -> Value {
        let order: Option<RestoreOrder> = self.read(ORDER);
        let checked: Option<CheckedFile> = self.read(CHECKED);
        let done: Option<RestoreOrder> = self.read(DONE).filter(|_| self.before().exists());
        json!({
            "checked": checked.filter(|_| order.is_none()).map(|checked| checked.plan),
            "ordered": order.map(|order| json!({ "what": order.what, "by": order.by })),
            "before": done.map(|done| json!({
                "what": done.what, "by": done.by, "at_unix_ms": done.at_unix_ms,
            })),
        })
    }

    /// Orders what a person chose.
    ///
    /// # Errors
    /// [`OrderError`]
    pub fn order(
        &self,
        choice: &RestoreChoice,
        serial: &str,
        by: &str,
    ) -> std::result::Result<(), OrderError> {
        let checked: Option<CheckedFile> = self.read(CHECKED);
        let checked = checked.ok_or(OrderError::Nothing(
            "no backup was checked: send one to POST /api/restore first",
        ))?;
        let choices = checked.plan["choices"].as_array().into_iter().flatten();
        let chosen = choices
            .into_iter()
            .find(|row| row["what"] == choice.what.word())
            .ok_or_else(|| {
                OrderError::Refused("choose everything, recipes or calibration".into())
            })?;
        if let Some(refused) = chosen["refused"].as_str() {
            return Err(OrderError::Refused(refused.to_owned()));
        }
        let is_same = checked.serial == serial;
        let replaces = choice.replaces_device && !is_same;
        let all = choice.what == RestorePart::Everything;
        if choice.replaces_device && (is_same || !all) {
            let words = "replaces_device belongs to everything of another device: leave it out";
            return Err(OrderError::Refused(words.into()));
        }
        let staged = self.staged();
        if choice.users && !(all && staged.join(USERS).is_file()) {
            let words = "the backup has no users, or not everything comes back: leave users out";
            return Err(OrderError::Refused(words.into()));
        }
        let mut names = Vec::new();
        // A backup that was made before the head was calibrated takes no calibration away.
        if choice.what != RestorePart::Recipes && staged.join(CALIBRATION).exists() {
            names.extend(OF_HEAD);
        }
        if choice.what != RestorePart::Calibration {
            names.push(RECIPES);
        }
        // Results belong to the device that has them.
        let results = all && (is_same || replaces) && checked.history.is_some();
        if results {
            names.extend(DATABASE.into_iter().chain([STUDIES]));
            // Recordings are known by the numbers of their results: those of this device stay beside
            // its older results.
            if replaces || staged.join(RECORDINGS).exists() {
                names.push(RECORDINGS);
            }
        }
        if choice.users {
            names.push(USERS);
        }
        if replaces {
            write_whole(
                &staged.join(SERIAL),
                format!("{}\n", checked.serial).as_bytes(),
            )?;
            names.push(SERIAL);
        }
        self.write_order(
            choice.what,
            by,
            &staged,
            &names,
            (checked.history.filter(|_| results), replaces),
        )
    }

    /// Orders the state before the last restore to come back.
    ///
    /// # Errors
    /// [`OrderError`]
    pub fn order_undo(&self, by: &str) -> std::result::Result<(), OrderError> {
        let before = self.before();
        let done: Option<RestoreOrder> = self.read(DONE).filter(|_| before.exists());
        let done = done.ok_or(OrderError::Nothing("no state before a restore is kept"))?;
        self.forget()?;
        let names: Vec<&str> = done.items.iter().map(|item| &*item.name).collect();
        let history = carry::check(&before.join(DATABASE[0])).ok();
        let history = history.map(|history| history.id);
        self.write_order(RestorePart::Undo, by, &before, &names, (history, false))
    }

    fn write_order(
        &self,
        what: RestorePart,
        by: &str,
        from: &Path,
        names: &[&str],
        (history, replaces): (Option<String>, bool),
    ) -> std::result::Result<(), OrderError> {
        let items = names.iter().map(|name| ExchangedItem {
            name: (*name).to_owned(),
            comes: from.join(name).exists(),
        });
        let order = RestoreOrder {
            what,
            by: by.to_owned(),
            at_unix_ms: crate::system::clock::utc_us().map(|us| us / 1000),
            items: items.collect(),
            history,
            replaces,
            begun: false,
        };
        Ok(self.write(ORDER, &order)?)
    }

    /// Drops what was checked and what is ordered.
    ///
    /// # Errors
    /// Whatever the file system answers.
    pub fn forget(&self) -> io::Result<()> {
        // The order first: without it nothing of the rest is used.
        for name in [ORDER, CHECKED] {
            remove(&self.path(name))?;
        }
        remove_all(&self.staged())
    }

    /// Carries out what is ordered, and removes what a kill left behind. Answers with what was done,
    /// in words.
    ///
    /// # Errors
    /// The state could not be exchanged (73): the next start tries again. Before that the old state
    /// stands, whole, and the order is dropped.
    pub fn carry_out(
        &self,
        state: &StateFolder,
        record: &ChangeRecord,
        utc_s: Option<u64>,
    ) -> Result<Option<String>> {
        let order: Option<RestoreOrder> = self.read(ORDER);
        let Some(mut order) = order else {
            self.clean();
            return Ok(None);
        };
        let failed = |error: io::Error| {
            let what = format!("restore {}", self.state.display());
            let words = format!("{error}: it goes on with the next start, free space");
            Failure::because(Exit::CannotCreate, what, words)
        };
        if !order.begun
            && let Err(words) = self.begin(state, &mut order, record, utc_s)
        {
            let staged = self.staged();
            if order.what == RestorePart::Undo && staged.exists() {
                remove_all(&self.before()).map_err(failed)?;
                rename_whole(&staged, &self.before()).map_err(failed)?;
            }
            self.forget().map_err(failed)?;
            return Ok(Some(format!(
                "the restore ({}) was not carried out, and the state is as it was: {words}",
                order.what.word()
            )));
        }
        for item in &order.items {
            self.exchange(item).map_err(failed)?;
        }
        rename_whole(&self.path(ORDER), &self.path(DONE)).map_err(failed)?;
        self.clean();
        Ok(Some(format!(
            "restored: {}, as {} ordered; the state before is kept",
            order.what.word(),
            order.by
        )))
    }

    /// Everything that a full storage could refuse; behind it there are only renames.
    fn begin(
        &self,
        state: &StateFolder,
        order: &mut RestoreOrder,
        record: &ChangeRecord,
        utc_s: Option<u64>,
    ) -> std::result::Result<(), String> {
        let words = |error: &dyn Display| {
            format!("{error}: see that the storage is sound and has room, and order it again")
        };
        let prepared = self.prepare(state, order, utc_s);
        prepared.map_err(|error| words(&error))?;
        let begun = || {
            for item in &order.items {
                let goes = self.before().join(&item.name);
                goes.parent().map_or(Ok(()), fs::create_dir_all)?;
            }
            // A start that goes on after a loss of power finds them.
            rustix::fs::syncfs(fs::File::open(self.folder())?)?;
            record.add(&Change {
                way: Way::Page,
                from: "at the start".into(),
                changed: Some(format!("ordered by {}", order.by)),
                ..Change::of_command("restore", order.what.word().into())
            })
        };
        begun().map_err(|error| words(&error))?;
        order.begun = true;
        self.write(ORDER, order).map_err(|error| words(&error))
    }

    /// Sees to the place of the state before, and to numbers and id of the history. Repeated after a
    /// kill it changes nothing more.
    fn prepare(
        &self,
        state: &StateFolder,
        order: &RestoreOrder,
        utc_s: Option<u64>,
    ) -> std::result::Result<(), String> {
        let words = |error: io::Error| error.to_string();
        let (staged, before) = (self.staged(), self.before());
        match order.what == RestorePart::Undo {
            // What lay in `before` takes the way of a backup.
            true if !staged.exists() => rename_whole(&before, &staged).map_err(words)?,
            true => {}
            false => remove_all(&before).map_err(words)?,
        }
        let comes = staged.join(DATABASE[0]);
        let (Some(id), true) = (&order.history, comes.exists()) else {
            return Ok(());
        };
        let (present, last) = carry::drain(state).map_err(|error| error.to_string())?;
        let holding = Reader::of(&staged).holding();
        let holding = holding.map_err(|error| error.to_string())?;
        let present_last = present.and_then(|present| present.last);
        let lost =
            present_last.is_some_and(|last| holding.last.is_none_or(|own| is_after(last, own)));
        if lost || order.replaces {
            carry::renew(&comes, id).map_err(|error| error.to_string())?;
        }
        let backed_up = Counted::in_folder(&staged).ok().map(|counted| counted.last);
        let last = [last].into_iter().chain(holding.last).chain(backed_up);
        let run = random().map_err(|error| error.to_string())?;
        carry::go_on_behind(state, last, order.replaces, (run, utc_s)).map_err(words)
    }

    /// Exchanges one item; done already, it changes nothing.
    fn exchange(&self, item: &ExchangedItem) -> io::Result<()> {
        let present = self.state.join(&item.name);
        let (comes, goes) = (
            self.staged().join(&item.name),
            self.before().join(&item.name),
        );
        if item.comes && !comes.exists() {
            return Ok(());
        }
        if present.exists() {
            fs::rename(&present, &goes)?;
            sync_folder_of(&goes)?;
        }
        if item.comes {
            fs::rename(&comes, &present)?;
        }
        sync_folder_of(&present)
    }

    /// Removes what nothing is ordered of, and what a kill left behind.
    fn clean(&self) {
        // What cannot be removed only takes room.
        let _ = self.forget();
        for entry in fs::read_dir(self.folder()).into_iter().flatten().flatten() {
            let name = entry.file_name();
            let name = name.to_string_lossy();
            if LEFT_BEHIND.iter().any(|begin| name.starts_with(begin)) {
                let _ = remove_all(&entry.path());
            }
        }
    }

    fn read<T: serde::de::DeserializeOwned>(&self, name: &str) -> Option<T> {
        let bytes = read_whole(&self.path(name), MOST_BYTES).ok()?;
        serde_json::from_slice(&bytes).ok()
    }

    fn write(&self, name: &str, content: &impl Serialize) -> io::Result<()> {
        fs::create_dir_all(self.folder())?;
        write_whole(&self.path(name), &serde_json::to_vec(content)?)
    }
}

/// Removes a folder or a file, if it is there.
fn remove_all(path: &Path) -> io::Result<()> {
    let removed = match fs::symlink_metadata(path) {
        Ok(found) if found.is_dir() => fs::remove_dir_all(path),
        _ => fs::remove_file(path),
    };
    match removed {
        Err(error) if error.kind() != ErrorKind::NotFound => Err(error),
        _ => Ok(()),
    }
}
