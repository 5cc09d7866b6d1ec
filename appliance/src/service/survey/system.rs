//! Load, memory and storage as the kernel reports them; `None` where it does not.

use std::fs;
use std::path::Path;

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

#[cfg(test)]
mod tests {
    use super::*;

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
