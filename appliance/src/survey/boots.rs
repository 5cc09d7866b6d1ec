//! How often the daemon was started with a state folder, and how often it had not been stopped before.

use crate::output::folder::write_whole;
use std::fs;
use std::io;
use std::path::Path;

/// The file: starts, unclean starts, and whether a daemon runs, e.g. `12 1 running`.
const FILE: &str = "boots";
const RUNNING: &str = "running";

/// The counts, this start included.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Boots {
    /// Starts.
    pub starts: u32,
    /// Starts after an end without a stop.
    pub unclean: u32,
    /// Whether the daemon runs: still so in the file after it was killed.
    pub running: bool,
}

impl Boots {
    /// The counts with this start. A damaged file starts anew: they are for people, nothing is decided by them.
    pub fn begin(folder: &Path) -> Self {
        let text = fs::read_to_string(folder.join(FILE)).unwrap_or_default();
        let mut words = text.split_whitespace();
        let mut count = || words.next().and_then(|word| word.parse().ok()).unwrap_or(0);
        let (starts, unclean): (u32, u32) = (count(), count());
        let killed = words.next() == Some(RUNNING);
        Self {
            starts: starts.saturating_add(1),
            unclean: unclean.saturating_add(u32::from(killed)),
            running: true,
        }
    }

    /// Stores the counts.
    ///
    /// # Errors
    /// Whatever the file system answers.
    pub fn store(&self, folder: &Path) -> io::Result<()> {
        let state = if self.running { RUNNING } else { "stopped" };
        let text = format!("{} {} {state}\n", self.starts, self.unclean);
        write_whole(&folder.join(FILE), text.as_bytes())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_start_after_a_kill_is_counted_as_unclean_and_one_after_a_stop_is_not() {
        let folder = tempfile::tempdir().unwrap();
        let start = || {
            let boots = Boots::begin(folder.path());
            boots.store(folder.path()).unwrap();
            boots
        };
        assert_eq!((start().starts, start().unclean), (1, 1));
        let mut third = start();
        assert_eq!((third.starts, third.unclean), (3, 2));
        third.running = false;
        third.store(folder.path()).unwrap();
        assert_eq!(
            (start().starts, Boots::begin(folder.path()).unclean),
            (4, 3)
        );
        fs::write(folder.path().join(FILE), "x y z").unwrap();
        assert_eq!((start().starts, start().starts), (1, 2));
    }
}
