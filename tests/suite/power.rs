//! Losses of power: after every file operation of a run the files are opened as a power loss may
//! leave them, with the unsynced data complete, missing, or partly there.

use crate::station_plc::{Daemon, Place, Plc, READY, command, long};
use crate::written::FRINGED;
use appliance::access::{Access, ChangeRecord};
use appliance::history::{self, Bounds, Filter, Numbering, OpenedHistory, Reader};
use appliance::recipe::Store;
use appliance::recipe::file::archive;
use appliance::storage::state::{Counted, StateFolder};
use hal::replay::Recording;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Instant, SystemTime, UNIX_EPOCH};
use tests::files;
use tests::power::Operation;
use tests::power::disk::Disk;
use tests::power::losses::losses;
use tests::power::trace::{OPTIONS, operations};
use tests::small_head::tiny_head;
use tests::until::{PATIENCE, until};

/// Largest count of result numbers that a loss of power may skip.
const SKIPPED: u32 = 64;

/// The part lies outside its tolerance: none passes, and the frames of every part are kept.
const MOVED: &str = "[placement]\nshift_mm = [0.0, 0.0, 4.0]\n";
/// Number of such parts; the first recordings are removed to make space for the last.
const KEPT: usize = 20;

/// What a client or a user was told.
enum Told {
    /// A result with this SEQ.
    Shown(u32),
    /// A recipe with this number and fingerprint is stored.
    Stored(u16, String),
    /// The recipe with this number is deleted.
    Deleted(u16),
}

/// A recorded run: the operations on its files, and what its clients were told.
struct Run {
    place: Place,
    operations: Vec<Operation>,
    told: Vec<(u64, Told)>,
}

/// µs since 1970.
pub(crate) fn now() -> u64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap();
    u64::try_from(since.as_micros()).unwrap()
}

/// Whether programs can be traced here; prints a message if not.
pub(crate) fn can_trace() -> bool {
    let tried = Command::new("strace")
        .args(["-o", "/dev/null", "true"])
        .output();
    let can = tried.is_ok_and(|output| output.status.success());
    if !can {
        println!("SKIPPED: strace is not there or may not trace (Debian package strace)");
    }
    can
}

/// A command under strace.
pub(crate) fn traced(log: &Path, plain: &Command) -> Command {
    let mut traced = Command::new("strace");
    traced.args(OPTIONS).arg("-o").arg(log);
    traced.arg(plain.get_program()).args(plain.get_args());
    traced.stdin(std::process::Stdio::null());
    traced.stdout(std::process::Stdio::null());
    traced
}

impl Run {
    /// A command under strace.
    fn traced(&self, number: usize, plain: &Command) -> Command {
        traced(&self.log(number), plain)
    }

    fn log(&self, number: usize) -> PathBuf {
        self.place.path(&format!("trace-{number}"))
    }

    /// Runs a command that changes recipes.
    fn recipe(&mut self, number: usize, arguments: &[&str], told: Told) {
        let mut plain = Command::new(FRINGED);
        plain
            .arg("recipe")
            .args(arguments)
            .arg("--config")
            .arg(self.place.path("fringed.toml"));
        assert!(self.traced(number, &plain).status().unwrap().success());
        self.told.push((now(), told));
    }

    /// Starts the station and measures parts one after the other until it is `enough`.
    fn measure(&mut self, number: usize, mut enough: impl FnMut(&Self) -> bool) -> Daemon {
        let daemon = Daemon::of(self.traced(number, &command(&self.place)));
        let mut plc = Plc::connect(&daemon);
        plc.wait("READY", |status| status.has(READY));
        let started = Instant::now();
        for token in 1.. {
            let seq = long(&plc.measure(token), 0);
            self.told.push((now(), Told::Shown(seq)));
            if enough(self) {
                break;
            }
            assert!(started.elapsed() < PATIENCE, "{seq} results are not enough");
        }
        daemon
    }

    /// Records a run that teaches, measures good parts, imports and deletes recipes, measures parts
    /// that are kept, and is killed.
    fn recorded() -> Self {
        let place = Place::new();
        // Few pixels, as this test is about files.
        let head = tiny_head(48, 36);
        fs::write(place.path("small.toml"), &head).unwrap();
        let config =
            "state = \"state\"\n[head]\nscenario = \"small.toml\"\n[history]\nrecordings_mib = 1\n";
        fs::write(place.path("fringed.toml"), config).unwrap();
        let mut run = Self {
            place,
            operations: Vec::new(),
            told: Vec::new(),
        };
        let daemon = run.measure(0, |run| run.told.len() == 3);
        let taught = fs::read(run.place.recipe()).unwrap();
        let (taught, arrays) = files::recipe(&taught);
        run.told
            .push((now(), Told::Stored(1, taught.fingerprint.clone())));
        assert!(daemon.terminate().success());
        for (log, number, name) in [(1, 2, "second"), (2, 1, "first"), (3, 1, "first again")] {
            let mut file = taught.clone();
            (file.number, file.name) = (number, name.into());
            file.part_number = format!("P-{number}");
            let (bytes, fingerprint) = archive::pack(&file, &arrays).unwrap();
            let path = run.place.path(&format!("{log}.recipe"));
            fs::write(&path, bytes).unwrap();
            run.recipe(
                log,
                &["import", "--replace", path.to_str().unwrap()],
                Told::Stored(number, fingerprint),
            );
        }
        run.recipe(4, &["delete", "2"], Told::Deleted(2));
        fs::write(run.place.path("small.toml"), format!("{head}{MOVED}")).unwrap();
        let mut kept = BTreeSet::new();
        let daemon = run.measure(5, |run| {
            let names = files::names(&run.place.path("state/recordings"));
            kept.extend(names.into_iter().filter(|name| !name.starts_with('.')));
            kept.len() >= KEPT
        });
        let left = files::names(&run.place.path("state/recordings")).len();
        assert!(left < KEPT, "none of {left} recordings was removed");
        daemon.kill();
        let root = run.place.path("");
        for log in 0..=5 {
            let log = whole_log(&run.log(log));
            run.operations.extend(operations(&log, &root));
        }
        run
    }
}

/// Reads a log to its end, which the tracer writes after the end of the program.
pub(crate) fn whole_log(path: &Path) -> String {
    until("end of the trace", PATIENCE, || {
        let log = fs::read_to_string(path).unwrap_or_default();
        let mut lines = log.lines();
        // The program's main thread is traced first and ends last.
        let own = lines.next().and_then(|line| line.split_whitespace().next());
        let ended =
            lines.any(|line| line.contains(" +++ ") && line.split_whitespace().next() == own);
        ended.then_some(log).ok_or(())
    })
}

/// What must hold after a loss of power at `time`.
struct Promise {
    /// The last result that was shown.
    shown: u32,
    /// The first result that was shown afterwards, or would have been.
    next: u32,
    /// Fingerprints of the stored recipes, and of the next version if it was being stored.
    recipes: BTreeMap<u16, Vec<Option<String>>>,
    /// How many changes of recipes by the command line were answered "done".
    changes: u32,
    /// Whether the device was in use before.
    begun: bool,
}

impl Promise {
    fn at(run: &Run, time: u64) -> Self {
        let mut promise = Self {
            shown: 0,
            next: u32::MAX,
            recipes: BTreeMap::new(),
            changes: 0,
            begun: false,
        };
        for (when, told) in &run.told {
            let before = *when <= time;
            promise.begun |= before;
            let (number, fingerprint) = match told {
                Told::Shown(seq) => {
                    if before {
                        promise.shown = promise.shown.max(*seq);
                    } else {
                        promise.next = promise.next.min(*seq);
                    }
                    continue;
                }
                Told::Stored(number, fingerprint) => (*number, Some(fingerprint.clone())),
                Told::Deleted(number) => (*number, None),
            };
            let possible = promise.recipes.entry(number).or_insert_with(|| vec![None]);
            if before {
                possible.clear();
                promise.changes += 1;
            }
            possible.push(fingerprint);
        }
        promise.next = promise.next.min(promise.shown + 1);
        // The station taught the first one by itself.
        promise.changes = promise.changes.saturating_sub(1);
        promise
    }

    /// Opens the remaining files as the daemon does, and compares.
    fn check(&self, state: &Path) -> Result<usize, String> {
        if !state.exists() {
            return if self.begun {
                Err("everything is gone".into())
            } else {
                Ok(0)
            };
        }
        let words = |error: &dyn std::fmt::Display| error.to_string();
        let folder = StateFolder::open(state).map_err(|error| words(&error))?;
        let record = ChangeRecord::of(state, 16 << 20);
        self.check_record(&record)?;
        let opened = Access::open(&state.join("access"), None, record);
        let made = opened.map_err(|error| words(&error))?.made;
        if self.begun && made.is_some() {
            return Err("the secret is gone".into());
        }
        self.check_recipes(&folder)?;
        for name in files::names(&state.join("recordings")) {
            if !name.starts_with('.') {
                let opened = Recording::open(&state.join("recordings").join(&name));
                opened.map_err(|error| format!("recording {name}: {error}"))?;
            }
        }
        // What the power left is a copy here, but was none on the card.
        let counted = folder.counted().map(|counted| Counted {
            copied: false,
            ..counted
        });
        let numbering = Numbering {
            counted,
            counter: folder.counter(),
            serial: folder.serial().map_err(|error| words(&error))?,
            run: 7,
            utc_s: None,
        };
        forget(&numbering.serial);
        let serial = numbering.serial.clone();
        let bounds = Bounds {
            results: 1000,
            recordings: 1 << 30,
            good_every: 0,
        };
        let opened = history::open(state, numbering, bounds);
        let OpenedHistory {
            history,
            task,
            next_seq: next,
            complaint,
            ..
        } = opened.map_err(|error| words(&error))?;
        if let Some(complaint) = complaint {
            return Err(complaint);
        }
        let stored = results(state)?;
        drop((history, task));
        forget(&serial);
        if next <= self.shown {
            return Err(format!("{next} comes next, {} was shown", self.shown));
        }
        // The number of the running cycle was used; the reserved ones after it are skipped.
        if next > self.next + 1 + SKIPPED {
            return Err(format!("{next} comes next, {} was the last", self.shown));
        }
        let in_order = stored.iter().zip(1..).all(|(seq, place)| *seq == place);
        if !in_order || stored.len() > self.next as usize {
            return Err(format!(
                "results {stored:?} are stored, {} was shown",
                self.shown
            ));
        }
        Ok(stored.len())
    }

    fn check_record(&self, record: &ChangeRecord) -> Result<(), String> {
        let report = record.check().map_err(|error| error.to_string())?;
        match report.problems.is_empty() && report.lines >= self.changes {
            true => Ok(()),
            false => Err(format!(
                "{} changes were done, the record: {report:?}",
                self.changes
            )),
        }
    }

    fn check_recipes(&self, folder: &StateFolder) -> Result<(), String> {
        let recipes = Store::of_state(folder).map_err(|failure| failure.to_string())?;
        for (&number, possible) in &self.recipes {
            let found = match recipes.load(number) {
                Ok(loaded) => {
                    if let Some(fallback) = loaded
                        .fallback
                        .filter(|_| possible.iter().all(Option::is_some))
                    {
                        return Err(fallback);
                    }
                    Some(loaded.recipe.id.fingerprint)
                }
                Err(_) => None,
            };
            if !possible.contains(&found) {
                return Err(format!(
                    "recipe {number} is {found:?}, expected one of {possible:?}"
                ));
            }
        }
        Ok(())
    }
}

/// Removes the shared memory of a station, as a loss of power does.
pub(crate) fn forget(serial: &str) {
    for name in files::names(Path::new("/dev/shm")) {
        if name.starts_with("fringed-") && name.contains(serial) {
            let _ = fs::remove_file(Path::new("/dev/shm").join(name));
        }
    }
}

/// The stored results, oldest first.
fn results(state: &Path) -> Result<Vec<u32>, String> {
    let all = Filter {
        limit: usize::MAX,
        ..Filter::default()
    };
    let found = Reader::of(state)
        .results(&all)
        .map_err(|error| error.to_string())?;
    Ok(found.iter().rev().map(|entry| entry.seq).collect())
}

/// Loses power after every `step`-th operation of a run.
fn lose(run: &Run, step: usize) {
    let mut certain = 0;
    losses(Disk::default(), &run.operations, step, |loss, folder| {
        let stored = Promise::at(run, loss.time).check(&folder.join("state"))?;
        if stored < certain {
            return Err(format!("{stored} results, {certain} were certain before"));
        }
        if loss.leaves_nothing {
            certain = stored;
        }
        Ok(())
    });
}

#[test]
fn a_loss_of_power_at_some_operations_leaves_what_was_promised() {
    if can_trace() {
        let run = Run::recorded();
        lose(&run, run.operations.len() / 30);
    }
}

#[test]
#[ignore = "minutes: `.ci/run full` does it"]
fn a_loss_of_power_at_any_operation_leaves_what_was_promised() {
    assert!(can_trace(), "strace must be there");
    lose(&Run::recorded(), 1);
}
