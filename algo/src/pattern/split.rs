//! Split: how the frames of a measurement about a known map are divided among its levels.
//!
//! **Idea.** Every frame of a dense level carries accuracy, the more the nearer its ratio is to 1;
//! but the nearer the ratios, the larger the factor by which the noise of their beats is
//! multiplied. So the best split has as much information as the rate of wrong fringe orders that
//! nobody sees allows.
//!
//! **Equation.** σ_Φ² = σ_I² / (2π² Σ N_i r_i² b_i² B²) with the fundamentals b_i of the levels'
//! waveforms ([`super::Waveform`]), for ratios 1, 1 − 1/n² (not with two levels) and 1 − 1/n. The
//! rate of wrong orders that nobody sees is that of [`super::Slips`] with sines, at the map and at
//! the least modulation that is trusted.
//!
//! **Reach.** How far the phase may lie from the map: 0.40 turn for one level, n/2 − 0.2 for two,
//! n²/2 − n for three.

use super::slips::{sigma, unseen};
use super::{Shot, Waveforms};
use crate::trust::NOISE_OVER_LEAST;
use alloc::vec::Vec;

/// The largest rate of unseen wrong orders among the pixels of the least trusted modulation, if any
/// split keeps it.
const MAX_SLIPS: f64 = 2e-4;
/// Fewest and most shifts of a level: the kernels add up these without a weight for each sample.
const SHIFTS: core::ops::RangeInclusive<usize> = 3..=MAX_LEVEL_SHIFTS;
const MAX_LEVEL_SHIFTS: usize = 9;
/// Largest n that is tried; rates rise with n.
const MAX_N: u32 = 12;

/// The levels of a sequence, and how safe it is.
#[derive(Clone, Debug, PartialEq)]
pub struct Split {
    /// Ratio and number of shifts of each level, from coarse to fine.
    pub levels: heapless::Vec<(f64, usize), 3>,
    /// Rate of wrong fringe orders that leave no residual, among the pixels of the least trusted
    /// modulation, where the map is within reach; 0 for one level, which has no residuals.
    pub slips: f64,
    /// How far the phase may lie from the map, turns.
    pub reach: f64,
}

impl Split {
    /// The most accurate split of so many frames whose reach is at least `reach` turns and whose
    /// rate of unseen wrong orders is at most 2e-4; if no split has so low a rate, the one with the
    /// lowest. `None` if no split of so many frames has this reach.
    pub fn best(frames: usize, reach: f64, waveforms: Waveforms) -> Option<Self> {
        let fundamentals: [f64; MAX_LEVEL_SHIFTS + 1] =
            core::array::from_fn(|shifts| waveforms(shifts).fundamental());
        let information = |split: &Self| -> f64 {
            let of_level = |&(ratio, shifts): &(f64, usize)| {
                let b = fundamentals[shifts];
                shifts as f64 * ratio * ratio * b * b
            };
            split.levels.iter().map(of_level).sum()
        };
        // A lower rate is better until it is low enough, then more information.
        let worth = |split: &Self| (-split.slips.max(MAX_SLIPS), information(split));
        let splits = splits(frames).into_iter();
        splits
            .filter(|split| split.reach >= reach)
            .reduce(|best, other| match worth(&other) > worth(&best) {
                true => other,
                false => best,
            })
    }

    /// What each frame shows, the finest level last.
    pub fn shots(&self, waveforms: Waveforms) -> Vec<Shot> {
        let levels = self.levels.iter();
        levels
            .flat_map(|&(ratio, shifts)| Shot::level_as(ratio, shifts, waveforms))
            .collect()
    }

    /// A split with these levels, from coarse to fine.
    fn of<const LEVELS: usize>(levels: [(f64, usize); LEVELS], slips: f64, reach: f64) -> Self {
        Self {
            levels: levels.into_iter().collect(),
            slips,
            reach,
        }
    }
}

/// All splits of so many frames.
fn splits(frames: usize) -> Vec<Split> {
    let mut splits = Vec::new();
    if SHIFTS.contains(&frames) {
        splits.push(Split::of([(1.0, frames)], 0.0, 0.4));
    }
    for n in (2..=MAX_N).map(f64::from) {
        let (coarse, middle) = (1.0 - 1.0 / n, 1.0 - 1.0 / (n * n));
        for finest in SHIFTS {
            let rest = frames.saturating_sub(finest);
            let wrong = |terms: &[_]| unseen(NOISE_OVER_LEAST * sigma(terms));
            let fast = |c: usize| wrong(&[(n - 1.0, finest, 1.0), (n, c, 1.0)]);
            if SHIFTS.contains(&rest) {
                let levels = [(coarse, rest), (1.0, finest)];
                splits.push(Split::of(levels, fast(rest), n / 2.0 - 0.2));
            }
            for m in SHIFTS {
                let c = rest.saturating_sub(m);
                if SHIFTS.contains(&c) && n >= 3.0 {
                    let slow = wrong(&[(n - 1.0, finest, 1.0), (n, m, 1.0), (1.0, c, 1.0)]);
                    let levels = [(coarse, c), (middle, m), (1.0, finest)];
                    splits.push(Split::of(levels, slow + fast(c), n * n / 2.0 - n));
                }
            }
        }
    }
    splits
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pattern::{PhaseRange, Sequence, Unwrapping, Waveform};

    fn shifts(frames: usize, reach: f64) -> Vec<usize> {
        let split = Split::best(frames, reach, Waveform::brightest).unwrap();
        split.levels.iter().map(|level| level.1).collect()
    }

    #[test]
    fn the_frames_are_divided_for_the_most_accuracy_that_is_safe() {
        assert_eq!(shifts(12, 2.3), [5, 7]);
        assert_eq!(shifts(9, 2.3), [4, 5]);
        assert_eq!(shifts(24, 2.3), [6, 9, 9]);
        // Two levels of three are the only way for so few, whatever their rate.
        assert_eq!(shifts(6, 2.3), [3, 3]);
        assert_eq!(Split::best(5, 2.3, Waveform::brightest), None);
        for frames in 3..=6 {
            assert_eq!(shifts(frames, 0.4), [frames]);
        }
        // A shorter reach allows a coarser second level, and so fewer shifts for it.
        assert_eq!(shifts(12, 1.8), [3, 9]);
    }

    #[test]
    fn the_known_rates_of_two_levels_of_three_are_found() {
        // At 16 counts and a noise of 3.68: 0.18 %.
        let split = Split::best(6, 2.3, Waveform::sine).unwrap();
        assert!((split.slips - 1.72e-3).abs() < 1e-5, "{}", split.slips);
        let safe = Split::best(12, 2.3, Waveform::sine).unwrap();
        assert!(safe.slips < MAX_SLIPS, "{}", safe.slips);
    }

    #[test]
    fn every_split_is_a_sequence_that_can_be_unwrapped_over_its_reach() {
        let range = PhaseRange {
            min: 0.0,
            max: 150.0,
        };
        for frames in [24, 12, 9, 6, 5, 4, 3] {
            let reach = if frames < 6 { 0.4 } else { 2.3 };
            let split = Split::best(frames, reach, Waveform::brightest).unwrap();
            let shots = split.shots(Waveform::brightest);
            assert_eq!(shots.len(), frames);
            let sequence = Sequence::from_frames(&shots).unwrap();
            let unwrapping = Unwrapping::recognise(&sequence, range).unwrap();
            let unambiguous = match unwrapping {
                Unwrapping::Single => 0.5,
                Unwrapping::DenseTwo { n } => n / 2.0,
                Unwrapping::DenseThree { n } => n * n / 2.0,
                Unwrapping::Geometric => 0.0,
            };
            assert!(reach <= split.reach && split.reach < unambiguous);
        }
    }
}
