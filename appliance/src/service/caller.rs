//! Who started the daemon: whom it tells how it goes, and who tells it to end.

use crate::system::notify::Notify;
use crate::system::stop_signal::Told;

/// Who started the daemon; by default nobody who listens or ends it.
#[derive(Clone, Debug, Default)]
pub struct Caller {
    /// The service manager.
    pub notify: Notify,
    /// Whether the end was asked for.
    pub told: Told,
}
