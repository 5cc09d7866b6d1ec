//! How often a pixel is not trusted or gets a wrong fringe order, and how the frames of a
//! measurement are divided among its levels so that this is rare.
//!
//! # Slips
//!
//! A slip is a wrong fringe order that leaves no residual, so that nothing shows it.
//!
//! **Idea.** A step of unwrapping rounds a number of turns. If noise takes that over 1/2 turn, the
//! order is wrong. What is then left as a residual is one turn less that noise, so above 0.60 turn
//! it is below the limit of 0.40 again. About a map there is a second way: the first step is
//! unambiguous only within some turns of the map. The phase of a displaced part may lie near this
//! edge; then little noise takes it over the edge, and no level contradicts another.
//!
//! **Equation.** With σ_I the noise of a sample, B the modulation that a sine has, and the
//! fundamentals b_i of the levels' waveforms ([`super::Waveform`]), a level's wrapped phase has the
//! error δ_i with σ_i = (σ_I / B) √(2 / N_i) / (2π b_i). The steps of unwrapping round
//! (`phase::about`, and n = r_i / r_j from one geometric level j to the next, i)
//!
//! ```text
//! to the finest level, from the fast beat     (n − 1) δ_f − n δ_c
//! to the fast beat, from the slow one         (n − 1) δ_f − n δ_m + δ_c        with three dense levels
//! to the next geometric level                 n δ_j − δ_i
//! ```
//!
//! each with P = erfc(0.60 / (σ √2)). About a map, D turns from it, P = ½ erfc((E − |D|) / (σ √2))
//! is added: for one level E = 1/(2r) and σ = σ_f / r, for two E = n/2 and σ of n (δ_f − δ_c), for
//! three E = n²/2 and σ of n² (δ_f − δ_m).
//!
//! **Accuracy.** The errors of phases of faint pixels are not quite normal: at the least trusted
//! modulation and a noise of ± 2.5 % of full scale, normal noise makes 0.8 to 1.5 times as many
//! slips, and uniform noise fewer (`simulated_pixels_slip_as_often_as_predicted`).
//!
//! # Split
//!
//! **Idea.** Every frame of a dense level carries accuracy, the more the nearer its ratio is to 1;
//! but the nearer the ratios, the larger the factor by which the noise of their beats is
//! multiplied. So the best split has as much information as the largest accepted rate of slips
//! allows.
//!
//! **Equation.** σ_Φ² = σ_I² / (2π² Σ N_i r_i² b_i² B²) with the fundamentals b_i of the levels'
//! waveforms ([`super::Waveform`]), for ratios 1, 1 − 1/n² (not with two levels) and 1 − 1/n. The
//! rate of slips is that of [`Slips`] with sines, at the map and at the least modulation that is
//! trusted.
//!
//! **Reach.** How far the phase may lie from the map: 0.40 turn for one level, n/2 − 0.2 for two,
//! n²/2 − n for three.

use super::sequence::MAX_LEVELS;
use super::{Level, PhaseRange, Sequence, SequenceError, Shot, Unwrapping, Waveforms};
use crate::trust::{LeastModulation, MAX_RESIDUAL, NOISE_OVER_LEAST};
use alloc::vec::Vec;
use core::f64::consts::{SQRT_2, TAU};

/// Turns by which noise must move a step for its wrong order to leave no residual: one turn less the
/// largest residual.
const UNSEEN: f64 = 1.0 - MAX_RESIDUAL;
/// The largest rate of unseen wrong orders among the pixels of the least trusted modulation, if any
/// split keeps it.
const MAX_SLIPS: f64 = 2e-4;
/// Fewest and most shifts of a level: the kernels add up these without a weight for each sample.
const SHIFTS: core::ops::RangeInclusive<usize> = 3..=MAX_LEVEL_SHIFTS;
const MAX_LEVEL_SHIFTS: usize = 9;
/// Largest n that is tried; rates rise with n.
const MAX_N: u32 = 12;

impl Sequence {
    /// How likely all levels are trusted in one measurement of a pixel, by the modulation that a
    /// sine has there. It is in counts of samples with this full scale, and so is `noise`, σ of a
    /// sample. A level's modulation has σ_B = σ √(2 / N).
    pub fn chance_of_trust(
        &self,
        least: LeastModulation,
        noise: f64,
        full_scale: u16,
    ) -> impl Fn(f64) -> f64 {
        let least = least.counts(full_scale);
        let levels = self.levels().iter().map(|level| {
            let sharpness = libm::sqrt(level.shifts() as f64) / 2.0 / noise;
            (level.waveform.fundamental(), sharpness)
        });
        let levels: Vec<_> = levels.collect();
        move |modulation| {
            let trusted = |&(fundamental, sharpness): &(f64, f64)| {
                0.5 * libm::erfc((least - modulation * fundamental) * sharpness)
            };
            levels.iter().map(trusted).product()
        }
    }
}

/// How often the orders of a sequence are wrong, by its noise.
#[derive(Clone, Debug, PartialEq)]
pub struct Slips {
    /// σ of what each step rounds, in turns where σ_I = B.
    steps: heapless::Vec<f64, MAX_LEVELS>,
    /// About a map: how far from it the phase is unambiguous, and σ of that distance where σ_I = B,
    /// turns.
    edge: Option<(f64, f64)>,
}

impl Slips {
    /// The slips of a sequence of a phase function with this range.
    ///
    /// # Errors
    /// If the levels are of no known form.
    pub fn of(sequence: &Sequence, range: PhaseRange) -> Result<Self, SequenceError> {
        let levels = sequence.levels();
        let level = |at: usize, factor: f64| {
            let Level { waveform, .. } = &levels[at];
            (factor, levels[at].shifts(), waveform.fundamental())
        };
        let finest = levels.len() - 1;
        let mut steps = heapless::Vec::new();
        let edge = match Unwrapping::recognise(sequence, range)? {
            Unwrapping::Geometric => {
                for at in 1..levels.len() {
                    let factor = levels[at].ratio / levels[at - 1].ratio;
                    // There are fewer steps than levels.
                    let _ = steps.push(sigma(&[level(at - 1, factor), level(at, 1.0)]));
                }
                None
            }
            Unwrapping::Single => {
                let ratio = levels[finest].ratio;
                Some((0.5 / ratio, sigma(&[level(finest, 1.0 / ratio)])))
            }
            Unwrapping::DenseTwo { n } => {
                let _ = steps.push(sigma(&[level(finest, n - 1.0), level(0, n)]));
                Some((n / 2.0, sigma(&[level(finest, n), level(0, n)])))
            }
            Unwrapping::DenseThree { n } => {
                let fast = sigma(&[level(finest, n - 1.0), level(0, n)]);
                let slow = sigma(&[level(finest, n - 1.0), level(1, n), level(0, 1.0)]);
                let _ = steps.push(slow);
                let _ = steps.push(fast);
                let n2 = n * n;
                Some((n2 / 2.0, sigma(&[level(finest, n2), level(1, n2)])))
            }
        };
        Ok(Self { steps, edge })
    }

    /// The share of pixels that get a wrong order unseen, where a sample's noise is so many times
    /// the modulation that a sine has, and the phase lies `away` turns from the map.
    pub fn rate(&self, noise: f64, away: f64) -> f64 {
        let steps = self.steps.iter().map(|sigma| unseen(sigma * noise));
        let edge = self.edge.map_or(0.0, |(edge, sigma)| {
            0.5 * libm::erfc((edge - away) / (sigma * noise * SQRT_2))
        });
        (steps.sum::<f64>() + edge).min(1.0)
    }
}

/// σ of a sum of wrapped phases, each with its factor and its level's shifts and fundamental, in
/// turns where σ_I = B.
pub(super) fn sigma(terms: &[(f64, usize, f64)]) -> f64 {
    let variance = |&(factor, shifts, fundamental): &(f64, usize, f64)| {
        let factor = factor / fundamental;
        factor * factor * 2.0 / shifts as f64
    };
    libm::sqrt(terms.iter().map(variance).sum()) / TAU
}

/// How often a step is wrong unseen that rounds turns of this σ.
pub(super) fn unseen(sigma: f64) -> f64 {
    libm::erfc(UNSEEN / (sigma * SQRT_2))
}

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
pub(crate) mod tests {
    use super::*;
    use crate::pattern::{PhaseRange, Sequence, Shot, Unwrapping, Waveform, Waveforms};
    use std::vec::Vec;

    #[test]
    fn a_pixel_at_the_least_modulation_is_trusted_by_half_of_the_measurements_of_each_level() {
        let least = LeastModulation::default();
        let chance = |levels: &[f64], modulation| {
            let shots: Vec<_> = levels.iter().flat_map(|&r| Shot::level(r, 8)).collect();
            let sequence = Sequence::from_frames(&shots).unwrap();
            sequence.chance_of_trust(least, 2.0, 255)(modulation)
        };
        assert!((chance(&[1.0], 16.0) - 0.5).abs() < 1e-12);
        assert!((chance(&[0.75, 0.9375, 1.0], 16.0) - 0.125).abs() < 1e-12);
        // σ_B of eight shifts is half of a sample's.
        assert!((chance(&[1.0], 17.0) - 0.8413).abs() < 1e-4);
        assert!(chance(&[1.0], 40.0) > 1.0 - 1e-12);
    }

    pub(crate) const RANGE: PhaseRange = PhaseRange {
        min: 0.0,
        max: 100.0,
    };
    /// σ of uniform noise of ±2.5 % of full scale, counts of 255.
    pub(crate) const PAPER: f64 = 3.68;

    pub(crate) fn two(shifts: usize, waveforms: Waveforms) -> Vec<Shot> {
        let level = |ratio| Shot::level_as(ratio, shifts, waveforms);
        level(0.8).chain(level(1.0)).collect()
    }

    pub(crate) fn slips(shots: &[Shot]) -> Slips {
        Slips::of(&Sequence::from_frames(shots).unwrap(), RANGE).unwrap()
    }

    #[test]
    fn two_levels_of_three_have_the_known_rates() {
        let sines = slips(&two(3, Waveform::sine));
        assert!((sines.rate(PAPER / 16.0, 0.0) / 1.72e-3 - 1.0).abs() < 0.02);
        assert!((sines.rate(PAPER / 24.0, 0.0) / 2.5e-6 - 1.0).abs() < 0.1);
        let waves = slips(&two(3, Waveform::brightest));
        let fewer = sines.rate(PAPER / 16.0, 0.0) / waves.rate(PAPER / 16.0, 0.0);
        assert!((fewer / 5.8 - 1.0).abs() < 0.02, "{fewer}");
    }

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
