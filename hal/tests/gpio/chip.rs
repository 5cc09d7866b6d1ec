//! A GPIO chip that the kernel simulates, and the kernel's record of how its lines were set.

use hal::gpio::Start;
use hal::setup::{LinesSetup, TriggerSetup};
use hal::units::Timestamp;
use std::fs;
use std::path::{Path, PathBuf};

/// Debounce time in these tests: longer than a change of a simulated line takes.
pub const QUIET_MS: u32 = 5;

/// A chip that the kernel simulates.
pub struct Chip {
    pub label: &'static str,
    folder: PathBuf,
    lines: PathBuf,
    width: usize,
}

impl Chip {
    pub fn new(label: &'static str, names: &[&str]) -> Self {
        let folder = PathBuf::from("/sys/kernel/config/gpio-sim").join(label);
        let bank = folder.join("bank0");
        fs::create_dir(&folder).unwrap();
        fs::create_dir(&bank).unwrap();
        fs::write(bank.join("num_lines"), names.len().to_string()).unwrap();
        fs::write(bank.join("label"), label).unwrap();
        for (at, name) in names.iter().enumerate() {
            let line = bank.join(format!("line{at}"));
            fs::create_dir(&line).unwrap();
            fs::write(line.join("name"), name).unwrap();
        }
        fs::write(folder.join("live"), "1").unwrap();
        let word = |path: PathBuf| fs::read_to_string(path).unwrap().trim().to_owned();
        let device = word(folder.join("dev_name"));
        let chip = word(bank.join("chip_name"));
        Self {
            label,
            lines: PathBuf::from("/sys/devices/platform")
                .join(device)
                .join(chip),
            folder,
            width: names.len(),
        }
    }

    /// The level on the wire.
    pub fn level(&self, line: usize) -> bool {
        let value = self.lines.join(format!("sim_gpio{line}/value"));
        fs::read_to_string(value).unwrap().trim() == "1"
    }

    /// Pulls the wire to a level, as a switch or a resistor would.
    pub fn pull(&self, line: usize, high: bool) {
        let pull = if high { "pull-up" } else { "pull-down" };
        fs::write(self.lines.join(format!("sim_gpio{line}/pull")), pull).unwrap();
    }

    pub fn unplug(&self) {
        fs::write(self.folder.join("live"), "0").unwrap();
    }

    pub fn trigger(&self, pulse_us: u32, active_low: bool) -> TriggerSetup {
        TriggerSetup {
            chip: self.label.into(),
            pulse_us,
            active_low,
            ..TriggerSetup::default()
        }
    }

    pub fn start(&self) -> Start {
        let setup = LinesSetup {
            chip: self.label.into(),
            debounce_ms: QUIET_MS,
            start_active_low: false,
            ..LinesSetup::default()
        };
        Start::open(&setup, "start").unwrap()
    }
}

impl Drop for Chip {
    fn drop(&mut self) {
        let _ = fs::write(self.folder.join("live"), "0");
        let bank = self.folder.join("bank0");
        for line in 0..self.width {
            let _ = fs::remove_dir(bank.join(format!("line{line}")));
        }
        let _ = fs::remove_dir(bank);
        let _ = fs::remove_dir(&self.folder);
    }
}

/// When the kernel set a line, by its own record.
pub struct Trace;

const TRACING: &str = "/sys/kernel/debug/tracing";

impl Trace {
    pub fn begin() -> Self {
        let set = |file: &str, value: &str| {
            fs::write(Path::new(TRACING).join(file), value).unwrap();
        };
        set("trace_clock", "mono");
        set("trace", "");
        set("events/gpio/gpio_value/enable", "1");
        Self
    }

    /// Every setting since: when (to the µs), and whether to high.
    pub fn settings(&self) -> Vec<(Timestamp, bool)> {
        let settings = self.by_line().into_iter();
        settings.map(|(at, _, high)| (at, high)).collect()
    }

    /// Every setting since: when (to the µs), the kernel's number of the line, and whether to high.
    pub fn by_line(&self) -> Vec<(Timestamp, u32, bool)> {
        let text = fs::read_to_string(Path::new(TRACING).join("trace")).unwrap();
        let settings = text.lines().filter_map(|line| {
            let (before, after) = line.split_once(": gpio_value: ")?;
            let (seconds, micros) = before.rsplit(' ').next()?.split_once('.')?;
            let at: u64 = format!("{seconds}{micros}").parse().ok()?;
            let (number, set) = after.split_once(' ')?;
            Some((Timestamp(at * 1000), number.parse().ok()?, set == "set 1"))
        });
        settings.collect()
    }

    /// The level that a line was last set to by its owner, which does not depend on a resistor.
    pub fn left_at(&self) -> bool {
        self.settings().last().unwrap().1
    }
}

impl Drop for Trace {
    fn drop(&mut self) {
        let _ = fs::write(
            Path::new(TRACING).join("events/gpio/gpio_value/enable"),
            "0",
        );
    }
}
