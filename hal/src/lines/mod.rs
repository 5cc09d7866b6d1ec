//! The lines between a station and the machine that starts it by wire, as traits: start as input;
//! busy, ok and fault as outputs.

mod debounce;

use std::os::fd::AsFd;

use crate::error::Error;
use crate::units::Timestamp;
pub use debounce::Debounce;

/// A line that starts cycles. Its descriptor is readable as long as there are edges that were not
/// fetched.
pub trait StartLine: AsFd + Send {
    /// The start that has come since the last call, if any: the time since which the line is
    /// active. Does not wait.
    ///
    /// # Errors
    /// `Disconnected` if the line's chip is gone.
    fn poll_start(&mut self) -> Result<Option<Timestamp>, Error>;

    /// When to call [`StartLine::poll_start`] again even if the descriptor is not readable: the
    /// line may have settled by then.
    fn settles(&self) -> Option<Timestamp>;
}

/// A line that shows a state of the station.
pub trait OutputLine: Send {
    /// Switches it on or off.
    ///
    /// # Errors
    /// `Disconnected` if the line's chip is gone.
    fn set(&mut self, on: bool) -> Result<(), Error>;
}
