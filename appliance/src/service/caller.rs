//! Who started the daemon: where its status goes, and where its stop signal comes from.

use crate::system::notify::Notify;
use crate::system::stop_signal::StopSignal;

/// Who started the daemon; by default no service manager and no stop signal.
#[derive(Clone, Debug, Default)]
pub struct Caller {
    /// The service manager.
    pub notify: Notify,
    /// Ends the start early.
    pub stop: StopSignal,
}
