//! The caller of the daemon: the service manager that gets its status, and the source of its stop
//! signal.

use crate::system::notify::Notify;
use crate::system::stop_signal::StopSignal;

/// The caller of the daemon; by default there is no service manager and no stop signal.
#[derive(Clone, Debug, Default)]
pub struct Caller {
    /// The service manager.
    pub notify: Notify,
    /// The stop signal, which also ends a start early.
    pub stop: StopSignal,
}
