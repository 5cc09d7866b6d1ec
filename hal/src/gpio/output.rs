//! An output line that shows a state: busy, ok or fault.

use gpio_cdev::LineHandle;

use super::chip::find;
use super::failure::{LineError, means};
use crate::error::Error;
use crate::lines::OutputLine;
use crate::setup::{LinesSetup, TriggerSetup};

/// An output line. When dropped, it returns to its idle state.
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
        // An error could not be reported any more.
        let _ = self.put(self.idle);
    }
}
