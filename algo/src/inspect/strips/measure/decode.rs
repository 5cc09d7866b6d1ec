//! Stage 1, decode: a row of all frames → absolute phase, modulation and trust of its pixels.

use crate::frame::{FrameView, SampleNoise};
use crate::inspect::strips::golden::Golden;
use crate::phase::{Arrived, DecodeError, Decoder, PhaseRow};
use crate::pipeline::PhaseMap;
use crate::units::{AbsolutePhase, Modulation};
use core::ops::Range;

/// What a part is inspected from.
#[derive(Clone, Copy, Debug)]
pub enum Input<'a> {
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
    /// Checks number, size and samples of the frames of a sequence.
    pub fn check_frames(
        &self,
        frames: &[FrameView<'_>],
        expected: (usize, usize),
    ) -> Result<(), DecodeError> {
        self.decoder.check(frames)?;
        check_size((frames[0].width(), frames[0].height()), expected)
    }

    /// Checks that all levels are there, and their size.
    pub fn check(&self, input: Input<'_>, expected: (usize, usize)) -> Result<(), DecodeError> {
        let given = match input {
            Input::Finest(arrived, frames) => {
                self.decoder.check_last(frames, arrived)?;
                arrived.size()
            }
            Input::Phases(map) => (map.width, map.phase.len() / map.width.max(1)),
        };
        check_size(given, expected)
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
            Input::Finest(arrived, frames) => {
                decoder.row(arrived, frames, v, map, columns, out);
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

fn check_size(given: (usize, usize), expected: (usize, usize)) -> Result<(), DecodeError> {
    match given == expected {
        true => Ok(()),
        false => Err(DecodeError::FrameSize {
            frame: 0,
            expected,
            given,
        }),
    }
}
