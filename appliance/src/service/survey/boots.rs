//! Counts of the daemon's starts with a state folder, and of those that followed an end without a
//! stop.

use crate::storage::folder::{read_whole, write_whole};
use std::io;
use std::path::Path;

/// The file: starts, unclean starts, the daemon's condition, and starts after it hung, e.g. `12 1
/// running 0`.
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

/// The counts, this start included.
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
}
