//! The machine on which times are measured, and how fast its processor and its memory are.

use super::effort::Effort;
use super::median::median;
use appliance::system::computing::timed;
use rand_xoshiro::SplitMix64;
use rand_xoshiro::rand_core::{Rng, SeedableRng};
use std::fs;
use std::hint::black_box;
use std::time::Duration;

/// The machine in words and numbers.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Machine {
    /// The processor's model, or its architecture if the system does not name it.
    pub processor: String,
    /// Cores that this program may use.
    pub cores: usize,
    /// Architecture, `x86_64` or `aarch64`.
    pub architecture: &'static str,
    /// Clock of the processor under load, measured with one thread.
    pub clock_ghz: f64,
    /// Time of a read whose address is the result of the one before, from memory that is in no
    /// cache.
    pub memory_latency_ns: f64,
    /// Bytes that a copy moves per ns, each of which is read once and written once.
    pub copy_gb_per_s: f64,
}

impl Machine {
    /// This machine, measured on as much memory and as often as the effort says.
    pub fn this(effort: &Effort) -> Self {
        let cpuinfo = fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
        let board = fs::read_to_string("/proc/device-tree/model").unwrap_or_default();
        let board = board.trim_end_matches('\0').trim();
        let processor = if board.is_empty() {
            model(&cpuinfo).unwrap_or(std::env::consts::ARCH)
        } else {
            board
        };
        let median_of = |measured: &mut dyn FnMut() -> f64| {
            median((0..effort.rounds).map(|_| measured()).collect())
        };
        let lines = cycle(effort.bytes.div_ceil(size_of::<Line>()).max(64));
        let mut at = 0;
        let mut copy = vec![Line(1); lines.len() / 2];
        Self {
            processor: processor.to_owned(),
            cores: std::thread::available_parallelism().map_or(1, usize::from),
            architecture: std::env::consts::ARCH,
            clock_ghz: median_of(&mut clock_ghz),
            memory_latency_ns: median_of(&mut || latency_ns(&lines, &mut at)),
            copy_gb_per_s: median_of(&mut || copy_gb_per_s(&mut copy, &lines)),
        }
    }
}

/// A line of a cache: the number of another one.
#[derive(Clone, Copy)]
#[repr(align(64))]
struct Line(usize);

/// Lines in which each names the next one of a cycle through all of them in random order (S.
/// Sattolo, "An algorithm to generate a random cyclic permutation", Information Processing Letters
/// 22, 1986).
fn cycle(count: usize) -> Vec<Line> {
    let mut lines: Vec<Line> = (0..count).map(Line).collect();
    let mut random = SplitMix64::seed_from_u64(0);
    for at in (1..count).rev() {
        lines.swap(at, random.next_u64() as usize % at);
    }
    lines
}

/// Reads that are timed at once.
const READS: usize = 200_000;

/// Time of a read that waits for the one before. It goes on where the last call ended, at lines
/// that were not read yet.
fn latency_ns(lines: &[Line], at: &mut usize) -> f64 {
    let reads = READS.min(lines.len());
    let taken = timed(|| {
        for _ in 0..reads {
            *at = lines[*at].0;
        }
    });
    ns(taken) / reads as f64
}

/// Rate at which `to` is overwritten with the first of `from`.
fn copy_gb_per_s(to: &mut [Line], from: &[Line]) -> f64 {
    let taken = timed(|| {
        to.copy_from_slice(&from[..to.len()]);
        black_box(&to);
    });
    size_of_val(to) as f64 / ns(taken)
}

/// Rounds of the chain of instructions from which the clock is taken.
const CHAIN: u32 = 4_000_000;

/// Clock from a chain of additions and exclusive ors, each of which takes the result of the one
/// before and so a whole cycle.
fn clock_ghz() -> f64 {
    let (mut x, plus, xor) = black_box((0_u64, 3_u64, 5_u64));
    let taken = timed(|| {
        for _ in 0..CHAIN {
            x = x.wrapping_add(plus) ^ xor;
        }
        black_box(x);
    });
    2.0 * f64::from(CHAIN) / ns(taken)
}

/// At least 1, so that rates are finite.
fn ns(taken: Duration) -> f64 {
    (taken.as_secs_f64() * 1e9).max(1.0)
}

/// The processor's name in `/proc/cpuinfo`; on ARM only the board has one.
fn model(cpuinfo: &str) -> Option<&str> {
    let line = cpuinfo
        .lines()
        .find(|line| line.starts_with("model name"))?;
    line.split(':').nth(1).map(str::trim)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_processors_name_is_found() {
        let cpuinfo = "processor\t: 0\nmodel name\t: Some CPU @ 2 GHz\nflags\t: a b\n";
        assert_eq!(model(cpuinfo), Some("Some CPU @ 2 GHz"));
        assert_eq!(model("processor : 0\nBogoMIPS : 108"), None);
        let machine = Machine::this(&Effort::QUICK);
        assert!(machine.cores > 0);
        for figure in [
            machine.clock_ghz,
            machine.memory_latency_ns,
            machine.copy_gb_per_s,
        ] {
            assert!(figure > 0.0, "{machine:?}");
        }
    }

    #[test]
    fn a_walk_over_the_lines_reads_every_one_once() {
        let lines = cycle(100);
        let (mut at, mut seen) = (0, [false; 100]);
        for _ in 0..100 {
            at = lines[at].0;
            assert!(!std::mem::replace(&mut seen[at], true));
        }
        assert_eq!(at, 0);
    }
}
