//! An output line that shows a state: busy, ok or fault.

use gpio_cdev::LineHandle;

use super::chip::find;
use super::failure::{LineError, means};
use crate::error::Error;
use crate::lines::OutputLine;

/// An output line. When dropped, it returns to its idle state.
#[derive(Debug)]
pub struct Output {
    handle: LineHandle,
    name: String,
    idle: bool,
}

impl Output {
    /// Opens the line `name` of the chip labelled `chip`; it has the state `idle` until it is set, and again after it is dropped.
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
