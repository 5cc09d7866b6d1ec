//! Measuring with a pair of frames, the fringe and its complement, about the golden part.
//!
//! 1. **picture** (`picture`): the mean of both frames has no fringes; its edges tell where the part lies.
//! 2. **expected** (`expected`): the phase that golden would have there.
//! 3. **window** (`window`): half the difference is the fringe alone; fitted in a window about each pixel, it gives the phase.
//! 4. The part's motion is found from these phases as from those of any sequence, in all six components; those that the shape does
//!    not determine keep what the picture has found. Then stages 2 and 3 are repeated with it, and their map goes through the
//!    ordinary inspection ([`Input::Phases`]).
//!
//! Neighbouring phases share pixels. Their σ is therefore that of the two samples of the pixel alone, which is right for means over
//! areas that are large against the window; means over smaller squares are less noisy (`shared`).

mod coarse;
mod expected;
mod picture;
mod shared;
mod window;

pub use picture::{Found, Picture};
pub(super) use shared::{correlated, smoothed};

use super::{Input, Production, Strips};
use crate::frame::FrameView;
use crate::inspect::align::{Motion, Placed};
use crate::phase::DecodeError;
use crate::pipeline::{PhaseMap, for_each};
use alloc::vec::Vec;
use coarse::Coarse;
use window::{BAND_ROWS, Band, Expected, Seen, Windows};

/// The buffers of a pair, allocated once.
#[derive(Debug)]
pub struct PairBuffers {
    windows: Windows,
    expected: Vec<Expected>,
    /// What was measured last.
    phases: PhaseMap,
    bands: Vec<Band>,
    pictures: Vec<Coarse>,
}

impl PairBuffers {
    /// What was measured last, for [`Input::Phases`].
    pub fn phases(&self) -> &PhaseMap {
        &self.phases
    }
}

/// How a part lies by a pair.
#[derive(Clone, Debug)]
pub struct PairPlaced {
    /// By its picture; none where that does not determine it.
    pub found: Option<Found>,
    /// By its phases; none as in [`Production::place`].
    pub placed: Option<Placed>,
}

impl Production {
    /// Buffers for frames of this size.
    pub fn pair_buffers(&self) -> PairBuffers {
        let (width, height) = self.size();
        PairBuffers {
            windows: Windows::new(self.decoder.bit_depth(), self.noise_counts),
            expected: self.as_taught().collect(),
            phases: PhaseMap::new(width, height),
            bands: window::bands(height),
            pictures: Vec::new(),
        }
    }

    /// Golden's picture, from its modulation in counts (row-major), for parts within `tolerance_px` pixels. None where parts are not
    /// aligned, or the picture has no edges.
    pub fn picture(&self, modulation: &[f32], tolerance_px: f64) -> Option<Picture> {
        let centre = self.alignment.as_ref()?.centre;
        let surface = self.cubics.surface();
        Picture::new(
            &self.triangulator,
            surface,
            modulation,
            centre,
            tolerance_px,
        )
    }

    /// Finds how the part lies, and measures its phases into the buffers.
    ///
    /// # Errors
    /// If the frames are not two of this size and bit depth.
    pub fn place_pair(
        &self,
        frames: &[FrameView<'_>],
        picture: Option<&Picture>,
        strips: &mut Strips,
        buffers: &mut PairBuffers,
    ) -> Result<PairPlaced, DecodeError> {
        self.decoder.check(frames)?;
        let &[plus, minus] = frames else {
            return Err(DecodeError::FrameCount {
                expected: 2,
                given: frames.len(),
            });
        };
        let frames = [plus, minus];
        let triangulator = &self.triangulator;
        let found =
            picture.and_then(|picture| picture.find(triangulator, frames, &mut buffers.pictures));
        let motion = found.map(|found| found.motion);
        self.fit_pair(frames, motion.as_ref(), buffers);
        let placed = self.place_from(Input::Phases(&buffers.phases), strips, motion)?;
        if let Some(placed) = &placed {
            self.fit_pair(frames, Some(&placed.motion), buffers);
        }
        Ok(PairPlaced { found, placed })
    }

    /// Measures the phases of a part that lies so.
    fn fit_pair(
        &self,
        frames: [FrameView<'_>; 2],
        motion: Option<&Motion>,
        buffers: &mut PairBuffers,
    ) {
        match motion {
            Some(motion) => self.expect(motion, &mut buffers.expected),
            None => {
                let out = buffers.expected.iter_mut();
                out.zip(self.as_taught())
                    .for_each(|(out, taught)| *out = taught);
            }
        }
        let PairBuffers {
            windows,
            expected,
            phases,
            bands,
            ..
        } = buffers;
        let seen = Seen { frames, expected };
        let mut rows = phases.rows();
        let work = rows.chunks_mut(BAND_ROWS).zip(bands).collect();
        for_each(work, |at, (rows, band)| {
            windows.fit(seen, at * BAND_ROWS, rows, band);
        });
    }
}

#[cfg(test)]
mod tests;
