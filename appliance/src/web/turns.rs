//! Which of a session's tries of an edit is answered: the newest.

use std::collections::HashMap;
use std::collections::hash_map::DefaultHasher;
use std::hash::{Hash as _, Hasher as _};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tokio::sync::watch;

/// The tries that are being answered, by session.
#[derive(Clone, Default)]
pub(super) struct Tries(Arc<Mutex<RunningTries>>);

#[derive(Default)]
struct RunningTries {
    number: u64,
    running: HashMap<u64, (u64, watch::Sender<()>)>,
}

/// A try that is being answered; dropped, it is over.
pub(super) struct Turn {
    tries: Tries,
    session: u64,
    number: u64,
    watched: Watched,
}

/// What the thread that works on a try asks.
#[derive(Clone)]
pub(super) struct Watched {
    /// Closed when the try is over.
    open: watch::Receiver<()>,
}

impl Watched {
    /// Whether nobody waits for the answer any more.
    pub(super) fn is_over(&self) -> bool {
        self.open.has_changed().is_err()
    }
}

impl Turn {
    /// What the thread that works on it asks.
    pub(super) fn watched(&self) -> Watched {
        self.watched.clone()
    }

    /// Waits until it is over.
    pub(super) async fn over(&mut self) {
        // Nothing is ever sent: it ends when the sender is gone.
        let _ = self.watched.open.changed().await;
    }
}

impl Tries {
    fn inside(&self) -> MutexGuard<'_, RunningTries> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Begins a try of a session, which has this token; the one before is over.
    pub(super) fn begin(&self, token: &str) -> Turn {
        let mut hash = DefaultHasher::new();
        token.hash(&mut hash);
        let session = hash.finish();
        let (sender, open) = watch::channel(());
        let mut inside = self.inside();
        inside.number += 1;
        let number = inside.number;
        inside.running.insert(session, (number, sender));
        drop(inside);
        Turn {
            tries: self.clone(),
            session,
            number,
            watched: Watched { open },
        }
    }
}

impl Drop for Turn {
    fn drop(&mut self) {
        let mut inside = self.tries.inside();
        let own = inside.running.get(&self.session);
        if own.is_some_and(|(number, _)| *number == self.number) {
            inside.running.remove(&self.session);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_one_session_the_newest_try_is_open_and_other_sessions_do_not_matter() {
        let tries = Tries::default();
        let is_over = |turn: &Turn| turn.watched.is_over();
        let (first, other) = (tries.begin("a"), tries.begin("b"));
        assert!(!is_over(&first) && !is_over(&other));
        let second = tries.begin("a");
        assert!(is_over(&first) && !is_over(&second) && !is_over(&other));
        // One that was given up does not end the newer one.
        drop(first);
        assert!(!is_over(&second));
        drop((second, other));
        assert!(tries.inside().running.is_empty());
    }
}
