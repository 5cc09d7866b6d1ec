//! The clock of a head: what time it is for all its devices, and how to wait for them.

use crate::units::Timestamp;

/// The clock by which flips, triggers and frames are stamped.
pub trait Clock: Send {
    /// Now.
    fn now(&self) -> Timestamp;

    /// Waits until `until`, or less if a flip or a frame has come meanwhile; it may also return early for nothing.
    fn wait(&mut self, until: Timestamp);

    /// Whether time passes only in [`Clock::wait`], as in a simulation. Then nobody is late by working between two waits.
    fn stands_still(&self) -> bool {
        false
    }
}

impl<K: Clock + ?Sized> Clock for Box<K> {
    fn now(&self) -> Timestamp {
        (**self).now()
    }

    fn wait(&mut self, until: Timestamp) {
        (**self).wait(until);
    }

    fn stands_still(&self) -> bool {
        (**self).stands_still()
    }
}
