//! Lines of the kernel's GPIO chips: the camera's trigger, the start line, and busy, ok and fault.
//!
//! A line is found by the label of its chip and its own name (`gpioinfo` lists both), because the
//! numbers of chips change with the kernel. Version 1 of the kernel's interface is used.
//!
//! In this version the kernel stamps edges on `CLOCK_MONOTONIC` (since Linux 5.7), queues 16 of
//! them, drops further ones without notice, and does not debounce. So
//! [`Debounce`] debounces here, and reads the level at the end.
//!
//! A line is left at its idle level when its owner is dropped, also by a panic. After a kill it
//! depends on the driver of the chip. Raspberry Pi kernels keep the line an output at its last
//! level (`persist_gpio_outputs`, on unless `dtparam=strict_gpiod` is set); otherwise it becomes an
//! input, and a resistor has to hold its level. [`leave_idle`] puts such lines back at their idle
//! levels.

mod line;
mod pulse;

use std::os::fd::{AsFd, BorrowedFd};

use gpio_cdev::{EventType, LineEventHandle, LineHandle};
use nix::errno::Errno;
use rustix::fs::{OFlags, fcntl_getfl, fcntl_setfl};

use crate::clock::monotonic;
use crate::error::Error;
use crate::lines::{Debounce, OutputLine, StartLine};
use crate::setup::{LinesSetup, TriggerSetup};
use crate::units::Timestamp;
pub use line::LineError;
use line::{errno, find, means};
pub use pulse::Pulse;

/// An input line that starts cycles: its edges with the kernel's time stamps, debounced.
#[derive(Debug)]
pub struct Start {
    edges: LineEventHandle,
    name: String,
    debounce: Debounce,
}

impl Start {
    /// Opens the line `name` of the chip as it is set up. A line that is active already does not
    /// start a cycle.
    ///
    /// # Errors
    /// Why it cannot be opened.
    pub fn open(setup: &LinesSetup, name: &str) -> Result<Self, LineError> {
        let edges = find(&setup.chip, name)?.edges(setup.start_active_low)?;
        let unblocked =
            fcntl_getfl(&edges).and_then(|flags| fcntl_setfl(&edges, flags | OFlags::NONBLOCK));
        unblocked.map_err(|error| LineError::failed(name, error))?;
        let mut start = Self {
            edges,
            name: name.into(),
            debounce: Debounce::new(setup.debounce(), false),
        };
        let active = start.active()?;
        start.debounce = Debounce::new(setup.debounce(), active);
        Ok(start)
    }

    fn active(&self) -> Result<bool, LineError> {
        let read = self.edges.get_value();
        let level = read.map_err(|error| means(&error, &self.name, None))?;
        Ok(level != 0)
    }

    /// The next queued edge, with the level after it.
    fn edge(&mut self) -> Result<Option<(Timestamp, bool)>, LineError> {
        match self.edges.get_event() {
            Ok(event) => {
                let rose = event.event_type() == EventType::RisingEdge;
                Ok(Some((Timestamp(event.timestamp()), rose)))
            }
            Err(error) => match errno(&error) {
                Some(Errno::EAGAIN) => Ok(None),
                // The library reports the end of the file as EIO.
                Some(Errno::EIO) => Err(LineError::Removed {
                    line: self.name.clone(),
                }),
                _ => Err(means(&error, &self.name, None)),
            },
        }
    }
}

impl StartLine for Start {
    fn poll_start(&mut self) -> Result<Option<Timestamp>, Error> {
        while let Some((at, active)) = self.edge()? {
            self.debounce.edge(at, active);
        }
        let now = monotonic();
        if self.debounce.due().is_none_or(|due| now < due) {
            return Ok(None);
        }
        let active = self.active()?;
        Ok(self.debounce.found(now, active))
    }

    fn settles(&self) -> Option<Timestamp> {
        self.debounce.due()
    }
}

impl AsFd for Start {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.edges.as_fd()
    }
}

/// An output line that shows a state: busy, ok or fault. When dropped, it returns to its idle state.
#[derive(Debug)]
pub struct Output {
    handle: LineHandle,
    name: String,
    idle: bool,
}

impl Output {
    /// Opens the line `name` of the chip labelled `chip`; it has the state `idle` until it is set,
    /// and again after it is dropped.
    ///
    /// # Errors
    /// Why it cannot be opened.
    pub fn open(chip: &str, name: &str, active_low: bool, idle: bool) -> Result<Self, LineError> {
        Ok(Self {
            handle: find(chip, name)?.output(active_low, idle)?,
            name: name.into(),
            idle,
        })
    }

    fn put(&self, on: bool) -> Result<(), LineError> {
        let put = self.handle.set_value(u8::from(on));
        put.map_err(|error| means(&error, &self.name, None))
    }
}

/// Leaves every named output of a station at its idle level: no trigger pulse, busy and ok off,
/// fault on. For lines that a killed process left at their last level; all of them are tried.
/// Returns the errors of those that cannot be used.
#[must_use]
pub fn leave_idle(trigger: &TriggerSetup, lines: &LinesSetup) -> Vec<LineError> {
    let press = lines.outputs_active_low;
    let outputs = [
        (&trigger.chip, &trigger.line, trigger.active_low, false),
        (&lines.chip, &lines.busy, press, false),
        (&lines.chip, &lines.ok, press, false),
        (&lines.chip, &lines.fault, press, true),
    ];
    let leave = |(chip, line, active_low, idle): (&String, &Option<String>, bool, bool)| {
        Output::open(chip, line.as_ref()?, active_low, idle).err()
    };
    outputs.into_iter().filter_map(leave).collect()
}

impl OutputLine for Output {
    fn set(&mut self, on: bool) -> Result<(), Error> {
        Ok(self.put(on)?)
    }
}

impl Drop for Output {
    fn drop(&mut self) {
        // Nothing is left that could report an error.
        let _ = self.put(self.idle);
    }
}
