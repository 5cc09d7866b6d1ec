//! The operating system: clock, signals, sockets, thread priorities, memory, the service manager;
//! and the log on stderr.

use crate::error::{Exit, Result};

pub mod caller;
pub mod clock;
pub mod computing;
pub mod headway;
pub mod host;
pub mod journal;
pub mod progress;
pub mod socket;
pub mod stderr;

/// A current-thread runtime for sockets.
///
/// # Errors
/// If the system refuses its resources (exit code 70).
pub fn runtime() -> Result<tokio::runtime::Runtime> {
    tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .map_err(Exit::Software.because("start a socket runtime"))
}
