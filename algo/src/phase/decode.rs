//! Rows of frames → rows of absolute phase, modulation and trust.

use super::demodulate::{LevelKernel, LevelPixel};
use super::trust::Trust;
use super::unwrap::Unwrapper;
use crate::frame::{FrameView, Samples};
use crate::pattern::{MAX_LEVELS, PhaseRange, Sequence, SequenceError, Unwrapping};
use crate::units::{AbsolutePhase, Modulation};
use alloc::vec::Vec;
use core::fmt;

/// Everything that decoding a sequence needs, worked out once.
#[derive(Clone, Debug)]
pub struct Decoder {
    kernels: heapless::Vec<LevelKernel, MAX_LEVELS>,
    unwrapper: Unwrapper,
    unwrapping: Unwrapping,
    frame_count: usize,
    bit_depth: u8,
}

/// One row of results, each slice as long as the row.
#[derive(Debug)]
pub struct PhaseRow<'a> {
    /// Φ in turns of the phase function, [`AbsolutePhase::UNKNOWN`] where not resolved.
    pub phase: &'a mut [AbsolutePhase],
    /// The modulation that decides the phase's accuracy: of the finest level, or the weighted mean
    /// of dense levels. Also where not resolved, then of the finest level.
    pub modulation: &'a mut [Modulation],
    /// Resolved, or the first reason why not.
    pub trust: &'a mut [Trust],
}

/// A sequence that cannot be decoded.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum DecodeError {
    /// Its levels are of no known form.
    Sequence(SequenceError),
    /// Samples of fewer than 8 or more than 16 bits.
    BitDepth(u8),
    /// The number of frames is not the sequence's.
    FrameCount {
        /// Frames of the sequence.
        expected: usize,
        /// Frames given.
        given: usize,
    },
    /// A frame is not of the size of the first.
    FrameSize {
        /// Place of the frame.
        frame: usize,
        /// Width and height of the first frame.
        expected: (usize, usize),
        /// Width and height of this one.
        given: (usize, usize),
    },
    /// A frame's samples are not of the width that the bit depth needs.
    SampleWidth {
        /// Place of the frame.
        frame: usize,
        /// Bits per sample of the plan.
        bit_depth: u8,
    },
}

impl fmt::Display for DecodeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Sequence(error) => error.fmt(f),
            Self::BitDepth(bits) => write!(f, "samples of {bits} bits: 8 to 16 can be decoded"),
            Self::FrameCount { expected, given } => {
                write!(
                    f,
                    "{given} frames were given where the sequence has {expected}"
                )
            }
            Self::FrameSize {
                frame,
                expected,
                given,
            } => write!(
                f,
                "frame {frame} is {}x{} where {}x{} was expected",
                given.0, given.1, expected.0, expected.1
            ),
            Self::SampleWidth { frame, bit_depth } => write!(
                f,
                "frame {frame} has the wrong sample type for {bit_depth} bits (u8 for 8, u16 above)"
            ),
        }
    }
}

impl core::error::Error for DecodeError {}

impl From<SequenceError> for DecodeError {
    fn from(error: SequenceError) -> Self {
        Self::Sequence(error)
    }
}

impl Decoder {
    /// Prepares decoding of `sequence`, projected from a phase function with this range, from
    /// samples of `bit_depth` bits.
    ///
    /// # Errors
    /// If the levels are of no known form or the bit depth is not 8 to 16.
    pub fn new(sequence: &Sequence, range: PhaseRange, bit_depth: u8) -> Result<Self, DecodeError> {
        if !(8..=16).contains(&bit_depth) {
            return Err(DecodeError::BitDepth(bit_depth));
        }
        let unwrapping = Unwrapping::recognise(sequence, range)?;
        Ok(Self {
            kernels: sequence
                .levels()
                .iter()
                .map(|level| LevelKernel::new(level, bit_depth))
                .collect(),
            unwrapper: Unwrapper::new(unwrapping, sequence, range),
            unwrapping,
            frame_count: sequence.frame_count(),
            bit_depth,
        })
    }

    /// How the levels are unwrapped.
    pub fn unwrapping(&self) -> Unwrapping {
        self.unwrapping
    }

    /// Full scale of a sample, in counts.
    pub fn full_scale(&self) -> u16 {
        ((1_u32 << self.bit_depth) - 1) as u16
    }

    /// σ_Φ in turns of a resolved pixel: σ_I / 2π · √(2 / Σ N_i r_i² B_i²).
    ///
    /// `noise` is σ_I, the noise of one sample in counts.
    pub fn phase_noise(&self, modulation: Modulation, noise: f64) -> f64 {
        let counts = modulation.counts(self.full_scale());
        let information = self.unwrapper.information() * counts * counts;
        noise / core::f64::consts::TAU * libm::sqrt(2.0 / information)
    }

    /// Checks that `frames` are what this decoder was made for: count, equal size, sample type.
    ///
    /// # Errors
    /// Naming the frame that does not fit.
    pub fn check(&self, frames: &[FrameView<'_>]) -> Result<(), DecodeError> {
        if frames.len() != self.frame_count {
            return Err(DecodeError::FrameCount {
                expected: self.frame_count,
                given: frames.len(),
            });
        }
        let expected = (frames[0].width(), frames[0].height());
        for (frame, view) in frames.iter().enumerate() {
            let given = (view.width(), view.height());
            if given != expected {
                return Err(DecodeError::FrameSize {
                    frame,
                    expected,
                    given,
                });
            }
            let eight = given.1 == 0 || matches!(view.row(0), Samples::Eight(_));
            if eight != (self.bit_depth == 8) {
                return Err(DecodeError::SampleWidth {
                    frame,
                    bit_depth: self.bit_depth,
                });
            }
        }
        Ok(())
    }

    /// Decodes row `v` of frames that [`Self::check`] has passed.
    ///
    /// `map` is the row of the known map for dense and single-level sequences and is not looked at
    /// otherwise. `scratch` is reused from row to row.
    pub fn row(
        &self,
        frames: &[FrameView<'_>],
        v: usize,
        map: Option<&[AbsolutePhase]>,
        scratch: &mut Scratch,
        out: PhaseRow<'_>,
    ) {
        let width = out.phase.len();
        scratch.demodulate(&self.kernels, frames, v, width);
        let levels = self.kernels.len();
        let mut pixel = [LevelPixel::default(); MAX_LEVELS];
        let pixel = &mut pixel[..levels];
        for u in 0..width {
            for (level, here) in pixel.iter_mut().enumerate() {
                *here = scratch.levels[level * width + u];
            }
            let known = map.map_or(AbsolutePhase::UNKNOWN, |map| map[u]);
            let finest = Modulation::from_bits(pixel[levels - 1].modulation);
            let (trust, phase, modulation) = match self.distrust(pixel) {
                Some(reason) => (reason, AbsolutePhase::UNKNOWN, finest),
                None => match self.unwrapper.pixel(pixel, known) {
                    Some(found) => (Trust::Resolved, found.phase, found.modulation),
                    None => (Trust::Residual, AbsolutePhase::UNKNOWN, finest),
                },
            };
            out.trust[u] = trust;
            out.phase[u] = phase;
            out.modulation[u] = modulation;
        }
    }

    /// The first reason in the samples themselves not to trust a pixel.
    #[inline(always)]
    fn distrust(&self, levels: &[LevelPixel]) -> Option<Trust> {
        if levels[0].weak {
            Some(Trust::Dark)
        } else if levels.iter().any(|level| level.weak) {
            Some(Trust::LowModulation)
        } else if levels.iter().any(|level| level.saturated) {
            Some(Trust::Saturated)
        } else {
            None
        }
    }
}

/// Buffers of one row, reused.
#[derive(Debug, Default)]
pub struct Scratch {
    /// Level-major: one row per level.
    levels: Vec<LevelPixel>,
}

impl Scratch {
    fn demodulate(
        &mut self,
        kernels: &[LevelKernel],
        frames: &[FrameView<'_>],
        v: usize,
        width: usize,
    ) {
        self.levels
            .resize(kernels.len() * width, LevelPixel::default());
        let out = self.levels.chunks_exact_mut(width.max(1));
        let (mut eight, mut sixteen) = (Vec::new(), Vec::new());
        for frame in frames {
            match frame.row(v) {
                Samples::Eight(row) => eight.push(row),
                Samples::Sixteen(row) => sixteen.push(row),
            }
        }
        for (kernel, out) in kernels.iter().zip(out) {
            if sixteen.is_empty() {
                kernel.row(&eight, out);
            } else {
                kernel.row(&sixteen, out);
            }
        }
    }
}
