//! Decoding on arrival: each level is decoded while the next one is being exposed.

use super::Plan;
use super::run::Run;
use crate::head::seam;
use algo::frame::FrameView;
use algo::pattern::MAX_SHIFTS;
use algo::phase::{Arrived, DecodeError};
use algo::pipeline::{arrive, arrive_rest};
use hal::frame::Frame;
use std::sync::PoisonError;

/// The decoded levels of a sequence that is being exposed.
#[derive(Debug)]
pub struct Arriving {
    sequence: usize,
    /// `None` if the recipe has no such sequence, or its frames do not fit it.
    arrived: Option<Arrived>,
}

impl Arriving {
    /// The index of the sequence.
    pub(super) fn sequence(&self) -> usize {
        self.sequence
    }
}

impl Plan {
    /// Begins a measurement with a sequence.
    pub fn arriving(&self, sequence: usize) -> Arriving {
        Arriving {
            sequence,
            arrived: self.runs.get(sequence).map(Run::room),
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
}

impl Run {
    /// The frames of all levels but the finest.
    fn coarser(&self) -> impl ExactSizeIterator<Item = &[usize]> {
        let levels = self.production.decoder().levels();
        let coarser = levels.len().saturating_sub(1);
        levels.take(coarser)
    }

    /// The decoded levels of a sequence, all but the finest, and the views of that. The levels that
    /// have not arrived yet are decoded.
    pub(super) fn complete<'a>(
        &self,
        arriving: Arriving,
        frames: &[FrameView<'a>],
    ) -> Result<(Arrived, heapless::Vec<FrameView<'a>, MAX_SHIFTS>), DecodeError> {
        self.production.check(frames)?;
        let mut arrived = arriving.arrived.unwrap_or_else(|| self.room());
        let finest = arrive_rest(self.production.decoder(), frames, &mut arrived)?;
        Ok((arrived, finest))
    }

    /// Keeps the memory of decoded levels for the next measurement.
    pub(super) fn keep(&self, arrived: Arrived) {
        *self.arrived.lock().unwrap_or_else(PoisonError::into_inner) = Some(arrived);
    }

    /// Memory for decoded levels.
    fn room(&self) -> Arrived {
        let mut kept = self.arrived.lock().unwrap_or_else(PoisonError::into_inner);
        let production = &self.production;
        let (width, height) = (
            production.cubics().surface().width,
            production.window().len(),
        );
        let room = kept.take();
        let mut room = room.unwrap_or_else(|| production.decoder().arrived(width, height));
        room.restart();
        room
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
