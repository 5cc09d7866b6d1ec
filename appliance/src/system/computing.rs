//! Whether the measuring task only computes: it then uses no device and stores nothing, so the
//! program may end without waiting for it.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Set by the measuring task, read when the program stops. Cheap to clone; clones share the flag.
#[derive(Clone, Debug, Default)]
pub struct Computing(Arc<AtomicBool>);

impl Computing {
    /// Runs work that takes seconds and whose result is not needed once the program ends.
    pub fn on<T>(&self, work: impl FnOnce() -> T) -> T {
        self.0.store(true, Ordering::Relaxed);
        let result = work();
        self.0.store(false, Ordering::Relaxed);
        result
    }

    /// Whether such work is under way.
    pub fn is_under_way(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}
