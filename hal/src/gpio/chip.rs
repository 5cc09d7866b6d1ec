//! Finding a line by the label of its chip and its own name, and taking it.

use gpio_cdev::{
    Chip, EventRequestFlags, Line, LineEventHandle, LineHandle, LineRequestFlags, chips,
};
use nix::errno::Errno;

use super::CONSUMER;
use super::failure::{LineError, errno, means};

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
            Ok(chip) if found.iter().all(|other| other.name() != chip.name()) => found.push(chip),
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
