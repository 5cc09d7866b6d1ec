//! The lines between a station and whoever starts it by wire, as traits: a start in, and busy, ok and fault out.

mod debounce;

use std::os::fd::AsFd;

use crate::error::Error;
use crate::units::Timestamp;
pub use debounce::Debounce;

/// A line that starts cycles. Its descriptor is readable as long as there are edges that were not fetched.
pub trait StartLine: AsFd + Send {
    /// The start that has come since the last call: the time from which on the line was active. Does not wait.
    ///
    /// # Errors
    /// `Disconnected` if the line's chip is gone.
    fn poll_start(&mut self) -> Result<Option<Timestamp>, Error>;

    /// When to ask again even if the descriptor says nothing: the line is moving, and may have settled by then.
    fn settles(&self) -> Option<Timestamp>;
}

/// A line that tells something to whoever is at its other end.
pub trait OutputLine: Send {
    /// Switches it on or off.
    ///
    /// # Errors
    /// `Disconnected` if the line's chip is gone.
    fn set(&mut self, on: bool) -> Result<(), Error>;
}
