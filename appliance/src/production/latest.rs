//! Pictures and downloads of the last cycle, computed only on request.
//!
//! The measuring task keeps the plan and the frames of the last cycle. A request for something
//! computed from them is queued, and its thread waits; the measuring task answers when it has
//! nothing more urgent to do.

use crate::history::JudgedPart;
use crate::recipe::plan::Layers;
use std::sync::mpsc::{SyncSender, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Longest wait until the measuring task, which may be in the middle of a cycle, takes a request.
const PATIENCE: Duration = Duration::from_secs(3);
/// Most requests that wait at a time.
const MOST_WAITING: usize = 8;

/// A request, which sends its own answer.
type LastCycleRequest = Box<dyn FnOnce(Option<&JudgedPart>) + Send>;

/// Requests about the last cycle. Cheap to clone.
#[derive(Clone, Default)]
pub struct LastCycleRequests(Arc<Mutex<LastCycleQueue>>);

#[derive(Default)]
struct LastCycleQueue {
    waiting: Vec<LastCycleRequest>,
    /// The layers (height, deviation and modulation maps) that were computed last, with the SEQ of
    /// their result.
    layers: Option<(u32, Arc<Layers>)>,
}

impl LastCycleRequests {
    fn inside(&self) -> MutexGuard<'_, LastCycleQueue> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Has the measuring task compute `answer`, and waits for it: 3 s at most until it is begun, and
    /// for as long as it takes then. `None` if there are no frames, too many requests wait, or the
    /// task is busy for longer: then the request stays in the queue, and its answer is computed and
    /// dropped.
    pub fn ask<T: Send + 'static>(
        &self,
        answer: impl FnOnce(&JudgedPart) -> T + Send + 'static,
    ) -> Option<T> {
        let (sender, receiver): (SyncSender<Option<T>>, _) = sync_channel(1);
        let (begin, begun) = sync_channel(1);
        let request: LastCycleRequest = Box::new(move |cycle| {
            // The requester may have given up.
            let _ = begin.send(());
            let _ = sender.send(cycle.map(answer));
        });
        let mut inside = self.inside();
        if inside.waiting.len() >= MOST_WAITING {
            return None;
        }
        inside.waiting.push(request);
        drop(inside);
        begun.recv_timeout(PATIENCE).ok()?;
        receiver.recv().ok().flatten()
    }

    /// The layers of the last cycle and the SEQ of its result. Those that were computed last are
    /// returned again if they are of result `seq`, the caller's latest, or if no others can be
    /// computed.
    pub fn layers(&self, seq: u32) -> Option<(u32, Arc<Layers>)> {
        let made = self.inside().layers.clone();
        if let Some((of, _)) = &made
            && *of == seq
        {
            return made;
        }
        let asked = self.ask(|cycle| {
            Some((
                cycle.record.seq,
                Arc::new(cycle.plan.layers(cycle.sequence, &cycle.frames)?),
            ))
        });
        let newest = asked.flatten().or(made);
        self.inside().layers.clone_from(&newest);
        newest
    }

    /// Answers all waiting requests.
    pub fn answer(&self, cycle: Option<&JudgedPart>) {
        for request in std::mem::take(&mut self.inside().waiting) {
            request(cycle);
        }
    }

    /// Whether a request waits.
    pub fn wanted(&self) -> bool {
        !self.inside().waiting.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_request_before_there_are_frames_gets_none_at_once() {
        let last = LastCycleRequests::default();
        assert!(!last.wanted());
        let asking = last.clone();
        let asked = std::thread::spawn(move || asking.ask(|cycle| cycle.record.seq));
        while !last.wanted() {
            std::thread::yield_now();
        }
        last.answer(None);
        assert_eq!(asked.join().unwrap(), None);
    }

    #[test]
    fn more_requests_than_can_wait_are_refused_instead_of_piling_up() {
        let last = LastCycleRequests::default();
        for _ in 0..MOST_WAITING {
            last.inside().waiting.push(Box::new(|_| ()));
        }
        assert_eq!(last.ask(|cycle| cycle.record.seq), None);
        assert_eq!(last.inside().waiting.len(), MOST_WAITING);
    }
}
