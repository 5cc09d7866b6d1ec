//! Which guided study runs.

use crate::history::design::StudyTrial;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// The study that runs, if one does, and what was said of the last one. Cheap to clone.
#[derive(Clone, Debug, Default)]
pub(super) struct Desk(Arc<Mutex<RunningStudy>>);

#[derive(Debug, Default)]
pub(super) struct RunningStudy {
    /// Counts starts and pauses, so that a task knows whether it is still the one that runs.
    pub turn: u64,
    /// The study, and the trial that is taken again.
    pub study: Option<(u32, Option<StudyTrial>)>,
    /// What happened last, and to which study.
    pub note: Option<(u32, String)>,
}

impl Desk {
    /// To be read or changed.
    pub fn lock(&self) -> MutexGuard<'_, RunningStudy> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The turn in which a study runs, if it does.
    pub fn turn_of(&self, number: u32) -> Option<u64> {
        let running = self.lock();
        running
            .study
            .filter(|(other, _)| *other == number)
            .map(|_| running.turn)
    }

    /// Says something of the study of this turn.
    pub fn say(&self, turn: u64, words: String) {
        let mut running = self.lock();
        if running.turn == turn {
            running.note = running.study.map(|(number, _)| (number, words));
        }
    }

    /// Pauses the study of this turn, with words.
    pub fn pause(&self, turn: u64, words: String) {
        let mut running = self.lock();
        if running.turn == turn {
            running.turn += 1;
            running.note = running.study.take().map(|(number, _)| (number, words));
        }
    }
}
