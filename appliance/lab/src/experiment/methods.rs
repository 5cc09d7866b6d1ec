//! The methods that are compared, and the frames of each.

use crate::adapt::split;
use algo::pattern::{PhaseFunction, Shot, Waveform, Waveforms};

/// A way to measure a part.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// Fixed pitch, three geometric levels of four shifts.
    Fixed {
        /// Fringes over the projector's width.
        fringes: u32,
    },
    /// The paper's adaptive pattern, three geometric levels of four shifts.
    Paper {
        /// p_I in camera pixels.
        image_pitch: u32,
    },
    /// The better pattern.
    Better(BetterSequence),
}

/// A sequence of the better method: as many levels and shifts as [`split`] divides the frames
/// among.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BetterSequence {
    /// Number of frames: 3 to 27.
    pub frames: usize,
    /// Whether all levels show sines instead of the brightest waveforms.
    pub sines: bool,
}

/// There is no better sequence of so many frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{frames} frames make no sequence")]
pub struct NoSequence {
    /// How many.
    pub frames: usize,
}

/// The fixed pattern that pictures show.
pub const SHOWN_FIXED: Method = Method::Fixed { fringes: 100 };
/// The adaptive pattern that pictures show.
pub const SHOWN_ADAPTIVE: Method = Method::Better(BetterSequence::TWELVE);
/// The run that ratios refer to: the paper's adaptive pattern with its own image pitch.
pub const PAPER: Method = Method::Paper { image_pitch: 5 };

impl Method {
    /// The methods of a figure with these fixed patterns; the paper's pattern is among them. With
    /// `sines` the better sequences show sines.
    pub fn table(fringes: &[u32], sines: bool) -> Vec<Self> {
        let fixed = fringes.iter().map(|&fringes| Self::Fixed { fringes });
        let papers = [PAPER, Self::Paper { image_pitch: 4 }];
        let better = BetterSequence::all(sines).map(Self::Better);
        fixed.chain(papers).chain(better).collect()
    }

    /// The method's name in tables: `fixed-49`, `paper-5`, `better-12`.
    pub fn name(self) -> String {
        match self {
            Self::Fixed { fringes } => format!("fixed-{fringes}"),
            Self::Paper { image_pitch } => format!("paper-{image_pitch}"),
            Self::Better(sequence) => format!("better-{}", sequence.frames),
        }
    }

    /// Frames of a measurement by the method, without the preliminary frames that are taken once
    /// per part.
    pub fn frame_count(self) -> usize {
        match self {
            Self::Fixed { .. } | Self::Paper { .. } => 12,
            Self::Better(sequence) => sequence.frames,
        }
    }

    /// What each frame of a measurement by the method shows. Geometric levels are the paper's: 1,
    /// n, n² with n = √(max Φ_P), N = 4.
    ///
    /// # Errors
    /// As [`BetterSequence::shots`].
    pub fn shots(self, function: &PhaseFunction) -> Result<Vec<Shot>, NoSequence> {
        if let Self::Better(sequence) = self {
            return sequence.shots();
        }
        let max = function.range().max;
        let ratios = [1.0 / max, 1.0 / max.sqrt(), 1.0].into_iter();
        Ok(ratios.flat_map(|ratio| Shot::level(ratio, 4)).collect())
    }
}

impl BetterSequence {
    /// 12 frames.
    pub const TWELVE: Self = Self::new(12);
    /// 9 frames.
    pub const NINE: Self = Self::new(9);
    /// 6 frames.
    pub const SIX: Self = Self::new(6);
    /// 4 frames.
    pub const FOUR: Self = Self::new(4);

    /// The sequence of so many frames, with the brightest waveforms.
    pub const fn new(frames: usize) -> Self {
        let sines = false;
        Self { frames, sines }
    }

    /// All sequences that are compared with the paper's pattern.
    fn all(sines: bool) -> impl Iterator<Item = Self> {
        let counts = [24, 12, 9, 6, 5, 4, 3].into_iter();
        counts.map(move |frames| Self { frames, sines })
    }

    /// Whether the sequence is unwrapped about the golden map, not about the preliminary map.
    pub fn needs_golden(self) -> bool {
        self.frames < 9
    }

    /// What each frame shows.
    ///
    /// # Errors
    /// If there is no sequence of so many frames.
    pub fn shots(self) -> Result<Vec<Shot>, NoSequence> {
        let waveforms: Waveforms = match self.sines {
            true => Waveform::sine,
            false => Waveform::brightest,
        };
        split(self.frames, waveforms)
            .map(|split| split.shots(waveforms))
            .ok_or(NoSequence {
                frames: self.frames,
            })
    }
}

/// The first frame of the finest level.
pub fn finest(shots: &[Shot]) -> usize {
    let ratio = shots.iter().map(|shot| shot.ratio).fold(0.0, f64::max);
    let found = shots.iter().position(|shot| shot.ratio == ratio);
    found.unwrap_or(0)
}
