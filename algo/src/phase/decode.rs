//! The decoder of a sequence: its plan, the predicted noise, and the check that frames fit it.
//! `rows.rs` decodes.

use super::about::About;
use super::arrived::Arrived;
use super::geometric::Geometric;
use super::level::LevelPlan;
use super::light_edge::LightEdges;
use crate::frame::{FrameView, SampleNoise, Samples};
use crate::pattern::{PhaseRange, Sequence, SequenceError, Unwrapping};
use crate::simd::Backend;
use crate::trust::{LeastModulation, Trust};
use crate::units::{AbsolutePhase, Modulation};
use alloc::vec::Vec;
use core::fmt;

/// The plan of decoding a sequence from samples of one bit depth, prepared once.
#[derive(Clone, Debug)]
pub struct Decoder {
    /// From coarse to fine.
    pub(super) levels: Vec<LevelPlan>,
    pub(super) unwrapper: Unwrapper,
    unwrapping: Unwrapping,
    /// Σ N_i r_i² (b_i/b_f)² over the levels that carry the result's accuracy ([`information`]).
    information: f64,
    pub(super) backend: Backend,
    frame_count: usize,
    pub(super) bit_depth: u8,
    least: LeastModulation,
    pub(super) light_edges: Option<LightEdges>,
}

/// How the levels of a pixel become one absolute phase; prepared once per plan.
#[derive(Clone, Debug)]
pub(super) enum Unwrapper {
    /// From coarse to fine.
    Geometric(Geometric),
    /// About a known map.
    About(About),
}

impl Unwrapper {
    pub fn new(
        unwrapping: Unwrapping,
        sequence: &Sequence,
        range: PhaseRange,
    ) -> Result<Self, SequenceError> {
        let levels = sequence.levels();
        Ok(match unwrapping {
            Unwrapping::Geometric => Self::Geometric(Geometric::new(levels, range)?),
            _ => Self::About(About::new(unwrapping, levels).ok_or_else(|| {
                SequenceError::Ratios(levels.iter().map(|level| level.ratio).collect())
            })?),
        })
    }
}

/// One row of results, each slice as long as the row.
#[derive(Debug)]
pub struct PhaseRow<'a> {
    /// Φ in turns of the phase function, [`AbsolutePhase::UNKNOWN`] where not resolved.
    pub phase: &'a mut [AbsolutePhase],
    /// The finest level's modulation; 0 where the pixel is not resolved.
    pub modulation: &'a mut [Modulation],
    /// Resolved, or the first reason why not.
    pub trust: &'a mut [Trust],
}

/// A sequence that cannot be decoded.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum DecodeError {
    /// The levels of the sequence are of no known form.
    Sequence(SequenceError),
    /// Samples of fewer than 8 or more than 16 bits.
    BitDepth(u8),
    /// The processor is an x86-64 one that is older than SSSE3.
    Processor,
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
    /// The number of levels that have arrived does not fit the call.
    Level {
        /// Levels that have arrived.
        arrived: usize,
        /// Levels of the sequence.
        levels: usize,
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
            Self::Processor => f.write_str(
                "this processor has no SSSE3, with which phases are computed: take an x86-64 processor with SSSE3 or AVX2, or an aarch64 one",
            ),
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
            Self::Level { arrived, levels } => write!(
                f,
                "{arrived} of {levels} levels have arrived: decode all but the finest on arrival, from coarse to fine, then the finest"
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
    /// samples of `bit_depth` bits, with the least modulation of unknown noise.
    ///
    /// # Errors
    /// If the levels are of no known form, the bit depth is not 8 to 16, or the processor has no
    /// back-end.
    pub fn new(sequence: &Sequence, range: PhaseRange, bit_depth: u8) -> Result<Self, DecodeError> {
        if !(8..=16).contains(&bit_depth) {
            return Err(DecodeError::BitDepth(bit_depth));
        }
        let unwrapping = Unwrapping::recognise(sequence, range)?;
        Ok(Self {
            levels: sequence
                .levels()
                .iter()
                .map(|level| LevelPlan::new(level, bit_depth))
                .collect(),
            unwrapper: Unwrapper::new(unwrapping, sequence, range)?,
            unwrapping,
            information: information(unwrapping, sequence),
            backend: Backend::best().ok_or(DecodeError::Processor)?,
            frame_count: sequence.frame_count(),
            bit_depth,
            least: LeastModulation::default(),
            light_edges: None,
        })
    }

    /// The same decoder with another least modulation.
    pub fn with_least_modulation(mut self, least: LeastModulation) -> Self {
        let full_scale = self.full_scale();
        for level in &mut self.levels {
            level.trust_from(least, full_scale);
        }
        Self { least, ..self }
    }

    /// The same decoder, which refuses pixels beside which light changes so steeply that their phase is wrong
    /// by more than this noise of a sample explains ([`Trust::LightEdge`]).
    pub fn refusing_light_edges(self, noise: SampleNoise) -> Self {
        let sigma = |modulation| self.phase_noise(modulation, noise);
        let light_edges = Some(LightEdges::new(sigma));
        Self {
            light_edges,
            ..self
        }
    }

    /// The same decoder on another back-end of this machine; the bits are the same.
    pub fn with_backend(self, backend: Backend) -> Self {
        Self { backend, ..self }
    }

    /// The back-end in use.
    pub fn backend(&self) -> Backend {
        self.backend
    }

    /// How the levels are unwrapped.
    pub fn unwrapping(&self) -> Unwrapping {
        self.unwrapping
    }

    /// Whether the sequence is the fringe and its complement ([`Sequence::pair`]): [`Self::row`]
    /// has no phase of it.
    pub fn is_pair(&self) -> bool {
        self.frame_count == 2
    }

    /// Bits per sample.
    pub fn bit_depth(&self) -> u8 {
        self.bit_depth
    }

    /// Full scale of a sample, in counts.
    pub fn full_scale(&self) -> u16 {
        ((1_u32 << self.bit_depth) - 1) as u16
    }

    /// σ_Φ of a resolved pixel in turns: σ_I / 2π · √(2 / Σ N_i r_i² B²). B is the finest level's,
    /// the smallest of all, so that σ is not too small.
    ///
    /// `noise` is σ_I, the noise of one sample.
    pub fn phase_noise(&self, modulation: Modulation, noise: SampleNoise) -> f64 {
        let counts = modulation.counts(self.full_scale());
        let information = self.information * counts * counts;
        noise.at(counts) / core::f64::consts::TAU * libm::sqrt(2.0 / information)
    }

    /// The smallest modulation that is trusted.
    pub fn least_modulation(&self) -> LeastModulation {
        self.least
    }

    /// σ_B in counts: σ_I · √(2 / N) with σ_I = `noise` counts and the finest level's N.
    pub fn modulation_noise(&self, noise: f64) -> f64 {
        let shifts = self.levels.last().map_or(1, |level| level.frames.len());
        noise * libm::sqrt(2.0 / shifts as f64)
    }

    /// Checks that `frames` fit this decoder: count, equal size, sample type.
    ///
    /// # Errors
    /// Naming the frame that does not fit.
    pub fn check(&self, frames: &[FrameView<'_>]) -> Result<(), DecodeError> {
        self.check_frames(self.frame_count, frames)
    }

    fn check_frames(&self, expected: usize, frames: &[FrameView<'_>]) -> Result<(), DecodeError> {
        if frames.len() != expected {
            return Err(DecodeError::FrameCount {
                expected,
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

    /// Checks that `frames` fit the next level after those that have arrived: count, size, sample
    /// type.
    ///
    /// # Errors
    /// Naming what does not fit.
    pub fn check_arrival(
        &self,
        frames: &[FrameView<'_>],
        arrived: &Arrived,
    ) -> Result<(), DecodeError> {
        let Some(level) = self.levels.get(arrived.levels()) else {
            return Err(DecodeError::Level {
                arrived: arrived.levels(),
                levels: self.levels.len(),
            });
        };
        self.check_frames(level.frames.len(), frames)?;
        let (expected, given) = (arrived.size(), (frames[0].width(), frames[0].height()));
        if given != expected {
            return Err(DecodeError::FrameSize {
                frame: 0,
                expected,
                given,
            });
        }
        Ok(())
    }

    /// Checks that `frames` fit the finest level and that all others have arrived.
    ///
    /// # Errors
    /// Naming what does not fit.
    pub fn check_last(
        &self,
        frames: &[FrameView<'_>],
        arrived: &Arrived,
    ) -> Result<(), DecodeError> {
        if arrived.levels() + 1 != self.levels.len() {
            return Err(DecodeError::Level {
                arrived: arrived.levels(),
                levels: self.levels.len(),
            });
        }
        self.check_arrival(frames, arrived)
    }

    /// For each level, coarse to fine: the places of its frames in the sequence, in the order of
    /// their shifts.
    pub fn levels(&self) -> impl ExactSizeIterator<Item = &[usize]> {
        self.levels.iter().map(|level| &level.frames[..])
    }
}

/// Σ N_i r_i² (b_i/b_f)² over the levels that carry the result's accuracy: of geometric levels only
/// the finest, because the coarser ones only give fringe orders; of dense levels all, because they
/// are averaged. b_i/b_f is the fundamental of a level's waveform over that of the finest level,
/// whose modulation is known.
fn information(unwrapping: Unwrapping, sequence: &Sequence) -> f64 {
    let levels = sequence.levels();
    let accurate = match unwrapping {
        Unwrapping::Geometric => &levels[levels.len() - 1..],
        Unwrapping::DenseThree { .. } | Unwrapping::DenseTwo { .. } | Unwrapping::Single => levels,
    };
    let finest = levels[levels.len() - 1].waveform.fundamental();
    accurate
        .iter()
        .map(|level| {
            let share = level.waveform.fundamental() / finest;
            level.shifts() as f64 * level.ratio * level.ratio * share * share
        })
        .sum()
}
