//! Slips: how often a pixel gets a wrong fringe order that leaves no residual, so that nobody sees
//! it.
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

use super::sequence::MAX_LEVELS;
use super::{Level, PhaseRange, Sequence, SequenceError, Unwrapping};
use core::f64::consts::{SQRT_2, TAU};

/// One turn less the largest residual.
const UNSEEN: f64 = 0.60;

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

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::pattern::{Shot, Waveform, Waveforms};
    use std::vec::Vec;

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
}
