//! Losses of power while a backup comes back: after each file operation from the upload to the end of
//! the undo, the state that is left is the old one or the new one.

use super::{backup, entered, measured, ordered, place, started};
use crate::history::recording;
use crate::power::{can_trace, forget, now, traced, whole_log};
use crate::station_plc::{Daemon, command};
use appliance::access::ChangeRecord;
use appliance::backup::Backups;
use appliance::history::Reader;
use appliance::recipe::Store;
use appliance::storage::state::StateFolder;
use serde_json::json;
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use tests::files;
use tests::power::Operation;
use tests::power::disk::Disk;
use tests::power::losses::losses;
use tests::power::trace::operations;

/// What is exchanged, file by file, and the results.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Exchanged {
    files: BTreeMap<String, String>,
    results: u64,
}

/// A request, from when it was sent to when it was answered, µs since 1970.
type Request = (u64, u64);

/// A run of uploading, ordering, restoring and taking back.
struct Run {
    /// The folder before.
    before: Disk,
    operations: Vec<Operation>,
    restore: Request,
    undo: Request,
    old: Exchanged,
    new: Exchanged,
}

impl Exchanged {
    fn of(state: &Path) -> Self {
        let mut found = BTreeMap::new();
        for name in [
            "recipes",
            "recordings",
            "access/users.json",
            "calibration",
            "studies",
        ] {
            hashes(&state.join(name), name, &mut found);
        }
        let results = Reader::of(state).holding().map_or(0, |held| held.results);
        Self {
            files: found,
            results,
        }
    }

    /// In which files two states differ, and the results of both.
    fn differs(&self, other: &Self) -> (Vec<String>, [u64; 2]) {
        let names = self.files.keys().chain(other.files.keys());
        let differ = names.filter(|&name| self.files.get(name) != other.files.get(name));
        (differ.cloned().collect(), [self.results, other.results])
    }
}

fn hashes(path: &Path, name: &str, found: &mut BTreeMap<String, String>) {
    if path.is_dir() {
        for inside in files::names(path) {
            hashes(&path.join(&inside), &format!("{name}/{inside}"), found);
        }
    } else if let Ok(bytes) = fs::read(path)
        && !name.ends_with("/lock")
    {
        found.insert(name.to_owned(), files::sha256(&bytes));
    }
}

impl Run {
    fn recorded() -> Self {
        let place = place();
        let state = place.path("state");
        let (daemon, mut browser) = started(&place);
        recording(&place, measured(&mut browser) as u32);
        let body = json!({ "role": "operator", "secret": "135790" });
        assert_eq!(browser.json("PUT", "/api/users/anna", &body).0, 200);
        let zip = backup(&mut browser, "?users=true&recordings=true");
        let fingerprint = browser.get("/api/recipes/1")["fingerprint"].clone();
        let edit = json!({ "fingerprint": fingerprint, "name": "later" });
        assert_eq!(browser.json("PUT", "/api/recipes/1", &edit).0, 200);
        assert_eq!(browser.json("DELETE", "/api/users/anna", &json!({})).0, 200);
        browser.ready();
        recording(&place, measured(&mut browser) as u32);
        assert!(daemon.terminate().success());
        let old = Exchanged::of(&state);
        let root = place.path("");
        let before = Disk::holding(&root).unwrap();
        let start = |number: usize| {
            let daemon = Daemon::of(traced(
                &place.path(&format!("trace-{number}")),
                &command(&place),
            ));
            entered(&place, daemon)
        };
        let (daemon, mut browser) = start(0);
        let sent = now();
        let everything = json!({ "what": "everything", "users": true });
        ordered(&mut browser, &zip, &everything);
        let restore = (sent, now());
        assert!(daemon.terminate().success());
        let (daemon, mut browser) = start(1);
        let new = Exchanged::of(&state);
        let sent = now();
        let (status, answer) = browser.json("POST", "/api/restore/undo", &json!({}));
        assert_eq!(status, 200, "{answer}");
        let undo = (sent, now());
        assert!(daemon.terminate().success());
        let (daemon, _) = start(2);
        assert_eq!(Exchanged::of(&state), old);
        assert!(daemon.terminate().success());
        assert!(new.files != old.files && (old.results, new.results) == (2, 1));
        let traced = |number| {
            let log = whole_log(&place.path(&format!("trace-{number}")));
            operations(&log, &root)
        };
        Self {
            operations: (0..3).flat_map(traced).collect(),
            before,
            restore,
            undo,
            old,
            new,
        }
    }

    /// Which states may be left by a loss of power at this time.
    fn possible(&self, time: u64) -> Vec<&Exchanged> {
        let (old, new) = (&self.old, &self.new);
        let answered = |(sent, answered): Request| (time >= sent, time >= answered);
        match (answered(self.restore), answered(self.undo)) {
            ((false, _), _) => vec![old],
            ((true, false), _) => vec![old, new],
            (_, (false, _)) => vec![new],
            (_, (true, false)) => vec![new, old],
            (_, (true, true)) => vec![old],
        }
    }

    /// Starts with what a loss of power left, as the daemon does, and compares.
    fn check(&self, state: &Path, time: u64) -> Result<(), String> {
        let words = |error: &dyn std::fmt::Display| error.to_string();
        let folder = StateFolder::open(state).map_err(|error| words(&error))?;
        let serial = folder.serial().map_err(|error| words(&error))?;
        forget(&serial);
        let record = ChangeRecord::of(state, 16 << 20);
        let restored = Backups::of(state).carry_out(&folder, &record, None);
        forget(&serial);
        restored.map_err(|error| words(&error))?;
        let report = record.check().map_err(|error| words(&error))?;
        if !report.problems.is_empty() {
            return Err(format!("{report:?}"));
        }
        let found = Exchanged::of(state);
        let possible = self.possible(time);
        if !possible.contains(&&found) {
            let differ: Vec<_> = possible.iter().map(|state| found.differs(state)).collect();
            return Err(format!(
                "the state is none of those that may be left: {differ:?}"
            ));
        }
        let loaded = Store::at(&state.join("recipes")).load(1);
        let fallback = loaded.map_err(|error| words(&error))?.fallback;
        if let Some(fallback) = fallback {
            return Err(fallback);
        }
        let counted = folder.counted().map_err(|error| words(&error))?;
        match counted.last < 2 {
            true => Err(format!("{} was the last number", counted.last)),
            false => Ok(()),
        }
    }
}

#[test]
fn a_loss_of_power_at_any_operation_leaves_the_old_state_or_the_new_one() {
    if can_trace() {
        let mut run = Run::recorded();
        let before = std::mem::take(&mut run.before);
        let count = losses(before, &run.operations, 1, |loss, folder| {
            run.check(&folder.join("state"), loss.time)
        });
        assert!(count > 1000);
    }
}
