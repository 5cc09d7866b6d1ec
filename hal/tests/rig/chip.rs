//! A GPIO chip with one line that the kernel simulates, and the wire at that line: when it went
//! high, by the kernel's own record.

use std::fs::{self, File, OpenOptions};
use std::io::Read;
use std::os::unix::fs::OpenOptionsExt;
use std::path::PathBuf;

use hal::units::Timestamp;
use rustix::fs::OFlags;

/// Where such chips are configured.
const MADE: &str = "/sys/kernel/config/gpio-sim/rig";
/// Where the kernel's trace is.
const TRACING: &str = "/sys/kernel/debug/tracing";

/// The label of the chip.
pub const LABEL: &str = "rig";
/// The name of its line.
pub const LINE: &str = "trigger";

/// The chip; it exists as long as this value.
pub struct Chip;

impl Chip {
    pub fn new() -> Self {
        let chip = PathBuf::from(MADE);
        let bank = chip.join("bank0");
        fs::create_dir_all(bank.join("line0")).unwrap();
        fs::write(bank.join("num_lines"), "1").unwrap();
        fs::write(bank.join("label"), LABEL).unwrap();
        fs::write(bank.join("line0/name"), LINE).unwrap();
        fs::write(chip.join("live"), "1").unwrap();
        Self
    }
}

impl Drop for Chip {
    fn drop(&mut self) {
        let chip = PathBuf::from(MADE);
        let _ = fs::write(chip.join("live"), "0");
        for folder in ["bank0/line0", "bank0", ""] {
            let _ = fs::remove_dir(chip.join(folder));
        }
    }
}

/// The wire, by the kernel's record of all lines that are set; no other line may be set meanwhile.
pub struct Wire(File);

impl Wire {
    pub fn new() -> Self {
        let set = |file: &str, value: &str| fs::write(format!("{TRACING}/{file}"), value).unwrap();
        set("trace_clock", "mono");
        set("trace", "");
        set("events/gpio/gpio_value/enable", "1");
        let mut options = OpenOptions::new();
        options
            .read(true)
            .custom_flags(OFlags::NONBLOCK.bits().cast_signed());
        Self(options.open(format!("{TRACING}/trace_pipe")).unwrap())
    }

    /// When it last went high since the last call, if it did; to the µs.
    pub fn pulse(&mut self) -> Option<Timestamp> {
        let mut record = [0; 4096];
        let length = self.0.read(&mut record).ok()?;
        let text = String::from_utf8_lossy(&record[..length]);
        let mut high = text.lines().filter_map(|line| {
            let (before, after) = line.split_once(": gpio_value: ")?;
            let (seconds, micros) = before.rsplit(' ').next()?.split_once('.')?;
            let at: u64 = format!("{seconds}{micros}").parse().ok()?;
            after.ends_with("set 1").then_some(Timestamp(at * 1000))
        });
        high.next_back()
    }
}

impl Drop for Wire {
    fn drop(&mut self) {
        let _ = fs::write(format!("{TRACING}/events/gpio/gpio_value/enable"), "0");
    }
}
