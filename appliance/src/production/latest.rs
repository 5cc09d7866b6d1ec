//! What somebody wants to know of the last cycle, worked out only when it is wanted.
//!
//! The measuring task keeps the plan and the frames of the last cycle. Whoever wants something of them asks and waits;
//! the measuring task answers when it has nothing more urgent to do.

use crate::head::calibration::Calibration;
use crate::recipe::plan::{Layers, Plan};
use crate::station::ResultRecord;
use hal::frame::Frame;
use std::sync::mpsc::{SyncSender, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Longest wait for the measuring task: it may be in the middle of a cycle.
const PATIENCE: Duration = Duration::from_secs(3);
/// The most that wait at a time.
const MOST_WAITING: usize = 8;

/// The last cycle as the measuring task holds it.
#[derive(Clone, Copy, Debug)]
pub struct LastCycle<'a> {
    /// Its result.
    pub record: &'a Arc<ResultRecord>,
    /// The recipe that it was judged by.
    pub plan: &'a Arc<Plan>,
    /// Which of the recipe's sequences it was judged by.
    pub sequence: usize,
    /// The frames of that sequence, in its order.
    pub frames: &'a [Frame],
    /// The head's calibration.
    pub calibration: &'a Calibration,
}

impl LastCycle<'_> {
    /// SEQ of its result.
    pub fn seq(&self) -> u32 {
        self.record.seq
    }
}

/// A question, and the way back for its answer.
type Question = Box<dyn FnOnce(Option<LastCycle<'_>>) + Send>;

/// The way to the last cycle. Cheap to clone.
#[derive(Clone, Default)]
pub struct LastMaps(Arc<Mutex<Inside>>);

#[derive(Default)]
struct Inside {
    waiting: Vec<Question>,
    /// The maps that were worked out last, and of which result.
    layers: Option<(u32, Arc<Layers>)>,
}

impl LastMaps {
    fn inside(&self) -> MutexGuard<'_, Inside> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Asks the measuring task, and waits, but not for ever. None if there are no frames, too many ask, or it is too busy.
    pub fn ask<T: Send + 'static>(
        &self,
        answer: impl FnOnce(LastCycle<'_>) -> T + Send + 'static,
    ) -> Option<T> {
        let (sender, receiver): (SyncSender<Option<T>>, _) = sync_channel(1);
        let question: Question = Box::new(move |cycle| {
            // The requester may have given up.
            let _ = sender.send(cycle.map(answer));
        });
        let mut inside = self.inside();
        if inside.waiting.len() >= MOST_WAITING {
            return None;
        }
        inside.waiting.push(question);
        drop(inside);
        receiver.recv_timeout(PATIENCE).ok().flatten()
    }

    /// The maps of the last cycle and the SEQ of its result; of the last one that had any, where the frames are gone.
    pub fn layers(&self, seq: u32) -> Option<(u32, Arc<Layers>)> {
        let made = self.inside().layers.clone();
        if let Some((of, _)) = &made
            && *of == seq
        {
            return made;
        }
        let asked = self.ask(|cycle| {
            Some((
                cycle.seq(),
                Arc::new(cycle.plan.layers(cycle.sequence, cycle.frames)?),
            ))
        });
        let newest = asked.flatten().or(made);
        self.inside().layers.clone_from(&newest);
        newest
    }

    /// Answers those who wait.
    pub fn answer(&self, cycle: Option<LastCycle<'_>>) {
        for question in std::mem::take(&mut self.inside().waiting) {
            question(cycle);
        }
    }

    /// Whether somebody waits.
    pub fn wanted(&self) -> bool {
        !self.inside().waiting.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_asks_before_there_are_frames_is_told_so_at_once() {
        let last = LastMaps::default();
        assert!(!last.wanted());
        let asking = last.clone();
        let asked = std::thread::spawn(move || asking.ask(|cycle| cycle.seq()));
        while !last.wanted() {
            std::thread::yield_now();
        }
        last.answer(None);
        assert_eq!(asked.join().unwrap(), None);
    }

    #[test]
    fn more_than_can_wait_are_refused_instead_of_piling_up() {
        let last = LastMaps::default();
        for _ in 0..MOST_WAITING {
            last.inside().waiting.push(Box::new(|_| ()));
        }
        assert_eq!(last.ask(|cycle| cycle.seq()), None);
        assert_eq!(last.inside().waiting.len(), MOST_WAITING);
    }
}
