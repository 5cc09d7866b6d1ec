//! What the computer reports about itself: power, temperature, versions, and how GPIO drivers treat
//! released lines.
//!
//! Everything is read below a root folder, `/` except in tests. What a computer does not report is
//! `None`, never an error.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// A computer, by the root of its file system.
#[derive(Clone, Debug)]
pub struct Host {
    root: PathBuf,
}

impl Default for Host {
    fn default() -> Self {
        Self::at(Path::new("/"))
    }
}

impl Host {
    /// The computer whose file system is at `root`.
    pub fn at(root: &Path) -> Self {
        Self {
            root: root.to_path_buf(),
        }
    }

    fn text(&self, path: &str) -> Option<String> {
        let text = fs::read_to_string(self.root.join(path)).ok()?;
        Some(text.trim().to_owned())
    }

    /// The paths below the root of the entries of a folder whose name begins with `begin` and ends
    /// with `end`, sorted.
    fn entries(&self, folder: &str, begin: &str, end: &str) -> Vec<String> {
        let entries = fs::read_dir(self.root.join(folder)).into_iter().flatten();
        let names = entries
            .flatten()
            .filter_map(|entry| entry.file_name().into_string().ok());
        let names = names.filter(|name| name.starts_with(begin) && name.ends_with(end));
        let mut paths: Vec<String> = names.map(|name| format!("{folder}/{name}")).collect();
        paths.sort();
        paths
    }

    /// What the firmware of a Raspberry Pi says of power and throttling: the bits of `vcgencmd
    /// get_throttled`, as its driver shows them.
    pub fn throttled(&self) -> Option<u32> {
        let devices = "sys/devices/platform";
        // soc/soc:firmware; on a Raspberry Pi 5 the node has an address in its name.
        let nodes = self.entries(devices, "soc", "");
        let firmware = nodes
            .iter()
            .flat_map(|soc| self.entries(soc, "soc", ":firmware"));
        firmware
            .filter_map(|node| self.text(&format!("{node}/get_throttled")))
            .find_map(|text| u32::from_str_radix(text.trim_start_matches("0x"), 16).ok())
    }

    /// The hottest thermal zone, °C.
    pub fn temperature_c(&self) -> Option<f64> {
        let zones = self.entries("sys/class/thermal", "thermal_zone", "");
        let degrees = zones.iter().filter_map(|zone| {
            let millidegrees = self.text(&format!("{zone}/temp"))?;
            Some(millidegrees.parse::<f64>().ok()? / 1000.0)
        });
        degrees.max_by(f64::total_cmp)
    }

    /// The kernel's release, such as "6.12.34+rpt-rpi-2712".
    pub fn kernel(&self) -> Option<String> {
        self.text("proc/sys/kernel/osrelease")
    }

    /// The version of libcamera that this process has loaded, such as "0.7.0": from the name of its
    /// file.
    pub fn libcamera(&self) -> Option<String> {
        let maps = self.text("proc/self/maps")?;
        let mut names = maps.lines().filter_map(|line| line.rsplit('/').next());
        let version = names.find_map(|name| name.strip_prefix("libcamera.so."))?;
        Some(version.to_owned())
    }

    /// The last core that the kernel keeps free of ordinary threads (`isolcpus` on its command
    /// line).
    pub fn isolated_core(&self) -> Option<usize> {
        let cores = self.text("sys/devices/system/cpu/isolated")?;
        cores.rsplit([',', '-']).next()?.parse().ok()
    }

    /// Whether the driver of the IMX296 waits for triggers; `None` if it is not loaded or has no
    /// such parameter.
    pub fn sensor_waits_for_triggers(&self) -> Option<bool> {
        let mode = self.text("sys/module/imx296/parameters/trigger_mode")?;
        mode.parse::<u32>().ok().map(|mode| mode != 0)
    }

    /// Whether the driver of the GPIO chip with this label keeps the level of an output whose owner
    /// has gone: the parameter `persist_gpio_outputs` of Raspberry Pi's kernels. `None` if the
    /// driver has no such parameter.
    pub fn keeps_released_outputs(&self, chip: &str) -> Option<bool> {
        // One driver serves the chips of all models before the Raspberry Pi 5.
        let driver = match chip {
            "pinctrl-rp1" => "pinctrl_rp1",
            label if label.starts_with("pinctrl-bcm2") => "pinctrl_bcm2835",
            _ => return None,
        };
        let parameter = format!("sys/module/{driver}/parameters/persist_gpio_outputs");
        match self.text(&parameter)?.as_str() {
            "Y" | "1" => Some(true),
            "N" | "0" => Some(false),
            _ => None,
        }
    }
}

/// How long libcamera waits for a frame before it gives a camera up, where its configuration says
/// so: the file that the variable `LIBCAMERA_RPI_CONFIG_FILE` names. Zero if it says nothing: about
/// a second.
pub fn libcamera_patience() -> Duration {
    let file = std::env::var_os("LIBCAMERA_RPI_CONFIG_FILE");
    let text = file.and_then(|file| fs::read_to_string(file).ok());
    text.map_or(Duration::ZERO, |text| patience_in(&text))
}

/// `camera_timeout_value_ms` in a file of libcamera, whose YAML is one object of JSON with
/// comments.
fn patience_in(text: &str) -> Duration {
    let lines = text
        .lines()
        .map(|line| line.split('#').next().unwrap_or(""));
    let value = lines.filter_map(|line| line.split_once("camera_timeout_value_ms"));
    let number = value.map(|(_, value)| {
        let digits = value.trim_start_matches(['"', ':', ' ', '\t']);
        let end = digits.find(|c: char| !c.is_ascii_digit());
        digits[..end.unwrap_or(digits.len())].parse().unwrap_or(0)
    });
    Duration::from_millis(number.max().unwrap_or(0))
}

/// The first two numbers of a version.
pub fn major_minor(version: &str) -> Option<[u16; 2]> {
    let mut numbers = version.split(|c: char| !c.is_ascii_digit());
    let mut next = || numbers.next()?.parse().ok();
    Some([next()?, next()?])
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// A root with these files.
    pub(crate) fn root(files: &[(&str, &str)]) -> tempfile::TempDir {
        let root = tempfile::tempdir().unwrap();
        for (path, text) in files {
            let path = root.path().join(path);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, text).unwrap();
        }
        root
    }

    #[test]
    fn whether_released_outputs_keep_their_level_is_that_of_the_driver_of_the_chip() {
        let of = |driver: &str| format!("sys/module/{driver}/parameters/persist_gpio_outputs");
        let (rp1, bcm) = (of("pinctrl_rp1"), of("pinctrl_bcm2835"));
        let root = root(&[(&rp1, "N\n"), (&bcm, "Y\n")]);
        let host = Host::at(root.path());
        assert_eq!(host.keeps_released_outputs("pinctrl-rp1"), Some(false));
        for chip in ["pinctrl-bcm2711", "pinctrl-bcm2835"] {
            assert_eq!(host.keeps_released_outputs(chip), Some(true));
        }
        assert_eq!(host.keeps_released_outputs("gpio-sim"), None);
        fs::write(root.path().join(rp1), "perhaps\n").unwrap();
        assert_eq!(host.keeps_released_outputs("pinctrl-rp1"), None);
        let empty = tempfile::tempdir().unwrap();
        let nothing = Host::at(empty.path());
        assert_eq!(nothing.keeps_released_outputs("pinctrl-rp1"), None);
    }

    #[test]
    fn what_a_computer_reports_is_understood_and_what_it_does_not_is_not_known() {
        for node in ["soc/soc:firmware", "soc@107c000000/soc@107c000000:firmware"] {
            let throttled = format!("sys/devices/platform/{node}/get_throttled");
            let root = root(&[
                (&throttled, "50005\n"),
                ("sys/class/thermal/thermal_zone0/temp", "51240\n"),
                ("sys/class/thermal/thermal_zone1/temp", "61000\n"),
                ("proc/sys/kernel/osrelease", "6.12.34+rpt-rpi-2712\n"),
                (
                    "proc/self/maps",
                    "7f00 r-xp 00000000 fd:00 1 /usr/lib/libc.so.6\n7f01 r-xp 00000000 fd:00 2 /usr/lib/aarch64-linux-gnu/libcamera.so.0.7.0\n",
                ),
                ("sys/module/imx296/parameters/trigger_mode", "1\n"),
            ]);
            let host = Host::at(root.path());
            assert_eq!(host.throttled(), Some(0x50005), "{node}");
            assert_eq!(host.temperature_c(), Some(61.0));
            assert_eq!(host.kernel().as_deref(), Some("6.12.34+rpt-rpi-2712"));
            assert_eq!(host.libcamera().as_deref(), Some("0.7.0"));
            assert_eq!(host.sensor_waits_for_triggers(), Some(true));
            fs::write(root.path().join(throttled), "what?\n").unwrap();
            assert_eq!(host.throttled(), None);
        }
        let empty = tempfile::tempdir().unwrap();
        let host = Host::at(empty.path());
        assert_eq!((host.throttled(), host.temperature_c()), (None, None));
        assert_eq!((host.kernel(), host.libcamera()), (None, None));
        assert_eq!(host.sensor_waits_for_triggers(), None);
    }

    #[test]
    fn the_patience_of_libcamera_is_that_of_its_file() {
        for (text, ms) in [
            (
                "# Comment\n{ \"version\": 1.0, \"pipeline_handler\": { \"camera_timeout_value_ms\": 60000 } }",
                60_000,
            ),
            ("{\n  # \"camera_timeout_value_ms\": 5\n}\n", 0),
            ("camera_timeout_value_ms: 900\n", 900),
            ("\"camera_timeout_value_ms\": -3", 0),
            ("", 0),
        ] {
            assert_eq!(patience_in(text), Duration::from_millis(ms), "{text}");
        }
    }

    #[test]
    fn the_isolated_core_is_the_last_of_the_kernels_list() {
        for (list, core) in [
            ("3\n", Some(3)),
            ("1,2-3\n", Some(3)),
            ("1-2,5", Some(5)),
            ("\n", None),
        ] {
            let root = root(&[("sys/devices/system/cpu/isolated", list)]);
            assert_eq!(Host::at(root.path()).isolated_core(), core, "{list:?}");
        }
    }

    #[test]
    fn a_version_is_its_first_two_numbers() {
        assert_eq!(major_minor("6.12.34+rpt-rpi-2712"), Some([6, 12]));
        assert_eq!(major_minor("7.2-rc1"), Some([7, 2]));
        assert_eq!(major_minor("0.7"), Some([0, 7]));
        for wrong in ["", "seven", "7", "99999.1", "-1.2"] {
            assert_eq!(major_minor(wrong), None, "{wrong}");
        }
    }
}
