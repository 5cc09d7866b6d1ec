//! The survey: load, memory, storage, temperature, power, versions, stored recipes and Modbus
//! clients, once a second.
//!
//! It has its own thread, so that a storage that hangs delays neither sockets nor measuring.

use crate::modbus::Clients;
use crate::recipe::Store;
use crate::station::{Event, Power, StationHandle, System};
use crate::storage::folder::{read_whole, write_whole};
use crate::system::host::{Host, major_minor};
use crate::system::progress::Progress;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::Duration;
use std::{fs, io};

/// The file with the counts of starts: starts, unclean starts, the daemon's condition, and starts
/// after it hung, e.g. `12 1 running 0`.
const FILE: &str = "boots";

/// Longest file, bytes.
const MAX_BYTES: u64 = 4096;

/// The daemon's condition. If it ends without a stop, the file keeps the last one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum RunState {
    /// It was stopped.
    #[default]
    Stopped,
    /// It runs.
    Running,
    /// It runs, but its measuring task has missed its deadlines for so long that a watchdog will
    /// end it.
    Hanging,
}

impl RunState {
    const ALL: [Self; 3] = [Self::Stopped, Self::Running, Self::Hanging];

    fn word(self) -> &'static str {
        match self {
            Self::Stopped => "stopped",
            Self::Running => "running",
            Self::Hanging => "hanging",
        }
    }
}

/// The counts of the daemon's starts with a state folder, this one included, and of those that
/// followed an end without a stop.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Boots {
    /// Starts.
    pub starts: u32,
    /// Starts after an end without a stop.
    pub unclean: u32,
    /// Unclean starts after a daemon that hung, usually ended by a watchdog.
    pub after_hanging: u32,
    /// The current condition.
    pub condition: RunState,
}

impl Boots {
    /// The counts including this start. They begin at zero if the file is damaged: no decision
    /// depends on them.
    pub fn begin(folder: &Path) -> Self {
        let text = read_whole(&folder.join(FILE), MAX_BYTES).unwrap_or_default();
        let text = String::from_utf8(text).unwrap_or_default();
        let mut words = text.split_whitespace();
        let number = |word: Option<&str>| word.and_then(|word| word.parse().ok()).unwrap_or(0_u32);
        let (starts, unclean) = (number(words.next()), number(words.next()));
        let left = words.next().unwrap_or_default();
        let condition = RunState::ALL.into_iter().find(|known| known.word() == left);
        let condition = condition.unwrap_or_default();
        let more = |happened: bool| u32::from(happened);
        Self {
            starts: starts.saturating_add(1),
            unclean: unclean.saturating_add(more(condition != RunState::Stopped)),
            after_hanging: number(words.next())
                .saturating_add(more(condition == RunState::Hanging)),
            condition: RunState::Running,
        }
    }

    /// Stores the counts.
    ///
    /// # Errors
    /// Errors of the file system.
    pub fn store(&self, folder: &Path) -> io::Result<()> {
        let Self {
            starts,
            unclean,
            after_hanging,
            condition,
        } = self;
        let text = format!("{starts} {unclean} {} {after_hanging}\n", condition.word());
        write_whole(&folder.join(FILE), text.as_bytes())
    }
}

const MIB: u64 = 1 << 20;

/// The load of all processors between two readings.
#[derive(Debug, Default)]
pub struct Processors {
    /// Busy and total time at the last reading, in ticks.
    before: Option<(u64, u64)>,
}

impl Processors {
    /// Load since the last reading, %; `None` at the first one.
    pub fn load_percent(&mut self) -> Option<u8> {
        let now = busy_and_whole(&fs::read_to_string("/proc/stat").ok()?)?;
        let (busy, whole) = self.before.replace(now)?;
        let whole = now.1.checked_sub(whole).filter(|&ticks| ticks > 0)?;
        let percent = 100 * now.0.saturating_sub(busy) / whole;
        u8::try_from(percent.min(100)).ok()
    }
}

/// Busy and total ticks of all processors: proc_stat(5), first line.
fn busy_and_whole(stat: &str) -> Option<(u64, u64)> {
    let line = stat.lines().next()?.strip_prefix("cpu ")?;
    // user nice system idle iowait irq softirq steal; the fields after them are contained in the
    // first two.
    let ticks: Vec<u64> = line
        .split_whitespace()
        .take(8)
        .map_while(|word| word.parse().ok())
        .collect();
    let idle = ticks.get(3)?.checked_add(*ticks.get(4)?)?;
    let whole = ticks.iter().try_fold(0_u64, |sum, &t| sum.checked_add(t))?;
    Some((whole.checked_sub(idle)?, whole))
}

/// Memory that a program could get without swapping, MiB.
pub fn free_memory_mib() -> Option<u64> {
    available(&fs::read_to_string("/proc/meminfo").ok()?)
}

/// MemAvailable of proc_meminfo(5), kB → MiB.
fn available(meminfo: &str) -> Option<u64> {
    let line = meminfo
        .lines()
        .find_map(|line| line.strip_prefix("MemAvailable:"))?;
    let kilobytes: u64 = line.split_whitespace().next()?.parse().ok()?;
    Some(kilobytes / 1024)
}

/// Free storage for this user in the file system of a folder, MiB.
pub fn free_storage_mib(folder: &Path) -> Option<u64> {
    let storage = rustix::fs::statvfs(folder).ok()?;
    Some(storage.f_bavail.checked_mul(storage.f_frsize)? / MIB)
}

/// Time between two surveys.
const PERIOD: Duration = Duration::from_secs(1);
/// A measuring task that missed its deadlines in this many surveys in a row hangs. Opening a lost
/// head again takes less time, so that it does not cause writes to the card.
const HANGING: u32 = 10;

/// What is surveyed.
pub struct Survey {
    folder: PathBuf,
    boots: Boots,
    recipes: Store,
    clients: Clients,
    progress: Progress,
}

impl Survey {
    /// A survey of the state folder, the recipes in it and the clients; counts this start.
    pub fn new(folder: &Path, recipes: Store, clients: Clients, progress: Progress) -> Self {
        let boots = Boots::begin(folder);
        let survey = Self {
            folder: folder.to_path_buf(),
            boots,
            recipes,
            clients,
            progress,
        };
        survey.store_boots();
        survey
    }

    /// Sends a survey to the station once a second until `stopped` receives a message or is closed;
    /// then counts a clean end.
    pub fn run(mut self, station: &StationHandle, stopped: &Receiver<()>) {
        let mut processors = Processors::default();
        let mut late = 0_u32;
        let host = Host::default();
        let version = |text: Option<String>| major_minor(&text?);
        let kernel = version(host.kernel());
        let mut power: Option<Power> = None;
        loop {
            power = host.throttled().map(|bits| Power::of(bits, power));
            let (clients, writer_connected) = self.clients.open();
            let after = station.event(Event::Surveyed(System {
                cpu_percent: processors.load_percent(),
                free_memory_mib: free_memory_mib(),
                free_storage_mib: free_storage_mib(&self.folder),
                cpu_temperature_c: host.temperature_c(),
                power,
                kernel,
                libcamera: version(host.libcamera()),
                boots: self.boots.starts,
                unclean_boots: self.boots.unclean,
                watchdog_restarts: self.boots.after_hanging,
                clients,
                writer_connected,
                recipes: Arc::from(self.recipes.numbers()),
            }));
            late = match after.worker_alive {
                true => 0,
                false => late.saturating_add(1),
            };
            let condition = match late {
                HANGING.. => RunState::Hanging,
                _ => RunState::Running,
            };
            if condition != self.boots.condition {
                self.boots.condition = condition;
                self.store_boots();
            }
            match stopped.recv_timeout(PERIOD) {
                Err(RecvTimeoutError::Timeout) => {}
                Ok(()) | Err(RecvTimeoutError::Disconnected) => break,
            }
        }
        self.boots.condition = RunState::Stopped;
        self.store_boots();
    }

    fn store_boots(&self) {
        if let Err(error) = self.boots.store(&self.folder) {
            self.progress
                .log(&format!("store the number of starts: {error}: free space"));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    fn start(folder: &Path) -> Boots {
        let boots = Boots::begin(folder);
        boots.store(folder).unwrap();
        boots
    }

    fn end(boots: Boots, condition: RunState, folder: &Path) {
        Boots { condition, ..boots }.store(folder).unwrap();
    }

    #[test]
    fn a_start_after_a_kill_is_counted_as_unclean_and_one_after_a_stop_is_not() {
        let folder = tempfile::tempdir().unwrap();
        let start = || start(folder.path());
        assert_eq!((start().starts, start().unclean), (1, 1));
        let third = start();
        assert_eq!((third.starts, third.unclean), (3, 2));
        end(third, RunState::Stopped, folder.path());
        assert_eq!(
            (start().starts, Boots::begin(folder.path()).unclean),
            (4, 3)
        );
        fs::write(folder.path().join(FILE), "x y z").unwrap();
        assert_eq!((start().starts, start().starts), (1, 2));
    }

    #[test]
    fn a_start_after_the_end_of_a_daemon_that_hung_is_one_of_a_watchdog() {
        let folder = tempfile::tempdir().unwrap();
        let start = || start(folder.path());
        end(start(), RunState::Hanging, folder.path());
        let second = start();
        assert_eq!((second.unclean, second.after_hanging), (1, 1));
        // Killed while all was well.
        let third = start();
        assert_eq!((third.unclean, third.after_hanging), (2, 1));
        // As the program before this one wrote it.
        fs::write(folder.path().join(FILE), "12 3 running\n").unwrap();
        let next = start();
        assert_eq!((next.starts, next.unclean, next.after_hanging), (13, 4, 0));
    }

    #[test]
    fn the_kernels_words_are_understood_and_nonsense_is_not_known() {
        let stat = "cpu  100 10 40 800 50 0 0 0 7 0\ncpu0 1 1 1\n";
        assert_eq!(busy_and_whole(stat), Some((150, 1000)));
        assert_eq!(busy_and_whole("cpu  1 2\n"), None);
        assert_eq!(busy_and_whole(""), None);
        let meminfo = "MemTotal: 9 kB\nMemAvailable:    2048000 kB\n";
        assert_eq!(available(meminfo), Some(2000));
        assert_eq!(available("MemAvailable: lots\n"), None);
    }

    #[test]
    fn a_folder_has_room_and_one_that_is_not_there_is_not_known() {
        assert!(free_storage_mib(&std::env::temp_dir()).is_some());
        assert_eq!(free_storage_mib(Path::new("no/such/folder")), None);
    }
}
