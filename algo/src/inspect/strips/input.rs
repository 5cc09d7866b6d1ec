//! Input of an inspection: the frames, or the levels that were decoded on arrival.

use super::Production;
use crate::frame::FrameView;
use crate::phase::{Arrived, DecodeError, PhaseRow};
use core::ops::Range;

/// What a part is inspected from; either way gives the same bits.
#[derive(Clone, Copy, Debug)]
pub enum Light<'a> {
    /// All frames of the sequence.
    Frames(&'a [FrameView<'a>]),
    /// The frames of the finest level, and what all others said when they arrived ([`crate::pipeline::arrive`]).
    Finest(&'a Arrived, &'a [FrameView<'a>]),
}

impl Production {
    /// Number and size of the frames.
    pub(super) fn check(&self, light: Light<'_>) -> Result<(), DecodeError> {
        let frames = match light {
            Light::Frames(frames) => self.decoder.check(frames).map(|()| frames)?,
            Light::Finest(arrived, frames) => {
                self.decoder.check_last(frames, arrived).map(|()| frames)?
            }
        };
        let expected = self.size();
        let given = (frames[0].width(), frames[0].height());
        match given == expected {
            true => Ok(()),
            false => Err(DecodeError::FrameSize {
                frame: 0,
                expected,
                given,
            }),
        }
    }

    /// Decodes columns of row `v`.
    pub(super) fn decode(
        &self,
        light: Light<'_>,
        v: usize,
        columns: Range<usize>,
        out: PhaseRow<'_>,
    ) {
        let (decoder, map) = (&self.decoder, self.map_row(v));
        match light {
            Light::Frames(frames) => decoder.row(frames, v, map, columns, out),
            Light::Finest(arrived, frames) => {
                decoder.last_row(arrived, frames, v, map, columns, out);
            }
        }
    }
}
