//! Stage 1, decode: a row of all frames → absolute phase, modulation and trust of its pixels.

use super::golden::Golden;
use crate::frame::{FrameView, SampleNoise};
use crate::pattern::MAX_SHIFTS;
use crate::phase::{Arrived, DecodeError, Decoder, PhaseRow};
use crate::pipeline::PhaseMap;
use crate::units::{AbsolutePhase, Modulation};
use core::ops::Range;

/// What a part is inspected from; either form gives the same bits.
#[derive(Clone, Copy, Debug)]
pub enum Input<'a> {
    /// All frames of the sequence.
    Frames(&'a [FrameView<'a>]),
    /// What was decoded of all other levels when they arrived ([`crate::pipeline::arrive`]), and
    /// the frames of the finest level.
    Finest(&'a Arrived, &'a [FrameView<'a>]),
    /// The phases of the whole frame, as a pair gives them
    /// ([`place_pair`](crate::inspect::Production::place_pair)).
    Phases(&'a PhaseMap),
}

/// How frames become phases, and how noisy these are.
#[derive(Debug)]
pub struct PhasePlan {
    pub decoder: Decoder,
    /// The noise of one sample.
    pub noise: SampleNoise,
    /// σ of a sample in counts, the same at all pixels, with which σ_z of the compared part as
    /// taught has the same RMS.
    pub noise_counts: f64,
    /// The same as [`crate::pipeline::CubicInput::noise`].
    pub variance_scale: f32,
}

impl PhasePlan {
    /// Checks number and size of the frames.
    pub fn check(&self, input: Input<'_>, expected: (usize, usize)) -> Result<(), DecodeError> {
        let size = |frames: &[FrameView<'_>]| (frames[0].width(), frames[0].height());
        let given = match input {
            Input::Frames(frames) => self.decoder.check(frames).map(|()| size(frames)),
            Input::Finest(arrived, frames) => {
                let checked = self.decoder.check_last(frames, arrived);
                checked.map(|()| size(frames))
            }
            Input::Phases(map) => Ok((map.width, map.phase.len() / map.width.max(1))),
        }?;
        match given == expected {
            true => Ok(()),
            false => Err(DecodeError::FrameSize {
                frame: 0,
                expected,
                given,
            }),
        }
    }

    /// The frames of the finest level; none of phases.
    pub fn finest<'a>(&self, input: Input<'a>) -> Option<heapless::Vec<FrameView<'a>, MAX_SHIFTS>> {
        match input {
            Input::Frames(frames) => {
                let places = self.decoder.levels().last()?;
                places.iter().map(|&at| frames.get(at).copied()).collect()
            }
            Input::Finest(_, frames) => heapless::Vec::from_slice(frames).ok(),
            Input::Phases(_) => None,
        }
    }

    /// Decodes columns of row `v` into a map of one row; the others keep what they had.
    pub fn decode(
        &self,
        golden: &Golden,
        input: Input<'_>,
        v: usize,
        columns: Range<usize>,
        row: &mut PhaseMap,
    ) {
        let out = PhaseRow {
            phase: &mut row.phase,
            modulation: &mut row.modulation,
            trust: &mut row.trust,
        };
        let (decoder, map) = (&self.decoder, self.map_row(golden, v));
        match input {
            Input::Frames(frames) => decoder.row(frames, v, map, columns, out),
            Input::Finest(arrived, frames) => {
                decoder.last_row(arrived, frames, v, map, columns, out);
            }
            Input::Phases(phases) => {
                let there = v * phases.width + columns.start..v * phases.width + columns.end;
                out.phase[columns.clone()].copy_from_slice(&phases.phase[there.clone()]);
                out.modulation[columns.clone()].copy_from_slice(&phases.modulation[there.clone()]);
                out.trust[columns].copy_from_slice(&phases.trust[there]);
            }
        }
    }

    /// The row of the map that phases are unwrapped about; empty if the sequence needs none.
    pub fn map_row<'a>(&self, golden: &'a Golden, v: usize) -> &'a [AbsolutePhase] {
        let width = golden.size().0;
        match self.decoder.unwrapping().needs_map() {
            true => &golden.map()[v * width..(v + 1) * width],
            false => &[],
        }
    }

    /// σ_z in nm of a pixel with this modulation and ∂z/∂Φ; of a pair that of the pixel's own
    /// samples, without its window.
    pub fn sigma_nm(&self, modulation: Modulation, slope: f64) -> f64 {
        let turns = self.decoder.phase_noise(modulation, self.noise);
        libm::fabs(turns * slope) * 1e6
    }
}
