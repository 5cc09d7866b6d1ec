//! The heights of the last cycle, made only when somebody wants to see them.
//!
//! The measuring task keeps the frames of the last cycle. Whoever wants its picture asks and waits; the measuring task
//! answers when it has nothing more urgent to do.

use crate::plan::Maps;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Longest wait for the measuring task: it may be in the middle of a cycle.
const PATIENCE: Duration = Duration::from_secs(3);

/// The maps of the last cycle, for the page.
#[derive(Clone, Debug, Default)]
pub struct LastMaps(Arc<(Mutex<State>, Condvar)>);

#[derive(Debug, Default)]
enum State {
    /// Nothing was measured.
    #[default]
    Nothing,
    /// There are frames; whether somebody wants to see them.
    Frames { wanted: bool },
    /// Somebody wanted to see them.
    Made(Arc<Maps>),
}

impl LastMaps {
    fn state(&self) -> MutexGuard<'_, State> {
        self.0.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The maps of the last cycle that had any. Waits until they are made, but not for ever.
    pub fn get(&self) -> Option<Arc<Maps>> {
        let mut state = self.state();
        if let State::Frames { wanted } = &mut *state {
            *wanted = true;
        }
        let waiting = |state: &mut State| matches!(state, State::Frames { .. });
        let (state, _) = self
            .0
            .1
            .wait_timeout_while(state, PATIENCE, waiting)
            .unwrap_or_else(PoisonError::into_inner);
        match &*state {
            State::Made(maps) => Some(maps.clone()),
            State::Nothing | State::Frames { .. } => None,
        }
    }

    /// There are frames of a newer cycle. Who waits for the maps of the one before gets these.
    pub fn outdated(&self) {
        let mut state = self.state();
        if let State::Frames { wanted: true } = *state {
            return;
        }
        *state = State::Frames { wanted: false };
    }

    /// The frames of the last cycle are gone; maps that were made stay.
    pub fn forget(&self) {
        let mut state = self.state();
        if let State::Frames { .. } = *state {
            *state = State::Nothing;
            self.0.1.notify_all();
        }
    }

    /// Whether somebody waits.
    pub fn wanted(&self) -> bool {
        matches!(*self.state(), State::Frames { wanted: true })
    }

    /// Answers those who wait; `None` where there is nothing to show.
    pub fn set(&self, maps: Option<Maps>) {
        *self.state() = maps.map_or(State::Nothing, |maps| State::Made(Arc::new(maps)));
        self.0.1.notify_all();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn maps(width: usize) -> Maps {
        Maps {
            width,
            height_mm: vec![0.0; width],
        }
    }

    #[test]
    fn maps_are_made_for_who_waits_and_not_before() {
        let latest = LastMaps::default();
        assert!(latest.get().is_none());
        latest.outdated();
        assert!(!latest.wanted());
        let page = {
            let latest = latest.clone();
            std::thread::spawn(move || latest.get().map(|maps| maps.width))
        };
        while !latest.wanted() {
            std::thread::yield_now();
        }
        // A newer cycle ends in between: its maps are those that the page gets.
        latest.outdated();
        assert!(latest.wanted());
        latest.set(Some(maps(3)));
        assert_eq!(page.join().unwrap(), Some(3));
        assert_eq!(latest.get().map(|maps| maps.width), Some(3));
        latest.outdated();
        assert!(!latest.wanted());
        latest.set(None);
        assert!(latest.get().is_none());
    }
}
