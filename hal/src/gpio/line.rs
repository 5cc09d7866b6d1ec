//! A line of a chip: finding it by the chip's label and its own name, taking it, and its errors, each
//! with its own remedy.

use std::error::Error as _;

use gpio_cdev::{
    Chip, EventRequestFlags, Line, LineEventHandle, LineHandle, LineRequestFlags, chips,
};
use nix::errno::Errno;

use crate::error::{DeviceKind, Error};

/// What the kernel shows as the user of a line.
const CONSUMER: &str = "fringed";

/// A line that cannot be used.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LineError {
    /// No chip has that label.
    #[error(
        "open line {line}: no GPIO chip is labelled \"{chip}\"; there is {}: name one of these, or connect it",
        listed(found)
    )]
    NoChip {
        /// The label asked for.
        chip: String,
        /// The line asked for.
        line: String,
        /// Labels of the chips that are there.
        found: Vec<String>,
    },
    /// The chip has no line of that name.
    #[error(
        "open line {line}: GPIO chip \"{chip}\" has no line of that name; there is {}: name one of these",
        listed(found)
    )]
    NoLine {
        /// Label of the chip.
        chip: String,
        /// The line asked for.
        line: String,
        /// Names of its lines.
        found: Vec<String>,
    },
    /// More than one line has that name.
    #[error(
        "open line {line}: {lines} lines of chips labelled \"{chip}\" have that name: give them different names in the device tree"
    )]
    Ambiguous {
        /// Label of the chip.
        chip: String,
        /// The line asked for.
        line: String,
        /// How many lines have it.
        lines: usize,
    },
    /// Another program or a kernel driver holds the line.
    #[error(
        "open line {line}: {} uses it: end that program, remove the overlay that takes the line, or use another line", user.as_deref().unwrap_or("somebody else")
    )]
    Busy {
        /// The line asked for.
        line: String,
        /// What holds it, if the kernel tells.
        user: Option<String>,
    },
    /// The kernel speaks only version 2 of the interface.
    #[error(
        "open line {line}: this kernel has no version 1 of the GPIO interface: use one that is built with CONFIG_GPIO_CDEV_V1=y, as those of Raspberry Pi and of Debian 13 are"
    )]
    NoVersion1 {
        /// The line asked for.
        line: String,
    },
    /// This user may not open the chip.
    #[error(
        "open line {line}: this user may not open {path}: add the user to the group that owns it (`gpio` on a Raspberry Pi)"
    )]
    Denied {
        /// The line asked for.
        line: String,
        /// The chip's device file.
        path: String,
    },
    /// The chip was removed while its line was in use.
    #[error("use line {line}: its GPIO chip is gone: connect it again")]
    Removed {
        /// The line.
        line: String,
    },
    /// Any other error of the system.
    #[error(
        "use line {line}: {cause}: look into the kernel's log, and whether `gpioinfo` shows the line"
    )]
    Failed {
        /// The line.
        line: String,
        /// The system's message.
        cause: String,
    },
}

impl LineError {
    /// An error of the system that has no remedy of its own.
    pub(super) fn failed(line: &str, cause: impl ToString) -> Self {
        Self::Failed {
            line: line.into(),
            cause: cause.to_string(),
        }
    }
}

/// Most names that a message lists.
const LISTED: usize = 32;

fn listed(names: &[String]) -> String {
    match names {
        [] => "none at all".into(),
        names if names.len() > LISTED => format!("{} and more", names[..LISTED].join(", ")),
        names => names.join(", "),
    }
}

impl From<LineError> for Error {
    /// A removed chip is a disconnected device; every other error is `Unsupported` and keeps its
    /// message.
    fn from(error: LineError) -> Self {
        match error {
            LineError::Removed { line } => {
                Self::disconnected(DeviceKind::Lines, format!("using line {line}"))
            }
            other => Self::unsupported(
                "a line of the GPIO chip as it is set up".to_string(),
                other.to_string(),
            ),
        }
    }
}

/// The `LineError` for an error of the library; `user` is what holds the line, if known.
pub(super) fn means(error: &gpio_cdev::Error, line: &str, user: Option<String>) -> LineError {
    let name = line.to_owned();
    match errno(error) {
        Some(Errno::EBUSY) => LineError::Busy { line: name, user },
        Some(Errno::ENODEV) => LineError::Removed { line: name },
        _ => LineError::failed(line, error),
    }
}

/// The system's error number, which the library's error has only as its source.
pub(super) fn errno(error: &gpio_cdev::Error) -> Option<Errno> {
    let source = error.source()?;
    if let Some(errno) = source.downcast_ref::<Errno>() {
        return Some(*errno);
    }
    let number = source.downcast_ref::<std::io::Error>()?.raw_os_error()?;
    Some(Errno::from_i32(number))
}

/// A line that was found but not yet requested from the kernel.
pub(super) struct FoundLine {
    line: Line,
    name: String,
}

/// Finds the line `name` of the chip labelled `label`.
///
/// # Errors
/// If there is no such chip or line, or more than one.
pub(super) fn find(label: &str, name: &str) -> Result<FoundLine, LineError> {
    let chips = open_chips(name)?;
    let labelled: Vec<&Chip> = chips.iter().filter(|chip| chip.label() == label).collect();
    if labelled.is_empty() {
        return Err(LineError::NoChip {
            chip: label.into(),
            line: name.into(),
            found: chips.iter().map(|chip| chip.label().into()).collect(),
        });
    }
    let (mut lines, mut names) = (Vec::new(), Vec::new());
    for line in labelled.into_iter().flat_map(Chip::lines) {
        let info = line.info().map_err(|error| match errno(&error) {
            // The line exists; the kernel does not know the request of version 1 of the interface.
            Some(Errno::EINVAL | Errno::ENOTTY) => LineError::NoVersion1 { line: name.into() },
            _ => means(&error, name, None),
        })?;
        match info.name() {
            Some(found) if found == name => lines.push(line),
            Some(other) => names.push(other.to_owned()),
            None => {}
        }
    }
    match (lines.len(), lines.pop()) {
        (1, Some(line)) => Ok(FoundLine {
            line,
            name: name.into(),
        }),
        (0, _) => Err(LineError::NoLine {
            chip: label.into(),
            line: name.into(),
            found: names,
        }),
        (several, _) => Err(LineError::Ambiguous {
            chip: label.into(),
            line: name.into(),
            lines: several,
        }),
    }
}

/// All chips, each once: a second name in /dev may be a link to the same chip.
fn open_chips(line: &str) -> Result<Vec<Chip>, LineError> {
    let failed = |error: gpio_cdev::Error| LineError::failed(line, error);
    let mut found: Vec<Chip> = Vec::new();
    let mut denied = false;
    for chip in chips().map_err(failed)? {
        match chip {
            Ok(chip) if found.iter().all(|known| known.name() != chip.name()) => found.push(chip),
            Ok(_) => {}
            Err(error) => match errno(&error) {
                Some(Errno::EACCES | Errno::EPERM) => denied = true,
                // The chip was removed in the meantime.
                Some(Errno::ENOENT | Errno::ENODEV | Errno::ENXIO) => {}
                _ => return Err(failed(error)),
            },
        }
    }
    if denied && found.is_empty() {
        return Err(LineError::Denied {
            line: line.into(),
            path: "/dev/gpiochip*".into(),
        });
    }
    Ok(found)
}

impl FoundLine {
    /// Requests the line as an output, initially on or off.
    pub fn output(&self, active_low: bool, on: bool) -> Result<LineHandle, LineError> {
        let flags = flags(LineRequestFlags::OUTPUT, active_low);
        let taken = self.line.request(flags, u8::from(on), CONSUMER);
        taken.map_err(|error| self.refused(&error))
    }

    /// Requests the line as an input that reports its edges.
    pub fn edges(&self, active_low: bool) -> Result<LineEventHandle, LineError> {
        let flags = flags(LineRequestFlags::INPUT, active_low);
        let edges = EventRequestFlags::BOTH_EDGES;
        let taken = self.line.events(flags, edges, CONSUMER);
        taken.map_err(|error| self.refused(&error))
    }

    fn refused(&self, error: &gpio_cdev::Error) -> LineError {
        let info = self.line.info().ok();
        let user = info.and_then(|info| info.consumer().map(ToOwned::to_owned));
        means(error, &self.name, user)
    }
}

fn flags(direction: LineRequestFlags, active_low: bool) -> LineRequestFlags {
    if active_low {
        direction | LineRequestFlags::ACTIVE_LOW
    } else {
        direction
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::ErrorKind;

    #[test]
    fn each_thing_that_can_be_wrong_has_its_own_words_and_remedy() {
        let line = || "GPIO17".to_owned();
        let chip = || "pinctrl-rp1".to_owned();
        let all = [
            LineError::NoChip {
                chip: chip(),
                line: line(),
                found: vec!["gpio-sim".into()],
            },
            LineError::NoLine {
                chip: chip(),
                line: line(),
                found: Vec::new(),
            },
            LineError::Ambiguous {
                chip: chip(),
                line: line(),
                lines: 2,
            },
            LineError::Busy {
                line: line(),
                user: Some("spi0 CS0".into()),
            },
            LineError::NoVersion1 { line: line() },
            LineError::Denied {
                line: line(),
                path: "/dev/gpiochip0".into(),
            },
            LineError::Removed { line: line() },
            LineError::Failed {
                line: line(),
                cause: "EIO".into(),
            },
        ];
        let words: Vec<String> = all.iter().map(ToString::to_string).collect();
        for (at, message) in words.iter().enumerate() {
            assert!(
                message.contains("GPIO17") && message.matches(": ").count() >= 2,
                "{message}"
            );
            assert!(!words[..at].contains(message), "{message}");
        }
    }

    #[test]
    fn only_a_chip_that_is_gone_has_to_be_opened_again() {
        let means = |number| {
            let error = gpio_cdev::Error::from(std::io::Error::from_raw_os_error(number));
            Error::from(means(&error, "GPIO17", None)).kind()
        };
        assert_eq!(means(Errno::ENODEV as i32), ErrorKind::Disconnected);
        for other in [Errno::EBUSY, Errno::EINVAL, Errno::EIO] {
            assert_eq!(means(other as i32), ErrorKind::Unsupported, "{other}");
        }
    }
}
