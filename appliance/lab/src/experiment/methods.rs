//! The methods that are compared, and the frames of each.

use algo::pattern::{PhaseFunction, Sequence, Shot};

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

/// The sequences of the better method.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BetterSequence {
    /// Three dense levels of four shifts about the map of the preliminary measurement.
    Twelve,
    /// Three dense levels of three shifts.
    Nine,
    /// Two dense levels of three shifts about the golden map.
    Six,
    /// One level of four shifts about the golden map.
    Four,
    /// One level of three shifts about the golden map.
    Three,
}

/// The fixed pattern that pictures show.
pub const SHOWN_FIXED: Method = Method::Fixed { fringes: 100 };
/// The adaptive pattern that pictures show.
pub const SHOWN_ADAPTIVE: Method = Method::Better(BetterSequence::Twelve);
/// The run that ratios refer to: the paper's adaptive pattern with its own image pitch.
pub const PAPER: Method = Method::Paper { image_pitch: 5 };

impl Method {
    /// The methods of a figure with these fixed patterns; the paper's pattern is among them.
    pub fn table(fringes: &[u32]) -> Vec<Self> {
        let fixed = fringes.iter().map(|&fringes| Self::Fixed { fringes });
        let papers = [PAPER, Self::Paper { image_pitch: 4 }];
        let better = BetterSequence::ALL.map(Self::Better);
        fixed.chain(papers).chain(better).collect()
    }

    /// Its name in tables: `fixed-49`, `paper-5`, `better-12`.
    pub fn name(self) -> String {
        match self {
            Self::Fixed { fringes } => format!("fixed-{fringes}"),
            Self::Paper { image_pitch } => format!("paper-{image_pitch}"),
            Self::Better(frames) => format!("better-{}", frames.count()),
        }
    }

    /// Frames of its measurement, without the preliminary ones that are measured once per part.
    pub fn frame_count(self) -> u32 {
        match self {
            Self::Fixed { .. } | Self::Paper { .. } => 12,
            Self::Better(frames) => frames.count(),
        }
    }
}

impl BetterSequence {
    /// All of them.
    pub const ALL: [Self; 5] = [Self::Twelve, Self::Nine, Self::Six, Self::Four, Self::Three];

    /// Number of frames.
    pub fn count(self) -> u32 {
        match self {
            Self::Twelve => 12,
            Self::Nine => 9,
            Self::Six => 6,
            Self::Four => 4,
            Self::Three => 3,
        }
    }

    /// Whether it is unwrapped about the golden map, not about the preliminary one.
    pub fn needs_golden(self) -> bool {
        !matches!(self, Self::Twelve | Self::Nine)
    }

    /// What each frame shows.
    pub fn shots(self) -> Vec<Shot> {
        match self {
            Self::Twelve => Sequence::dense(4.0, 4),
            Self::Nine => Sequence::dense(4.0, 3),
            Self::Six => Shot::level(1.0, 3).chain(Shot::level(0.8, 3)).collect(),
            Self::Four => Shot::level(1.0, 4).collect(),
            Self::Three => Shot::level(1.0, 3).collect(),
        }
    }
}

/// A geometric sequence as the paper has it: levels 1, n, n² with n = √(max Φ_P), N = 4.
pub fn geometric(function: &PhaseFunction) -> Vec<Shot> {
    let max = function.range().max;
    let ratios = [1.0 / max, 1.0 / max.sqrt(), 1.0].into_iter();
    ratios.flat_map(|ratio| Shot::level(ratio, 4)).collect()
}

/// The first frame of the finest level.
pub fn finest(shots: &[Shot]) -> usize {
    let ratio = shots.iter().map(|shot| shot.ratio).fold(0.0, f64::max);
    let found = shots.iter().position(|shot| shot.ratio == ratio);
    found.unwrap_or(0)
}
