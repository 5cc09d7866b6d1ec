//! Sequences: which level and shift each frame is, and how the levels are unwrapped.

use super::function::MAX_TURNS;
use super::{PhaseRange, Shot, Waveform};
use alloc::vec::Vec;

/// Levels that a sequence may have.
pub const MAX_LEVELS: usize = 8;
/// Shifts that a level may have: the kernels' sums hold 64 samples of 16 bits.
pub const MAX_SHIFTS: usize = 64;
/// Frames that a sequence may have.
pub const MAX_FRAMES: usize = MAX_LEVELS * MAX_SHIFTS;
/// How far a shift may lie from its place on the equally spaced grid, in turns.
const SHIFT_TOLERANCE: f64 = 1e-6;
/// How far a ratio may lie from the dense form.
const RATIO_TOLERANCE: f64 = 1e-6;
/// Largest span of the coarsest level, in turns, that is still absolute by itself.
const GEOMETRIC_SPAN: f64 = 1.001;
/// Largest factor from the ratio of one geometric level to the next: a level's error of up to
/// 1.4e-4 turn, times the factor, must stay far below the 0.40 turn that a residual may have.
pub const MAX_LEVEL_FACTOR: f64 = 64.0;
/// Largest n of dense levels: Φ − Φ₀ then stays within ± 450 turns, which 16-bit words hold with 5
/// fractional bits.
pub const MAX_DENSE_N: f64 = 30.0;

/// All shifts at one ratio of the full phase function: s_k = start + k/N.
#[derive(Clone, Debug, PartialEq)]
pub struct Level {
    /// Share r of the full phase function.
    pub ratio: f64,
    /// Shift of the first frame, in turns.
    pub start: f64,
    /// For k = 0 … N−1, the place in the sequence of the frame with shift start + k/N.
    pub frames: heapless::Vec<u16, MAX_SHIFTS>,
    /// What each frame shows for a turn of phase.
    pub waveform: Waveform,
}

impl Level {
    /// N, the number of shifts.
    pub fn shifts(&self) -> usize {
        self.frames.len()
    }
}

/// Which level and shift each frame of a measurement is; levels from coarse to fine.
#[derive(Clone, Debug, PartialEq)]
pub struct Sequence {
    levels: heapless::Vec<Level, MAX_LEVELS>,
    frame_count: usize,
}

/// Frames that do not form a sequence, or a sequence that cannot be unwrapped.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SequenceError {
    /// There are no frames.
    #[error("there are no frames: a level needs at least 3")]
    Empty,
    /// A ratio is not a positive finite number, or a shift not finite.
    #[error(
        "a frame with ratio {ratio} and shift {shift}: both must be finite and the ratio positive"
    )]
    NotFinite {
        /// Its ratio.
        ratio: f64,
        /// Its shift in turns.
        shift: f64,
    },
    /// More levels than [`MAX_LEVELS`].
    #[error("{0} levels where at most {MAX_LEVELS} can be decoded")]
    TooManyLevels(usize),
    /// A level has fewer than 3 shifts or more than [`MAX_SHIFTS`].
    #[error("the level of ratio {ratio} has {shifts} shifts: it needs 3 to {MAX_SHIFTS}")]
    Shifts {
        /// The level's ratio.
        ratio: f64,
        /// Its number of shifts.
        shifts: usize,
    },
    /// The shifts of a level are not equally spaced over one turn.
    #[error(
        "the {shifts} shifts of the level of ratio {ratio} are not equally spaced over one turn: \
         {shift} is off its place; shifts of a level are start + k/{shifts}"
    )]
    Spacing {
        /// The level's ratio.
        ratio: f64,
        /// Its number of shifts.
        shifts: usize,
        /// The shift that is not on the grid, in turns.
        shift: f64,
    },
    /// The frames of a level show different waveforms.
    #[error(
        "the frames of the level of ratio {0} have different harmonics: all frames of a level show the same waveform"
    )]
    Waveforms(f64),
    /// A harmonic of a level would be taken for the fundamental.
    #[error(
        "harmonic {order} of the level of ratio {ratio} cannot be told from its fundamental by {shifts} shifts: \
         harmonics must not be 1 more or less than a multiple of the number of shifts"
    )]
    Alias {
        /// The level's ratio.
        ratio: f64,
        /// The harmonic.
        order: u8,
        /// The level's number of shifts.
        shifts: usize,
    },
    /// The ratios have no form that can be unwrapped.
    #[error(
        "levels of ratios {0:?} cannot be unwrapped: the smallest must span at most one turn \
         of the pattern (geometric), or they are 1, 1 - 1/n^2, 1 - 1/n with n >= 3 or 1, 1 - 1/n \
         with n >= 2 (dense, n up to {MAX_DENSE_N}), or a single one"
    )]
    Ratios(Vec<f64>),
    /// The finest level's ratio or phase is too small or large for fixed point.
    #[error(
        "the finest level has ratio {ratio} and {turns} turns: the ratio must be at least 1/{MAX_LEVEL_FACTOR} \
         and the phase at most {MAX_TURNS} turns"
    )]
    Finest {
        /// Its ratio.
        ratio: f64,
        /// Its largest phase in turns.
        turns: f64,
    },
    /// The factor between two geometric levels is too large.
    #[error(
        "the step from ratio {from} to {to} is over {MAX_LEVEL_FACTOR}, or too long beside the other levels: put a level \
         between them"
    )]
    Step {
        /// Ratio of the coarser level.
        from: f64,
        /// Ratio of the finer level.
        to: f64,
    },
}

impl Sequence {
    /// The sequence of what each frame shows, in the order of the frames.
    ///
    /// Frames of equal ratio form a level; within it the shifts may come in any order and start
    /// anywhere.
    ///
    /// # Errors
    /// If a level has a number of shifts out of range or they are not equally spaced, its frames
    /// show different waveforms or one that its shifts cannot demodulate, or there are too many
    /// levels.
    pub fn from_frames(frames: &[Shot]) -> Result<Self, SequenceError> {
        if frames.is_empty() {
            return Err(SequenceError::Empty);
        }
        let finite =
            |shot: &Shot| shot.ratio.is_finite() && shot.ratio > 0.0 && shot.shift.is_finite();
        if let Some(&Shot { ratio, shift, .. }) = frames.iter().find(|shot| !finite(shot)) {
            return Err(SequenceError::NotFinite { ratio, shift });
        }
        let mut ratios: Vec<f64> = frames.iter().map(|shot| shot.ratio).collect();
        ratios.sort_by(f64::total_cmp);
        ratios.dedup();
        let mut levels = heapless::Vec::new();
        for &ratio in &ratios {
            levels
                .push(Self::level(ratio, frames)?)
                .map_err(|_| SequenceError::TooManyLevels(ratios.len()))?;
        }
        Ok(Self {
            levels,
            frame_count: frames.len(),
        })
    }

    fn level(ratio: f64, frames: &[Shot]) -> Result<Level, SequenceError> {
        let of_level = || frames.iter().filter(|shot| shot.ratio == ratio);
        let waveform = of_level().map(|shot| shot.waveform).next();
        let waveform = waveform.unwrap_or_default();
        if of_level().any(|shot| shot.waveform != waveform) {
            return Err(SequenceError::Waveforms(ratio));
        }
        let frames: Vec<(u16, f64)> = (0..)
            .zip(frames)
            .filter(|(_, shot)| shot.ratio == ratio)
            .map(|(at, shot)| (at, shot.shift))
            .collect();
        let shifts = frames.len();
        if !(3..=MAX_SHIFTS).contains(&shifts) {
            return Err(SequenceError::Shifts { ratio, shifts });
        }
        if let Some(order) = waveform.alias(shifts) {
            return Err(SequenceError::Alias {
                ratio,
                order,
                shifts,
            });
        }
        let start = frames[0].1 - libm::floor(frames[0].1);
        let mut places = [None; MAX_SHIFTS];
        for (at, shift) in frames {
            let place = (shift - start) * shifts as f64;
            let nearest = libm::rint(place);
            let slot = nearest - shifts as f64 * libm::floor(nearest / shifts as f64);
            // A shift of so many turns that its fraction is lost is not on the grid.
            let on_grid =
                slot >= 0.0 && libm::fabs(place - nearest) <= SHIFT_TOLERANCE * shifts as f64;
            match places[..shifts].get_mut(slot as usize) {
                Some(free @ None) if on_grid => *free = Some(at),
                _ => {
                    return Err(SequenceError::Spacing {
                        ratio,
                        shifts,
                        shift,
                    });
                }
            }
        }
        Ok(Level {
            ratio,
            start,
            frames: places.iter().flatten().copied().collect(),
            waveform,
        })
    }

    /// The standard geometric sequence for a phase function: `levels` levels of `shifts` shifts
    /// k/N, frames from coarse to fine.
    ///
    /// The coarsest level spans 0.94 turn (one turn less a margin for noise on both sides), the
    /// finest has ratio 1, the factors between them are equal.
    pub fn geometric(range: PhaseRange, levels: usize, shifts: usize) -> Vec<Shot> {
        let step = libm::pow(
            (range.span() / 0.94).max(1.0),
            1.0 / (levels.max(2) - 1) as f64,
        );
        (0..levels)
            .flat_map(|level| {
                let ratio = libm::pow(step, -((levels - 1 - level) as f64));
                Shot::level(ratio, shifts)
            })
            .collect()
    }

    /// The fringe and its complement at ratio 1: a level of two shifts, which no pixel can be
    /// demodulated from by itself. [`crate::inspect::Production::place_pair`] fits it over windows.
    pub fn pair() -> Self {
        let level = Level {
            ratio: 1.0,
            start: 0.0,
            frames: [0, 1].into_iter().collect(),
            waveform: Waveform::SINE,
        };
        Self {
            levels: [level].into_iter().collect(),
            frame_count: 2,
        }
    }

    /// Three dense levels of `shifts` shifts: ratios 1, 1 − 1/n², 1 − 1/n, in this order.
    pub fn dense(n: f64, shifts: usize) -> Vec<Shot> {
        [1.0, 1.0 - 1.0 / (n * n), 1.0 - 1.0 / n]
            .into_iter()
            .flat_map(|ratio| Shot::level(ratio, shifts))
            .collect()
    }

    /// The levels from coarse to fine.
    pub fn levels(&self) -> &[Level] {
        &self.levels
    }

    /// Number of frames.
    pub fn frame_count(&self) -> usize {
        self.frame_count
    }
}

/// How the levels of a sequence become an absolute phase.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Unwrapping {
    /// From coarse to fine; absolute by itself.
    Geometric,
    /// By the beats of ratios 1, 1 − 1/n², 1 − 1/n about a known map.
    DenseThree {
        /// The n of the ratios.
        n: f64,
    },
    /// By the beat of ratios 1, 1 − 1/n about a known map.
    DenseTwo {
        /// The n of the ratios.
        n: f64,
    },
    /// One level within half a turn of a known map.
    Single,
}

impl Unwrapping {
    /// Phases that differ by so many turns look the same; infinite where none do.
    #[must_use]
    pub fn period(self) -> f64 {
        match self {
            Self::Geometric => f64::INFINITY,
            Self::DenseThree { n } => n * n,
            Self::DenseTwo { n } => n,
            Self::Single => 1.0,
        }
    }

    /// Recognises the form of a sequence for a phase function with this range.
    ///
    /// # Errors
    /// If the ratios have no known form.
    pub fn recognise(sequence: &Sequence, range: PhaseRange) -> Result<Self, SequenceError> {
        let ratios: heapless::Vec<f64, MAX_LEVELS> =
            sequence.levels().iter().map(|level| level.ratio).collect();
        let finest = ratios[ratios.len() - 1];
        let turns = finest * libm::fabs(range.max).max(libm::fabs(range.min));
        if !(finest >= 1.0 / MAX_LEVEL_FACTOR && turns <= MAX_TURNS) {
            return Err(SequenceError::Finest {
                ratio: finest,
                turns,
            });
        }
        let near = |a: f64, b: f64| libm::fabs(a - b) <= RATIO_TOLERANCE;
        if ratios[0] * range.span() <= GEOMETRIC_SPAN {
            if let Some(pair) = ratios
                .windows(2)
                .find(|pair| pair[1] / pair[0] > MAX_LEVEL_FACTOR)
            {
                return Err(SequenceError::Step {
                    from: pair[0],
                    to: pair[1],
                });
            }
            return Ok(Self::Geometric);
        }
        // For a ratio of 1 or more n is ≤ 0 or infinite.
        let n = 1.0 / (1.0 - ratios[0]);
        let reachable = n > 0.0 && n <= MAX_DENSE_N * (1.0 + RATIO_TOLERANCE);
        match ratios[..] {
            [_] => Ok(Self::Single),
            [low, one] if near(one, 1.0) && low >= 0.5 - RATIO_TOLERANCE && reachable => {
                Ok(Self::DenseTwo { n })
            }
            [_, middle, one]
                if near(one, 1.0)
                    && n >= 3.0 - 1e-5
                    && reachable
                    && near(middle, 1.0 - 1.0 / (n * n)) =>
            {
                Ok(Self::DenseThree { n })
            }
            _ => Err(SequenceError::Ratios(ratios.to_vec())),
        }
    }

    /// Whether the levels are unwrapped about a known map.
    pub fn needs_map(self) -> bool {
        self != Self::Geometric
    }

    /// The word for reports: geometric, dense or single.
    pub fn kind(self) -> &'static str {
        match self {
            Self::Geometric => "geometric",
            Self::DenseThree { .. } | Self::DenseTwo { .. } => "dense",
            Self::Single => "single",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec;
    use std::vec::Vec;

    const SPAN_100: PhaseRange = PhaseRange {
        min: 0.0,
        max: 100.0,
    };

    fn levels(ratios: &[f64]) -> Sequence {
        let frames: Vec<_> = ratios
            .iter()
            .flat_map(|&ratio| Shot::level(ratio, 3))
            .collect();
        Sequence::from_frames(&frames).unwrap()
    }

    fn shifted(shifts: &[f64]) -> Vec<Shot> {
        shifts.iter().map(|&shift| Shot::sine(1.0, shift)).collect()
    }

    #[test]
    fn shifts_may_come_in_any_order_and_from_any_start() {
        let sequence =
            Sequence::from_frames(&shifted(&[0.25, -0.083_333_333_33, -0.416_666_666_7]));
        let sequence = sequence.unwrap();
        let level = &sequence.levels()[0];
        assert_eq!(level.start, 0.25);
        assert_eq!(level.frames, [0, 2, 1]);
    }

    #[test]
    fn levels_go_from_coarse_to_fine() {
        let sequence = levels(&[1.0, 0.01, 0.1]);
        let ratios: Vec<_> = sequence.levels().iter().map(|level| level.ratio).collect();
        assert_eq!(ratios, [0.01, 0.1, 1.0]);
        assert_eq!(sequence.levels()[0].frames, [3, 4, 5]);
    }

    #[test]
    fn unequal_few_and_repeated_shifts_are_refused() {
        let unequal = shifted(&[0.0, 0.3, 0.6]);
        assert!(matches!(
            Sequence::from_frames(&unequal),
            Err(SequenceError::Spacing { shifts: 3, .. })
        ));
        let repeated = shifted(&[0.0, 0.25, 0.5, 0.5]);
        assert!(matches!(
            Sequence::from_frames(&repeated),
            Err(SequenceError::Spacing { shifts: 4, .. })
        ));
        assert!(matches!(
            Sequence::from_frames(&repeated[..2]),
            Err(SequenceError::Shifts { shifts: 2, .. })
        ));
        assert_eq!(Sequence::from_frames(&[]), Err(SequenceError::Empty));
        let unknown = Shot::sine(f64::NAN, 0.0);
        assert!(Sequence::from_frames(&[unknown; 3]).is_err());
    }

    #[test]
    fn a_level_of_mixed_waveforms_or_with_an_alias_is_refused() {
        let mut mixed: Vec<Shot> = Shot::level_as(1.0, 5, Waveform::brightest).collect();
        assert!(Sequence::from_frames(&mixed).is_ok());
        mixed[3].waveform = Waveform::SINE;
        assert_eq!(
            Sequence::from_frames(&mixed),
            Err(SequenceError::Waveforms(1.0))
        );
        let waveform = Waveform::brightest(5);
        let four: Vec<_> = Shot::level(1.0, 4)
            .map(|shot| Shot { waveform, ..shot })
            .collect();
        assert!(matches!(
            Sequence::from_frames(&four),
            Err(SequenceError::Alias { order: 3, .. })
        ));
    }

    #[test]
    fn each_form_is_recognised_and_anything_else_refused_with_its_ratios() {
        let recognise = |ratios: &[f64]| Unwrapping::recognise(&levels(ratios), SPAN_100);
        assert_eq!(recognise(&[0.01, 0.1, 1.0]), Ok(Unwrapping::Geometric));
        assert_eq!(recognise(&[0.010_009, 0.5]), Ok(Unwrapping::Geometric));
        assert_eq!(recognise(&[0.7]), Ok(Unwrapping::Single));
        let Ok(Unwrapping::DenseThree { n }) = recognise(&[1.0, 35.0 / 36.0, 5.0 / 6.0]) else {
            panic!("not dense");
        };
        assert!((n - 6.0).abs() < 1e-9);
        assert!(matches!(
            recognise(&[0.8, 1.0]),
            Ok(Unwrapping::DenseTwo { n }) if (n - 5.0).abs() < 1e-9
        ));
        for ratios in [
            vec![0.1, 1.0],
            vec![0.5, 0.9, 1.0],
            vec![0.8, 0.9, 0.95, 1.0],
        ] {
            assert_eq!(recognise(&ratios), Err(SequenceError::Ratios(ratios)));
        }
    }

    #[test]
    fn our_own_geometric_sequence_is_recognised_and_keeps_a_margin() {
        let frames = Sequence::geometric(SPAN_100, 3, 4);
        let sequence = Sequence::from_frames(&frames).unwrap();
        assert_eq!(
            Unwrapping::recognise(&sequence, SPAN_100),
            Ok(Unwrapping::Geometric)
        );
        assert!((sequence.levels()[0].ratio * 100.0 - 0.94).abs() < 1e-12);
        assert_eq!(sequence.levels()[2].ratio, 1.0);
    }
}
