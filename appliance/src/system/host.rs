//! What the computer reports about itself: power, temperature, versions, and how GPIO drivers treat released lines.
//!
//! Everything is read below a root folder, `/` except in tests. What a computer does not report is `None`, never an error.

use std::fs;
use std::path::{Path, PathBuf};

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

    /// Whether the driver of the GPIO chip with this label keeps the level of an output whose owner has gone: the parameter
    /// `persist_gpio_outputs` of Raspberry Pi's kernels. `None` if the driver has no such parameter.
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
}
