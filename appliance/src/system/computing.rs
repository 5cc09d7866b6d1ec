//! Whether the measuring task only computes: it holds no device then and stores nothing, so the program may end without it.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Told by the measuring task, asked by who ends the program. Cheap to clone.
#[derive(Clone, Debug, Default)]
pub struct Computing(Arc<AtomicBool>);

impl Computing {
    /// Works on something for seconds that is worth nothing once the program ends.
    pub fn on<T>(&self, work: impl FnOnce() -> T) -> T {
        self.0.store(true, Ordering::Relaxed);
        let made = work();
        self.0.store(false, Ordering::Relaxed);
        made
    }

    /// Whether it is under way.
    pub fn is_under_way(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}
