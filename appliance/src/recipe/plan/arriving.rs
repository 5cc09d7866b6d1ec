//! Decoding on arrival: each level is decoded while the next one is being exposed.

use super::Plan;
use super::run::Run;
use crate::head::seam;
use algo::frame::FrameView;
use algo::pattern::MAX_SHIFTS;
use algo::phase::Arrived;
use algo::pipeline::arrive;
use hal::frame::Frame;
use std::sync::PoisonError;

/// The decoded levels of a sequence that is being exposed.
#[derive(Debug)]
pub struct Arriving {
    sequence: usize,
    /// `None` if nothing can be decoded before the last frame.
    arrived: Option<Arrived>,
}

impl Arriving {
    /// A measurement without decoding on arrival.
    pub(super) fn none(sequence: usize) -> Self {
        let arrived = None;
        Self { sequence, arrived }
    }

    /// The index of the sequence.
    pub(super) fn sequence(&self) -> usize {
        self.sequence
    }
}

impl Plan {
    /// Begins a measurement with a sequence.
    pub fn arriving(&self, sequence: usize) -> Arriving {
        let room = self.runs.get(sequence).and_then(Run::room);
        Arriving {
            sequence,
            arrived: room,
        }
    }

    /// Whether the frames so far complete a level that can be decoded now.
    pub fn can_arrive(&self, arriving: &Arriving, frames: usize) -> bool {
        let (Some(run), Some(arrived)) = (self.runs.get(arriving.sequence), &arriving.arrived)
        else {
            return false;
        };
        let places = run.coarser().nth(arrived.levels());
        places.is_some_and(|places| places.iter().all(|&at| at < frames))
    }

    /// Decodes the level that the frames so far complete.
    pub fn arrive(&self, arriving: &mut Arriving, frames: &[Frame]) {
        let (Some(run), Some(arrived)) = (self.runs.get(arriving.sequence), &mut arriving.arrived)
        else {
            return;
        };
        let decoder = run.production.decoder();
        let places = run.coarser().nth(arrived.levels()).unwrap_or(&[]);
        let views = views(places, frames);
        // Frames that do not fit are reported when all of them are inspected.
        if views.is_none_or(|views| arrive(decoder, &views, arrived).is_err()) {
            arriving.arrived = None;
        }
    }

    /// Calls `inspect` with the decoded levels and the frames of the finest one, if all levels but
    /// the finest are decoded. Their memory goes back to the run.
    pub(super) fn with_arrived<R>(
        &self,
        arriving: Arriving,
        frames: &[Frame],
        inspect: impl FnOnce(Option<(&Arrived, &[FrameView<'_>])>) -> R,
    ) -> R {
        let Arriving {
            sequence,
            arrived: Some(arrived),
        } = arriving
        else {
            return inspect(None);
        };
        let Some(run) = self
            .runs
            .get(sequence)
            .filter(|run| run.indices.len() == frames.len())
        else {
            return inspect(None);
        };
        let complete = arrived.levels() == run.coarser().len();
        let last = run.production.decoder().levels().last().unwrap_or(&[]);
        let views = views(last, frames).filter(|_| complete);
        let done = inspect(views.as_deref().map(|views| (&arrived, views)));
        *run.arrived.lock().unwrap_or_else(PoisonError::into_inner) = Some(arrived);
        done
    }
}

impl Run {
    /// The frames of all levels but the finest.
    fn coarser(&self) -> impl ExactSizeIterator<Item = &[usize]> {
        let levels = self.production.decoder().levels();
        let coarser = levels.len().saturating_sub(1);
        levels.take(coarser)
    }

    /// Memory for them; `None` if the sequence has one level only.
    fn room(&self) -> Option<Arrived> {
        if self.coarser().len() == 0 {
            return None;
        }
        let mut kept = self.arrived.lock().unwrap_or_else(PoisonError::into_inner);
        let production = &self.production;
        let (width, height) = (
            production.cubics().surface().width,
            production.window().len(),
        );
        let room = kept.take();
        let mut room = room.unwrap_or_else(|| production.decoder().arrived(width, height));
        room.restart();
        Some(room)
    }
}

/// Views of some of the frames; `None` if a frame is missing or inconsistent.
fn views<'a>(
    places: &[usize],
    frames: &'a [Frame],
) -> Option<heapless::Vec<FrameView<'a>, MAX_SHIFTS>> {
    let view = |&at: &usize| seam::view(frames.get(at)?).ok();
    places.iter().map(view).collect()
}
