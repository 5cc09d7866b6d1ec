//! Rows of frames → rows of absolute phase, modulation and trust.

use super::block::{LevelRow, Levels, about_row, geometric_row, wrap_row};
use super::level::Level;
use super::narrow::{MAX_PIXELS, PaddedLevel, RowSample, padded_level};
use super::unwrap::{Unwrapper, information};
use super::wrapped::{Wrapped, WrappedRow, WrappedRowMut};
use crate::frame::{FrameView, Samples};
use crate::pattern::{MAX_FRAMES, PhaseRange, Sequence, SequenceError, Unwrapping};
use crate::simd::Backend;
use crate::trust::Trust;
use crate::units::{AbsolutePhase, Modulation};
use alloc::vec::Vec;
use core::fmt;
use core::ops::Range;

/// Everything that decoding a sequence needs, worked out once.
#[derive(Clone, Debug)]
pub struct Decoder {
    /// From coarse to fine.
    levels: Vec<Level>,
    unwrapper: Unwrapper,
    unwrapping: Unwrapping,
    /// Σ N_i r_i² over the levels that carry the result's accuracy.
    information: f64,
    backend: Backend,
    frame_count: usize,
    bit_depth: u8,
}

/// What the levels of a row are made from.
#[derive(Clone, Copy)]
enum Source<'a> {
    /// All frames of the sequence.
    Frames(&'a [FrameView<'a>]),
    /// Levels demodulated before, and the frames of the finest in the order of its shifts.
    Last {
        before: &'a [Wrapped],
        last: &'a [FrameView<'a>],
    },
}

/// One row of results, each slice as long as the row.
#[derive(Debug)]
pub struct PhaseRow<'a> {
    /// Φ in turns of the phase function, [`AbsolutePhase::UNKNOWN`] where not resolved.
    pub phase: &'a mut [AbsolutePhase],
    /// The modulation that decides the phase's accuracy: of the finest level, or the mean of dense levels with weights
    /// N r². 0 where a level's is below the trusted minimum, and where nothing was looked at.
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
            levels: sequence
                .levels()
                .iter()
                .map(|level| Level::new(level, bit_depth))
                .collect(),
            unwrapper: Unwrapper::new(unwrapping, sequence, range)?,
            unwrapping,
            information: information(unwrapping, sequence),
            backend: Backend::best(),
            frame_count: sequence.frame_count(),
            bit_depth,
        })
    }

    /// The same on another back-end of this machine, with the same bits.
    pub fn with_backend(self, backend: Backend) -> Self {
        Self { backend, ..self }
    }

    /// The back-end that it runs on.
    pub fn backend(&self) -> Backend {
        self.backend
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
        let information = self.information * counts * counts;
        noise / core::f64::consts::TAU * libm::sqrt(2.0 / information)
    }

    /// Checks that `frames` are what this decoder was made for: count, equal size, sample type.
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

    /// Checks that `frames` are those of one level: count, equal size, sample type.
    ///
    /// # Errors
    /// Naming the frame that does not fit.
    pub fn check_level(&self, level: usize, frames: &[FrameView<'_>]) -> Result<(), DecodeError> {
        let steps = self.levels.get(level).map_or(0, |level| level.frames.len());
        self.check_frames(steps, frames)
    }

    /// Places in the sequence of the frames of a level, in the order of their shifts; levels from coarse to fine.
    pub fn levels(&self) -> impl ExactSizeIterator<Item = &[usize]> {
        self.levels.iter().map(|level| &level.frames[..])
    }

    /// Demodulates row `v` of a level whose frames [`Self::check_level`] has passed; not where `coarsest` says that a
    /// whole block is dark.
    pub(crate) fn wrap_row(
        &self,
        level: usize,
        frames: &[FrameView<'_>],
        v: usize,
        coarsest: Option<&Wrapped>,
        out: WrappedRowMut<'_>,
    ) {
        let before = coarsest.map(|coarsest| coarsest.row(v));
        if self.bit_depth == 8 {
            self.typed_wrap::<u8>(level, frames, v, before, out);
        } else {
            self.typed_wrap::<u16>(level, frames, v, before, out);
        }
    }

    fn typed_wrap<T: RowSample>(
        &self,
        level: usize,
        frames: &[FrameView<'_>],
        v: usize,
        before: Option<WrappedRow<'_>>,
        out: WrappedRowMut<'_>,
    ) {
        let (level, width) = (&self.levels[level], out.phase.len());
        let rows: Vec<&[T]> = frames.iter().map(|&frame| T::row(frame, v)).collect();
        if width >= MAX_PIXELS {
            wrap_row(self.backend, level, &rows, before, 0..width, out);
            return;
        }
        let padded = padded_level(&LevelRow::Frames(&rows), &(0..width));
        let rows: Vec<&[T]> = padded.samples().collect();
        let mut wide = Wrapped::new(MAX_PIXELS, 1);
        for row in wide.rows() {
            wrap_row(self.backend, level, &rows, None, 0..MAX_PIXELS, row);
        }
        out.phase.copy_from_slice(&wide.phase[..width]);
        out.modulation.copy_from_slice(&wide.modulation[..width]);
        out.doubts.copy_from_slice(&wide.doubts[..width]);
    }

    /// Decodes `columns` of row `v` of frames that [`Self::check`] has passed, into the same columns of `out`.
    ///
    /// `map` is the row of the known map for dense and single-level sequences and is not looked at otherwise.
    pub fn row(
        &self,
        frames: &[FrameView<'_>],
        v: usize,
        map: &[AbsolutePhase],
        columns: Range<usize>,
        out: PhaseRow<'_>,
    ) {
        self.sourced_row(Source::Frames(frames), v, map, columns, out);
    }

    /// As [`Self::row`], from levels demodulated on arrival (coarse to fine) and the frames of the finest.
    pub fn last_row(
        &self,
        before: &[Wrapped],
        last: &[FrameView<'_>],
        v: usize,
        map: &[AbsolutePhase],
        columns: Range<usize>,
        out: PhaseRow<'_>,
    ) {
        self.sourced_row(Source::Last { before, last }, v, map, columns, out);
    }

    fn sourced_row(
        &self,
        source: Source<'_>,
        v: usize,
        map: &[AbsolutePhase],
        columns: Range<usize>,
        out: PhaseRow<'_>,
    ) {
        if self.bit_depth == 8 {
            self.typed_row::<u8>(source, v, map, columns, out);
        } else {
            self.typed_row::<u16>(source, v, map, columns, out);
        }
    }

    fn typed_row<T: RowSample>(
        &self,
        source: Source<'_>,
        v: usize,
        map: &[AbsolutePhase],
        columns: Range<usize>,
        out: PhaseRow<'_>,
    ) {
        // Neither list can be longer than a sequence may be.
        let mut samples: heapless::Vec<&[T], MAX_FRAMES> = heapless::Vec::new();
        match source {
            Source::Frames(frames) => {
                let places = self.levels.iter().flat_map(|level| &level.frames);
                samples.extend(places.map(|&at| T::row(frames[at], v)));
            }
            Source::Last { last, .. } => {
                samples.extend(last.iter().map(|&frame| T::row(frame, v)));
            }
        }
        let before = match source {
            Source::Frames(_) => &[],
            Source::Last { before, .. } => before,
        };
        let mut rows: Levels<'_, T> = before
            .iter()
            .map(|wrapped| LevelRow::Wrapped(wrapped.row(v)))
            .collect();
        let mut samples = &samples[..];
        for level in &self.levels[before.len()..] {
            let (here, rest) = samples.split_at(level.frames.len());
            samples = rest;
            rows.extend([LevelRow::Frames(here)]);
        }
        if columns.len() >= MAX_PIXELS {
            self.columns(&rows, map, columns, out);
        } else {
            self.few_columns(&rows, map, columns, out);
        }
    }

    /// The levels of a row, from a copy that is wide enough for a block.
    fn few_columns<T: RowSample>(
        &self,
        rows: &[LevelRow<'_, T>],
        map: &[AbsolutePhase],
        columns: Range<usize>,
        out: PhaseRow<'_>,
    ) {
        let few = columns.len();
        let padded: Vec<PaddedLevel<T>> =
            rows.iter().map(|row| padded_level(row, &columns)).collect();
        let samples: Vec<Vec<&[T]>> = padded
            .iter()
            .map(|level| level.samples().collect())
            .collect();
        let levels: Levels<'_, T> = padded
            .iter()
            .zip(&samples)
            .map(|(level, samples)| level.row(samples))
            .collect();
        let mut phase = [AbsolutePhase::UNKNOWN; MAX_PIXELS];
        let mut modulation = [Modulation::default(); MAX_PIXELS];
        let mut trust = [Trust::default(); MAX_PIXELS];
        let mut known = [AbsolutePhase::UNKNOWN; MAX_PIXELS];
        if let Some(map) = map.get(columns.clone()) {
            known[..few].copy_from_slice(map);
        }
        let wide = PhaseRow {
            phase: &mut phase,
            modulation: &mut modulation,
            trust: &mut trust,
        };
        self.columns(&levels, &known, 0..MAX_PIXELS, wide);
        out.phase[columns.clone()].copy_from_slice(&phase[..few]);
        out.modulation[columns.clone()].copy_from_slice(&modulation[..few]);
        out.trust[columns].copy_from_slice(&trust[..few]);
    }

    fn columns<T: RowSample>(
        &self,
        rows: &[LevelRow<'_, T>],
        map: &[AbsolutePhase],
        columns: Range<usize>,
        out: PhaseRow<'_>,
    ) {
        match &self.unwrapper {
            Unwrapper::Geometric(plan) => {
                geometric_row(self.backend, plan, &self.levels, rows, columns, out);
            }
            Unwrapper::About(plan) => {
                about_row(self.backend, plan, &self.levels, rows, map, columns, out);
            }
        }
    }
}
