//! Input of an inspection: all frames, or those of the finest level and what was decoded of the
//! others on arrival.

use super::Production;
use crate::frame::FrameView;
use crate::phase::{Arrived, DecodeError};
use crate::pipeline::PhaseMap;

/// What a part is inspected from; either form gives the same bits.
#[derive(Clone, Copy, Debug)]
pub enum Input<'a> {
    /// All frames of the sequence.
    Frames(&'a [FrameView<'a>]),
    /// What was decoded of all other levels when they arrived ([`crate::pipeline::arrive`]), and
    /// the frames of the finest level.
    Finest(&'a Arrived, &'a [FrameView<'a>]),
    /// The phases of the whole frame, as a pair gives them ([`Production::place_pair`]).
    Phases(&'a PhaseMap),
}

impl Production {
    /// Checks number and size of the frames.
    pub(super) fn check(&self, input: Input<'_>) -> Result<(), DecodeError> {
        let frames = match input {
            Input::Frames(frames) => self.decoder.check(frames).map(|()| frames)?,
            Input::Finest(arrived, frames) => {
                self.decoder.check_last(frames, arrived).map(|()| frames)?
            }
            Input::Phases(_) => &[],
        };
        let expected = self.size();
        let given = match (input, frames) {
            (Input::Phases(map), _) => (map.width, map.phase.len() / map.width.max(1)),
            (_, frames) => (frames[0].width(), frames[0].height()),
        };
        match given == expected {
            true => Ok(()),
            false => Err(DecodeError::FrameSize {
                frame: 0,
                expected,
                given,
            }),
        }
    }
}
