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

/// A sequence of the better method: three dense levels, two of them, or a single one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BetterSequence {
    /// Three are unwrapped about the map of the preliminary measurement, fewer about the golden map.
    pub levels: usize,
    /// Shifts of each level.
    pub shifts: usize,
}

/// n of the dense levels: reaches ± 4 turns, as recipes have it.
const DENSE_N: f64 = 4.0;

/// The fixed pattern that pictures show.
pub const SHOWN_FIXED: Method = Method::Fixed { fringes: 100 };
/// The adaptive pattern that pictures show.
pub const SHOWN_ADAPTIVE: Method = Method::Better(BetterSequence::TWELVE);
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
    pub fn frame_count(self) -> usize {
        match self {
            Self::Fixed { .. } | Self::Paper { .. } => 12,
            Self::Better(frames) => frames.count(),
        }
    }

    /// What each frame of its measurement shows. Geometric levels are the paper's: 1, n, n² with n = √(max Φ_P), N = 4.
    pub fn shots(self, function: &PhaseFunction) -> Vec<Shot> {
        if let Self::Better(sequence) = self {
            return sequence.shots();
        }
        let max = function.range().max;
        let ratios = [1.0 / max, 1.0 / max.sqrt(), 1.0].into_iter();
        ratios.flat_map(|ratio| Shot::level(ratio, 4)).collect()
    }
}

impl BetterSequence {
    /// Three levels of four shifts.
    pub const TWELVE: Self = Self::new(3, 4);
    /// Three levels of three shifts.
    pub const NINE: Self = Self::new(3, 3);
    /// Two levels of three shifts.
    pub const SIX: Self = Self::new(2, 3);
    /// One level of four shifts.
    pub const FOUR: Self = Self::new(1, 4);
    /// All that are compared with the paper's pattern.
    const ALL: [Self; 5] = [
        Self::TWELVE,
        Self::NINE,
        Self::SIX,
        Self::FOUR,
        Self::new(1, 3),
    ];

    /// So many levels of so many shifts.
    pub const fn new(levels: usize, shifts: usize) -> Self {
        Self { levels, shifts }
    }

    /// Number of frames.
    pub fn count(self) -> usize {
        self.levels * self.shifts
    }

    /// Whether it is unwrapped about the golden map, not about the preliminary one.
    pub fn needs_golden(self) -> bool {
        self.levels < 3
    }

    /// What each frame shows.
    pub fn shots(self) -> Vec<Shot> {
        let level = |ratio| Shot::level(ratio, self.shifts);
        match self.levels {
            3 => Sequence::dense(DENSE_N, self.shifts),
            2 => level(1.0).chain(level(0.8)).collect(),
            _ => level(1.0).collect(),
        }
    }
}

/// The first frame of the finest level.
pub fn finest(shots: &[Shot]) -> usize {
    let ratio = shots.iter().map(|shot| shot.ratio).fold(0.0, f64::max);
    let found = shots.iter().position(|shot| shot.ratio == ratio);
    found.unwrap_or(0)
}
