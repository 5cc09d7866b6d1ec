//! What several tests need and takes long is made once for all of them.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// Values by what they are made of.
pub struct Once<K, V>(Mutex<BTreeMap<K, Cell<V>>>);

type Cell<V> = Arc<OnceLock<Arc<V>>>;

impl<K: Ord, V> Once<K, V> {
    /// Nothing is made yet.
    pub const fn new() -> Self {
        Self(Mutex::new(BTreeMap::new()))
    }

    /// The value of this key; the first test that asks for it makes it, others wait meanwhile.
    pub fn get(&self, key: K, make: impl FnOnce() -> V) -> Arc<V> {
        let mut all = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let cell = Arc::clone(all.entry(key).or_default());
        drop(all);
        Arc::clone(cell.get_or_init(|| Arc::new(make())))
    }
}

impl<K: Ord, V> Default for Once<K, V> {
    fn default() -> Self {
        Self::new()
    }
}
