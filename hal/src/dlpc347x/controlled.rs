//! A projector on a display connector whose controller was set up over I²C, and is watched.

use super::Controller;
use crate::clock::monotonic;
use crate::controller::ControllerState;
use crate::error::Error;
use crate::projector::{Flip, Projector, Raster};
use crate::units::Timestamp;
use embedded_hal::i2c::I2c;
use std::cell::RefCell;
use std::time::Duration;

/// A projector together with its controller. It is present as long as the controller answers and
/// streams patterns: one that was switched off and on shows video again, and has to be set up
/// again.
pub struct Controlled<I> {
    projector: Box<dyn Projector>,
    watched: RefCell<Watched<I>>,
    period: Duration,
}

struct Watched<I> {
    controller: Controller<I>,
    state: ControllerState,
    at: Timestamp,
}

impl<I: I2c> Controlled<I> {
    /// Sets the controller up for the refresh of a projector; [`Projector::present`] asks it at
    /// most once in a `period`.
    ///
    /// # Errors
    /// As [`Controller::set_up`].
    pub fn new(
        projector: Box<dyn Projector>,
        mut controller: Controller<I>,
        current: Option<u16>,
        period: Duration,
    ) -> Result<Self, Error> {
        controller.set_up(current, projector.refresh())?;
        let watched = Watched {
            state: controller.state()?,
            at: monotonic(),
            controller,
        };
        Ok(Self {
            projector,
            watched: RefCell::new(watched),
            period,
        })
    }
}

impl<I: I2c> Watched<I> {
    fn look(&mut self) -> Result<(), Error> {
        self.state = self.controller.state()?;
        self.at = monotonic();
        match self.state.processing {
            0 => Ok(()),
            _ => Err(self.controller.gone("it does not stream patterns any more: it was switched off and on, or another program has set it up")),
        }
    }
}

impl<I: I2c + Send> Projector for Controlled<I> {
    fn size(&self) -> (u32, u32) {
        self.projector.size()
    }

    fn refresh(&self) -> Duration {
        self.projector.refresh()
    }

    fn present(&self) -> Result<(), Error> {
        self.projector.present()?;
        let mut watched = self.watched.borrow_mut();
        if monotonic().since(watched.at) < self.period {
            return Ok(());
        }
        watched.look()
    }

    fn starts_dark(&self) -> bool {
        self.projector.starts_dark()
    }

    fn controller(&self) -> Option<ControllerState> {
        Some(self.watched.borrow().state.clone())
    }

    fn load_behind(&mut self, kept: usize, rasters: Vec<Raster>) -> Result<(), Error> {
        self.projector.load_behind(kept, rasters)
    }

    fn queue(&mut self, index: usize) -> Result<(), Error> {
        self.projector.queue(index)
    }

    fn poll_flip(&mut self) -> Result<Option<Flip>, Error> {
        self.projector.poll_flip()
    }

    fn blank(&mut self) -> Result<(), Error> {
        self.projector.blank()
    }
}
