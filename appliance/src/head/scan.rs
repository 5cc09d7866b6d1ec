//! One sequence of a pattern: takes its frames with the head, one of each or the mean of several, and
//! turns them into phases and heights. Everything but production, which measures in strips, measures
//! in this way.

use super::calibration::Calibration;
use super::rasters::rasters;
use super::seam;
use crate::error::{Exit, Failure};
use algo::chain::{ChainError, CodeError};
use algo::frame::{FrameError, FrameView, SampleNoise};
use algo::geometry::Triangulator;
use algo::pattern::{PhaseFunction, PhaseFunctionError, PhaseRange, Sequence, SequenceError, Shot};
use algo::phase::{DecodeError, Decoder, LeastModulation};
use algo::pipeline::{self, HeightMap, PhaseMap, Progress};
use algo::units::AbsolutePhase;
use hal::error::Error;
use hal::frame::Frame;
use hal::frame::FrameSum;
use hal::head::Head;
use std::time::Duration;

/// Projects the shots of a phase function and takes a frame of each, in their order. `progress`
/// gets the share of the frames taken.
///
/// # Errors
/// The error of the device that failed.
pub fn take(
    head: &mut Head,
    calibration: &Calibration,
    function: &PhaseFunction,
    shots: &[Shot],
    timeout: Duration,
    progress: &dyn Fn(f64),
) -> Result<Vec<Frame>, Error> {
    head.load(rasters(function, shots, calibration)?)?;
    take_loaded(head, shots.len(), timeout, progress)
}

/// Takes a frame of each of so many patterns, which are loaded. `progress` gets the share of the
/// frames taken.
///
/// # Errors
/// The error of the device that failed.
pub fn take_loaded(
    head: &mut Head,
    patterns: usize,
    timeout: Duration,
    progress: &dyn Fn(f64),
) -> Result<Vec<Frame>, Error> {
    let mut taken = Vec::with_capacity(patterns);
    let indices: Vec<usize> = (0..patterns).collect();
    head.acquire(&indices, timeout, &mut |_, frame| {
        taken.push(frame);
        progress(taken.len() as f64 / patterns as f64);
    })?;
    Ok(taken)
}

/// Why frames have no phases.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PhasesError {
    /// No projector of this size can show the pattern.
    #[error(transparent)]
    Function(#[from] PhaseFunctionError),
    /// The frames make no levels.
    #[error(transparent)]
    Sequence(#[from] SequenceError),
    /// The levels cannot be decoded, or frames, levels and map do not fit each other.
    #[error(transparent)]
    Decode(#[from] DecodeError),
    /// A frame is not one of its format.
    #[error(transparent)]
    Frame(#[from] FrameError),
    /// The levels form no chain.
    #[error(transparent)]
    Chain(#[from] ChainError),
    /// The pictures form no code.
    #[error(transparent)]
    Code(#[from] CodeError),
    /// A code of curved fringes.
    #[error("a Gray code numbers straight fringes")]
    CurvedFringes,
    /// A code whose pictures cannot be told dark from bright.
    #[error(
        "a Gray code alone has nothing to be compared with: add its inverse pictures, or white and black"
    )]
    NothingToCompare,
}

impl From<PhasesError> for Failure {
    fn from(error: PhasesError) -> Self {
        Self::new(Exit::Content, error)
    }
}

/// The frames of one sequence, ready to be decoded.
#[derive(Debug)]
pub struct Scan<'a> {
    /// Its levels and shifts.
    pub sequence: Sequence,
    /// How it is decoded.
    pub decoder: Decoder,
    /// The frames, in the order of the shots.
    pub frames: Vec<FrameView<'a>>,
}

impl<'a> Scan<'a> {
    /// The frames of `shots`, in their order, of a phase function of `range`.
    ///
    /// # Errors
    /// the shots make no sequence that can be decoded, or a frame is not one of its
    /// format.
    pub fn new(
        range: PhaseRange,
        shots: &[Shot],
        frames: impl IntoIterator<Item = &'a Frame>,
    ) -> Result<Self, PhasesError> {
        Self::with(range, shots, shots, frames)
    }

    /// As [`Self::new`] for levels that the decoder cannot unwrap. Its decoder is that of the
    /// finest level alone: it gives the noise of a phase that was unwrapped in another way
    /// ([`algo::chain`]).
    ///
    /// # Errors
    /// the shots are no levels, the finest is too fine or too coarse, or a frame is not
    /// one of its format.
    pub fn of_levels(
        range: PhaseRange,
        shots: &[Shot],
        frames: impl IntoIterator<Item = &'a Frame>,
    ) -> Result<Self, PhasesError> {
        let sequence = Sequence::from_frames(shots)?;
        let levels = sequence.levels();
        let finest = levels[levels.len() - 1].ratio;
        let alone: Vec<Shot> = shots
            .iter()
            .filter(|shot| shot.ratio == finest)
            .copied()
            .collect();
        Self::with(range, shots, &alone, frames)
    }

    /// The frames of `shots`, with a decoder of those that are `decoded`.
    fn with(
        range: PhaseRange,
        shots: &[Shot],
        decoded: &[Shot],
        frames: impl IntoIterator<Item = &'a Frame>,
    ) -> Result<Self, PhasesError> {
        let sequence = Sequence::from_frames(shots)?;
        let decoded = Sequence::from_frames(decoded)?;
        let frames: Vec<&Frame> = frames.into_iter().collect();
        let decoder = Decoder::new(&decoded, range, bit_depth(&frames))?;
        let frames: Result<_, FrameError> = frames.into_iter().map(seam::view).collect();
        Ok(Self {
            sequence,
            decoder,
            frames: frames?,
        })
    }

    /// This scan, trusting modulations from `least` on instead of the least one for unknown noise.
    pub fn trusting(self, least: LeastModulation) -> Self {
        Self {
            decoder: self.decoder.with_least_modulation(least),
            ..self
        }
    }

    /// Whether it is unwrapped about a map that must be known beforehand.
    pub fn needs_map(&self) -> bool {
        self.decoder.unwrapping().needs_map()
    }

    /// The phases, unwrapped about `map` (row-major) where one is needed.
    ///
    /// # Errors
    /// frames and map do not fit each other.
    pub fn phases(&self, map: Option<&[AbsolutePhase]>) -> Result<PhaseMap, PhasesError> {
        Ok(pipeline::decode(&self.decoder, &self.frames, map, None)?)
    }

    /// The noise of a sample by the modulation of its pixel.
    pub fn noise(&self, calibration: &Calibration, phases: &PhaseMap) -> SampleNoise {
        let own_scale = self.decoder.full_scale();
        let [offset, slope] =
            pipeline::signal_by_modulation(&self.sequence, &self.frames, own_scale, phases);
        // Means of frames have more bits than the camera's samples.
        let full_scale = (1_u32 << calibration.bit_depth) - 1;
        let unit = f64::from(full_scale) / f64::from(own_scale);
        calibration.noise.by([offset * unit, slope])
    }

    /// The heights of its phases, and their σ where the noise of a sample is known; phases outside
    /// of the working range lose their trust.
    pub fn heights(
        &self,
        triangulator: &Triangulator,
        noise: Option<SampleNoise>,
        phases: &mut PhaseMap,
        progress: Progress<'_>,
    ) -> HeightMap {
        pipeline::triangulate(triangulator, &self.decoder, noise, phases, progress)
    }
}

fn bit_depth(frames: &[&Frame]) -> u8 {
    frames.first().map_or(0, |first| first.format().bit_depth)
}

/// Takes [`FrameSum::CAPTURES`] frames of each of the loaded patterns, and gives their means. Where one of
/// the samples of a pixel was at full scale, so is its mean. `progress` gets the share of the
/// frames taken; it may end the captures by `false`, and then there are no means.
///
/// # Errors
/// The error of the device that failed.
pub fn mean_frames(
    head: &mut Head,
    patterns: usize,
    timeout: Duration,
    progress: &dyn Fn(f64) -> bool,
) -> Result<Option<Vec<Frame>>, Error> {
    let indices: Vec<usize> = (0..patterns).collect();
    let mut sums: Vec<FrameSum> = Vec::with_capacity(patterns);
    let mut taken = 0;
    let mut goes_on = progress(0.0);
    for _ in 0..FrameSum::CAPTURES {
        if !goes_on {
            return Ok(None);
        }
        head.acquire(&indices, timeout, &mut |at, frame| {
            if at == sums.len() {
                sums.push(FrameSum::new(&frame));
            }
            if let Some(sum) = sums.get_mut(at) {
                sum.add(&frame);
            }
            taken += 1;
            // A sequence is not interrupted.
            goes_on = progress(taken as f64 / (FrameSum::CAPTURES * patterns) as f64);
        })?;
    }
    let means: Result<_, _> = sums.into_iter().map(FrameSum::mean).collect();
    means.map(Some)
}
