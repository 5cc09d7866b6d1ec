//! A GPIO chip of one line that the kernel simulates: the wire between trigger and camera.

use std::fs::{self, File};
use std::os::unix::fs::FileExt;
use std::path::PathBuf;

/// Where such chips are made.
const MADE: &str = "/sys/kernel/config/gpio-sim/rig";

/// The label of the chip.
pub const LABEL: &str = "rig";
/// The name of its line.
pub const LINE: &str = "trigger";

/// Made in its life, gone with it.
pub struct Chip {
    level: File,
}

impl Chip {
    pub fn new() -> Self {
        let chip = PathBuf::from(MADE);
        let bank = chip.join("bank0");
        fs::create_dir_all(bank.join("line0")).unwrap();
        fs::write(bank.join("num_lines"), "1").unwrap();
        fs::write(bank.join("label"), LABEL).unwrap();
        fs::write(bank.join("line0/name"), LINE).unwrap();
        fs::write(chip.join("live"), "1").unwrap();
        let word = |path: PathBuf| fs::read_to_string(path).unwrap().trim().to_owned();
        let device = PathBuf::from("/sys/devices/platform").join(word(chip.join("dev_name")));
        let line = device.join(word(bank.join("chip_name"))).join("sim_gpio0");
        Self {
            level: File::open(line.join("value")).unwrap(),
        }
    }

    /// The level on the wire, to be watched.
    pub fn level(&self) -> File {
        self.level.try_clone().unwrap()
    }
}

/// Whether the wire is high.
pub fn is_high(level: &File) -> bool {
    let mut text = [0; 4];
    level.read_at(&mut text, 0).is_ok() && text[0] == b'1'
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
