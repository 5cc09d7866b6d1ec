//! An input line that starts cycles: its edges with the kernel's time stamps, debounced.

use std::os::fd::{AsFd, BorrowedFd};

use gpio_cdev::{EventType, LineEventHandle};
use nix::errno::Errno;
use rustix::fs::{OFlags, fcntl_getfl, fcntl_setfl};

use super::chip::find;
use super::failure::{LineError, errno, means};
use crate::clock::monotonic;
use crate::error::Error;
use crate::lines::{Debounce, StartLine};
use crate::setup::LinesSetup;
use crate::units::Timestamp;

/// A start line.
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
